"""The planner: its steps, its memory, its bits, what it refuses, and a motion that it keeps."""

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.bags.plans import decode_plan
from actuated_characters.bags.recording import Recording, read_recording
from actuated_characters.metrics.recording_metrics import plan_errors
from actuated_characters.metrics.state_hash import StateHash
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from controller_node.controller import Controller
from controller_node.interface.plan_message import plan_message
from controller_node.parameters import make_controller, resolve_for
from controller_node.planner.outlook import Outlook
from controller_node.planner.search import gauss_newton
from controller_node.planner.search.plan_search import PlanSearch
from controller_node.planner.search.round import LeastSquaresProblem, improve
from controller_node.planner.settings import make_planner_settings
from controller_node.references.factory import make_motion
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.errors import ConfigurationError, MessageError
from msgs_config.messages import topics, typed
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from tests.support.physics import character
from tests.support.ros import stamp_ns

HUMANOID = character("humanoid")
ENTRIES = np.arange(HUMANOID.layout.size)
CLOCK = TickClock(240)
OF_STATES = ("stamps_ns", "published_ns", "position", "velocity", "reference_position")
OF_TICKS = ("effort", "contacts", "applied_wrench")
QUICK = {
    "planner": "predictive",
    "plan.samples": 12,
    "plan.rounds": 1,
    "plan.horizon": 0.3,
}


def states_of(duration: float, clip: str = "walk", **given: object) -> str:
    """The hash of a run's states in this process."""
    controller = {**QUICK, **{name.replace("__", "."): value for name, value in given.items()}}
    plan = make_plan("humanoid", duration, {"reference": "clip", "clip": clip}, {}, controller)
    ticks, states = list(ticks_in_process(plan)), StateHash()
    for state in (*(tick.state for tick in ticks), ticks[-1].following):
        states.add(state)
    return states.hexdigest()


def a_controller(**given: object) -> Controller:
    """A controller that plans."""
    named = {**QUICK, "reference": "clip", "clip": "walk", **given}
    values = resolve_for(HUMANOID, named)
    return make_controller(HUMANOID, make_motion(HUMANOID, values).reference, values)


def states(controller: Controller, count: int) -> list[StampedState]:
    """Some states near the walk, a tick apart."""
    draw, found = np.random.default_rng(4), []
    motion = make_motion(HUMANOID, resolve_for(HUMANOID, {"reference": "clip", "clip": "walk"}))
    for tick in range(count):
        state = motion.reference.sample(tick / 240)
        position = state.configuration.position + 0.01 * draw.normal(size=HUMANOID.layout.size)
        found.append(StampedState(CLOCK.stamp_ns(1 + tick), position, state.velocity, None))
    return found


# Steps


def linear_problem(penalty: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A Jacobian (m, d), residuals (m,) at a place (d,) with residuals linear in it."""
    draw = np.random.default_rng(5)
    return draw.normal(size=(11, 4)), draw.normal(size=11), draw.normal(size=4)


def test_an_ensemble_that_spans_all_takes_the_step_of_gauss_and_newton() -> None:
    jacobian, residuals, place = linear_problem(0.3)
    distances = 2.0 * np.linalg.qr(np.random.default_rng(6).normal(size=(4, 4)))[0]  # E'E = s
    whole = np.concatenate((jacobian, np.sqrt(0.3) * np.eye(4)))
    here = np.concatenate((residuals, np.sqrt(0.3) * place))

    (step,) = gauss_newton.ensemble_steps(distances, distances @ whole.T, here, (0.7,))

    expected = np.linalg.solve(
        jacobian.T @ jacobian + (0.3 + 0.7) * np.eye(4), -(jacobian.T @ residuals + 0.3 * place)
    )
    np.testing.assert_allclose(step, expected, rtol=1e-9)


def test_sensitivities_are_the_slopes_and_their_step_is_gauss_and_newtons() -> None:
    jacobian, residuals, place = linear_problem(0.3)
    distances = np.random.default_rng(7).normal(size=(30, 4))

    found = gauss_newton.corrected_sensitivities(None, distances, distances @ jacobian.T)
    (step,) = gauss_newton.sensitivity_steps(found, residuals, place, 0.3, (0.7,))

    np.testing.assert_allclose(found, jacobian.T, atol=1e-4)
    expected = np.linalg.solve(
        jacobian.T @ jacobian + (0.3 + 0.7) * np.eye(4), -(jacobian.T @ residuals + 0.3 * place)
    )
    np.testing.assert_allclose(step, expected, atol=1e-4)


def test_few_samples_correct_what_is_known_and_leave_the_rest() -> None:
    jacobian, *_ = linear_problem(0.0)
    along = np.zeros((8, 4))
    along[:, 0] = 10.0 * np.random.default_rng(8).normal(size=8)
    known = jacobian.T + np.eye(4, 11)

    found = gauss_newton.corrected_sensitivities(known, along, along @ jacobian.T)

    np.testing.assert_allclose(found[0], jacobian[:, 0], atol=0.1)
    assert found[1:].tobytes() == known[1:].tobytes()


def test_a_round_finds_the_least_of_a_linear_problem_and_never_what_is_worse() -> None:
    jacobian, residuals, place = linear_problem(0.3)

    def of_places(places: FloatArray) -> FloatArray:
        rows: FloatArray = residuals + (places - place) @ jacobian.T
        rows[places[:, 0] > 3.0] = np.inf
        return rows

    problem = LeastSquaresProblem(of_places, lambda rows: rows, 0.3, 20.0)
    cost = np.inf
    sensitivities, here = None, np.zeros(4)
    for number in range(12):
        draws = np.random.default_rng(number).normal(size=(20, 4))
        found = improve(problem, here, draws, sensitivities)
        assert found.cost <= cost
        here_again = of_places(found.place[np.newaxis])[0]
        np.testing.assert_allclose(found.deviations[0], here_again, rtol=1e-12, atol=1e-12)
        cost, here, sensitivities = found.cost, found.place, found.sensitivities

    least = np.linalg.solve(
        jacobian.T @ jacobian + 0.3 * np.eye(4), jacobian.T @ (jacobian @ place - residuals)
    )
    assert cost == pytest.approx(
        float((of_places(least[np.newaxis])[0] ** 2).sum() + 0.3 * (least**2).sum()),
        rel=1e-3,
    )


def test_nothing_is_found_where_all_comes_to_nothing() -> None:
    nothing = LeastSquaresProblem(
        lambda places: np.full((len(places), 3), np.inf), lambda rows: rows, 0.1, 4.0
    )

    found = improve(nothing, np.zeros(2), np.ones((9, 2)), None)

    assert found.place.tolist() == [0.0, 0.0]
    assert found.cost == np.inf


@pytest.mark.parametrize(("sound", "about"), [(9, "the place itself"), (3, "most samples")])
def test_the_best_sample_is_found_where_steps_cannot_be(sound: int, about: str) -> None:
    draws = np.arange(18.0).reshape(9, 2) + 1.0
    here = np.zeros(2)

    def of_places(places: FloatArray) -> FloatArray:
        rows = places.copy()
        rows[1 + sound :] = np.inf  # rows: the place, and then the samples
        if about == "the place itself":
            rows[0] = np.inf
        return rows

    problem = LeastSquaresProblem(of_places, lambda rows: rows - 3.5, 0.0, 100.0)

    found = improve(problem, here, draws, None)

    assert found.place.tolist() == [3.0, 4.0]  # the sample nearest to the least, (3.5, 3.5)
    assert found.cost == 0.5
    assert found.sensitivities is None


@pytest.mark.slow
def test_a_costly_plan_is_sought_for_longer() -> None:
    def plan_with(rounds: int, tolerance: float) -> Outlook:
        controller = a_controller(**{"plan.rounds": rounds, "plan.tolerance": tolerance})
        sent = states(controller, 13)
        for state in (sent[0], sent[12]):
            controller.compute_effort(state, sent[0].stamp_ns)
        assert controller.outlook is not None
        return controller.outlook

    short, long, enough = plan_with(1, 0.0), plan_with(4, 0.0), plan_with(4, 1e9)

    assert long.costs.sum() < 0.98 * short.costs.sum()
    assert enough.centres.tobytes() == short.centres.tobytes()
    for_two = plan_with(8, 0.7 * float(short.costs.sum()))  # each round may cost as much
    assert for_two.centres.tobytes() == plan_with(2, 0.0).centres.tobytes()


# Bits


@pytest.mark.slow
def test_neither_threads_nor_what_else_is_done_change_a_bit() -> None:
    def walked(**given: object) -> str:
        return states_of(0.2, plan__rounds=2, plan__tolerance=0.0, **given)

    alone = walked(plan__workers=1)

    assert walked(plan__workers=2) == alone
    assert walked(plan__workers=4) == alone
    assert walked(plan__seed=1) != alone
    overlapping = walked(planning_delay_ticks=7, plan__workers=1)
    assert walked(planning_delay_ticks=7, plan__workers=2) == overlapping != alone


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0, 5, 12])
def test_a_state_that_comes_again_changes_nothing_and_an_episode_forgets_all(delay: int) -> None:
    controller = a_controller(planning_delay_ticks=delay)
    sent = states(controller, 26)
    first = sent[0].stamp_ns

    def answers(repeats: int) -> bytes:
        efforts = []
        for state in sent:
            for _ in range(repeats):
                effort, _ = controller.compute_effort(state, first)
            efforts.append(effort)
        return np.array(efforts).tobytes()

    once = answers(1)
    controller.begin_episode(first)
    assert answers(3) == once


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0, 5])
def test_a_state_of_before_is_planned_from_as_if_none_had_followed(delay: int) -> None:
    controller, fresh = (a_controller(planning_delay_ticks=delay) for _ in range(2))
    sent = states(controller, 40)
    first = sent[0].stamp_ns
    for state in sent[::6]:
        controller.compute_effort(state, first)

    effort, _ = controller.compute_effort(sent[2], first)

    expected, _ = fresh.compute_effort(sent[2], first)
    assert effort.tobytes() == expected.tobytes()


@pytest.mark.slow
def test_a_plan_is_of_the_state_that_its_delay_is_before() -> None:
    delay, acts = 5, 12

    def plan_at(moved: int) -> Outlook:
        """The second plan, where the states from a tick on are others."""
        controller = a_controller(planning_delay_ticks=delay)
        sent = states(controller, acts + 1)
        for tick, state in enumerate(sent):
            there = state.position + 0.05 * (tick >= moved)
            before = controller.outlook
            controller.compute_effort(replace(state, position=there), sent[0].stamp_ns)
            assert (controller.outlook is not before) == (tick in (0, acts))
        assert controller.outlook is not None
        return controller.outlook

    seen, later = plan_at(moved=acts - delay), plan_at(moved=acts - delay + 1)
    unmoved = plan_at(moved=acts + 1)

    assert later.centres.tobytes() == unmoved.centres.tobytes()
    assert seen.centres.tobytes() != unmoved.centres.tobytes()


def test_a_plan_that_is_taken_late_says_when_from_there() -> None:
    """In real time states are skipped: the plan of tick 12 is taken in tick 14."""
    controller = a_controller(planning_delay_ticks=5)
    sent = states(controller, 15)

    for tick in (0, 7, 14):
        controller.compute_effort(sent[tick], sent[0].stamp_ns)

    assert controller.outlook is not None
    np.testing.assert_allclose(controller.outlook.times, 0.05 * np.arange(1, 7) - 2 / 240)


@pytest.mark.parametrize(("tick", "is_over"), [(66, False), (67, True)])
def test_a_plan_is_over_when_it_would_end_before_the_next_one_acts(
    tick: int, is_over: bool
) -> None:
    """In real time states are skipped: the plan of tick 0 ends in tick 72, 5 ticks are delay."""
    controller = a_controller(planning_delay_ticks=5)
    sent = states(controller, tick + 1)
    controller.compute_effort(sent[0], sent[0].stamp_ns)
    before = controller.outlook

    controller.compute_effort(sent[tick], sent[0].stamp_ns)

    assert (controller.outlook is not before) == is_over


def test_what_is_done_while_a_plan_is_waited_for_changes_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    controller, other, done = a_controller(), a_controller(), threading.Event()
    controller.while_planning(done.set)
    (state,) = states(controller, 1)
    same, _ = other.compute_effort(state, state.stamp_ns)

    with monkeypatch.context() as patch:
        patch.setattr(PlanSearch, "find", _after(lambda: done.wait(60.0)))
        effort, _ = controller.compute_effort(state, state.stamp_ns)

    assert done.is_set()
    assert effort.tobytes() == same.tobytes()


def test_it_does_not_matter_who_is_faster(monkeypatch: pytest.MonkeyPatch) -> None:
    def efforts(before_a_search: float, before_an_answer: float) -> bytes:
        controller = a_controller(planning_delay_ticks=5)
        sent, found = states(controller, 26), []
        with monkeypatch.context() as patch:
            patch.setattr(PlanSearch, "find", _after(lambda: time.sleep(before_a_search)))
            for state in sent:
                time.sleep(before_an_answer)
                found.append(controller.compute_effort(state, sent[0].stamp_ns)[0])
        return np.array(found).tobytes()

    assert efforts(0.4, 0.0) == efforts(0.0, 0.05)


def _after(act: Callable[[], object]) -> Callable[..., Any]:
    """A search before which something is done."""
    find = PlanSearch.find

    def later(self: PlanSearch, *given: Any) -> Any:
        act()
        return find(self, *given)

    return later


@pytest.mark.parametrize("gives_way", [True, False])
def test_a_reference_gives_way_to_a_push_unless_it_is_to_stay(gives_way: bool) -> None:
    controller = a_controller(**{"plan.gives_way": gives_way})
    sent = states(controller, 25)

    for each in sent:
        pushed = replace(each, position=each.position + 0.4 * (ENTRIES == 0))
        controller.compute_effort(pushed, sent[0].stamp_ns)

    assert controller.outlook is not None
    assert (abs(controller.outlook.anchor.place) > 0.05) == gives_way


@pytest.mark.slow
@pytest.mark.parametrize("again", [6, 9])
def test_a_state_that_comes_while_a_plan_is_sought_is_no_news(again: int) -> None:
    """Pushed, so that the reference gives way; the plan of tick 12 is sought in tick 7."""
    controller, fresh = (a_controller(planning_delay_ticks=5) for _ in range(2))
    sent = states(controller, 26)
    pushed = [replace(each, position=each.position + 0.4 * (ENTRIES == 0)) for each in sent]

    def answers(of: Controller, ticks: list[int]) -> list[bytes]:
        return [of.compute_effort(pushed[tick], sent[0].stamp_ns)[0].tobytes() for tick in ticks]

    expected = answers(fresh, list(range(26)))
    found = answers(controller, [*range(10), *range(again, 26)])

    assert fresh.outlook is not None and abs(fresh.outlook.anchor.place) > 0.05
    assert found == expected[:10] + expected[again:]


@pytest.mark.nightly
def test_the_processors_kernels_do_not_matter(tmp_path: Path) -> None:
    """Code for any x86-64 gives what code for this one gives."""
    script = "from tests.controller_node.planner import test_planner as t\nprint(t.states_of(0.1))"
    environment = {
        **os.environ,
        "NUMBA_CPU_NAME": "generic",
        "NUMBA_CPU_FEATURES": "",
        "NUMBA_CACHE_DIR": str(tmp_path),
        "PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[3]), *sys.path]),
    }
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False
    )

    assert not done.returncode, done.stderr
    assert done.stdout.split() == [states_of(0.1)]


# A motion


@pytest.mark.parametrize(
    ("planner", "given", "threshold"),
    [
        ("none", {}, 0.02),
        ("predictive", {}, 0.1),
        ("predictive", {"contact_breaking_threshold": 0.02}, 0.02),
    ],
)
def test_runs_that_are_planned_have_contacts_that_keep_their_points(
    planner: str, given: dict[str, object], threshold: float
) -> None:
    plan = make_plan("humanoid", 0.1, {"clip": "walk"}, given, {"planner": planner})

    assert plan.simulator["contact_breaking_threshold"] == threshold


@pytest.mark.slow
@pytest.mark.parametrize(
    ("duration", "step"),
    [
        (0.6, 0.009),
        *(pytest.param(each, 0.0, marks=pytest.mark.nightly) for each in (0.6, 1.27)),
    ],
)
def test_a_walk_goes_on_by_its_joints_alone(duration: float, step: float) -> None:
    settings = {"planner": "predictive", "plan.step": step}
    plan = make_plan("humanoid", duration, {"reference": "clip", "clip": "walk"}, {}, settings)
    layout = HUMANOID.layout

    distances, turns = [], []
    for tick in ticks_in_process(plan):
        assert tick.following.effort is not None
        assert not tick.following.effort[:6].any()
        wanted = plan.reference.sample(len(turns) / 240 + 1 / 240).configuration
        difference = layout.difference(wanted, layout.configuration(tick.following.position))
        distances.append(np.linalg.norm(difference[:3]))
        turns.append(layout.norms(difference)[2:].mean())

    assert max(distances) < 0.3
    assert np.mean(distances) < 0.10
    assert np.mean(turns) < 0.25


# What it says


def test_it_says_where_each_plan_leads_and_what_that_costs() -> None:
    controller = a_controller()
    sent = states(controller, 13)
    outlooks = []
    for state in sent:
        controller.compute_effort(state, sent[0].stamp_ns)
        outlooks.append(controller.outlook)
    first, last = outlooks[0], outlooks[-1]
    assert first is not None
    assert last is not None

    message = typed.decode(plan_message(first, sent[0].stamp_ns), topics.PLAN.type_name)

    assert all(each is first for each in outlooks[:12])
    assert last is not first
    names = [field.name for field in message.fields]
    rows = np.frombuffer(bytes(message.data), [(name, "<f8") for name in names])
    assert (message.width, message.height, message.point_step) == (6, 1, 8 * len(names))
    assert stamp_ns(message) == sent[0].stamp_ns
    np.testing.assert_allclose(rows["time"], 0.05 * np.arange(1, 7))
    motion = make_motion(HUMANOID, resolve_for(HUMANOID, {"reference": "clip", "clip": "walk"}))
    model = DynamicsModel(HUMANOID)
    for row in rows:
        model.update(motion.reference.sample(row["time"]).configuration.position, np.zeros(34))
        centre = np.array([row["x"], row["y"], row["z"]])
        assert float(np.linalg.norm(centre - model.centre_of_mass())) < 0.2
    assert (rows["cost"] > 0.0).all()
    assert rows["cost"].sum() < 1.5 * rows["alternative"].sum()
    assert not rows["anchor_x"].any()
    assert not rows["anchor_yaw"].any()


# What it refuses


REFUSED: dict[str, tuple[str, Mapping[str, object], str]] = {
    "a fixed base": ("pendulum", {}, "floating base"),
    "a limp one": ("humanoid", {"behaviour": "ragdoll"}, "'behaviour' is ragdoll"),
    "a recorded one": (
        "humanoid",
        {"planner": "recorded", "behaviour": "reactive"},
        "'recorded' is for the behaviour tracking; 'behaviour' is reactive",
    ),
    "another law": ("humanoid", {"law": "pd"}, "'law' is pd"),
    "virtual forces": ("humanoid", {"balance.enabled": True}, "'balance.enabled' must be false"),
    "a short horizon": ("humanoid", {"plan.horizon": 0.05, "plan.period": 0.1}, "plan.horizon"),
    "a delay beyond the next plan": (
        "humanoid",
        {"planning_delay_ticks": 13},
        "'planning_delay_ticks' is 13; it must be at most 12",
    ),
    "a delay beyond the plan": (
        "humanoid",
        {"planning_delay_ticks": 5, "plan.horizon": 0.06},
        "'planning_delay_ticks' is 5; it must be at most 0",
    ),
    "no samples": ("humanoid", {"plan.samples": 0}, "'plan.samples' is 0; it must be 8"),
    "no planner": ("humanoid", {"planner": "clairvoyant"}, "planner"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_it_cannot_do_is_one_clear_line(case: str) -> None:
    name, given, reason = REFUSED[case]
    whole = character(name)
    named: dict[str, Any] = {**QUICK, **given}

    with pytest.raises(ConfigurationError, match=r"plan|law") as caught:
        values = resolve_for(whole, named)
        make_controller(whole, make_motion(whole, values).reference, values)

    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("rate", "longest", "ticks"),
    [(240, 0.0, 1), (240, 0.009, 2), (480, 0.009, 4), (100, 0.009, 1), (240, 0.021, 4)],
)
def test_a_step_of_its_model_is_as_many_ticks_as_divide_a_period(
    rate: int, longest: float, ticks: int
) -> None:
    humanoid = character("humanoid")
    given = {"planner": "predictive", "rate": rate, "plan.step": longest}

    settings = make_planner_settings(humanoid, resolve_for(humanoid, given))

    assert settings.step == ticks
    assert settings.period % ticks == 0


def test_it_knows_no_ground_but_the_plane() -> None:
    with pytest.raises(ConfigurationError, match="'terrain' is none; it must be plane"):
        make_plan("humanoid", 0.1, {"reference": "hold"}, {"terrain": "none"}, QUICK)


# Over topics


@pytest.mark.slow
def test_over_topics_it_has_the_states_that_it_has_in_one_process(tmp_path: Path) -> None:
    settings = [f"controller_node.{name}:={value}" for name, value in QUICK.items()]
    command = ["run", "--clip", "walk", "--duration", "0.2", "--planner", "predictive"]
    command += ["--behaviour", "active_ragdoll", "--output", str(tmp_path / "run")]
    for each in settings:
        command += ["--set", each]

    done = subprocess.run(
        [sys.executable, "-m", "actuated_characters.cli", *command],
        capture_output=True,
        text=True,
        check=False,
    )

    assert not done.returncode, done.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text("utf-8"))
    assert summary["state_hash"] == states_of(0.2)  # unhit, a behaviour changes nothing
    recording = read_recording(tmp_path / "run")
    check_plans(recording)
    check_a_run_that_ended_at_once(recording)


def check_plans(recording: Recording) -> None:
    """What its plans said is in the recording, and is measured by what came of it."""
    plans = recording.plans
    assert [plan.stamp_ns for plan in plans] == recording.stamps_ns[::12].tolist()
    model, nothing = DynamicsModel(recording.character), np.zeros(recording.layout.size)
    errors = []
    for plan in plans[:-1]:  # the last one is of the last state
        np.testing.assert_allclose(plan.times, 0.05 * np.arange(1, 7))
        row = recording.stamps_ns.tolist().index(plan.stamp_ns) + 12
        model.update(recording.position[row], nothing)
        errors.append(np.linalg.norm(plan.centres[0] - model.centre_of_mass()))
    assert max(errors) < 0.02

    measured = plan_errors(recording)
    assert min(measured) == 0.05
    np.testing.assert_allclose(measured[0.05], errors, rtol=1e-9)


def check_a_run_that_ended_at_once(recording: Recording) -> None:
    """Its one plan has nothing to be compared with."""
    short = replace(
        recording,
        **{name: getattr(recording, name)[:1] for name in OF_STATES},
        **{name: getattr(recording, name)[:0] for name in OF_TICKS},
        plans=recording.plans[:1],
    )

    assert plan_errors(short) == {}


BROKEN: dict[str, tuple[Callable[[Any], object], str]] = {
    "a field is missing": (lambda message: message.fields.pop(), "a plan without its fields"),
    "a field is a float": (
        lambda message: setattr(message.fields[0], "datatype", 7),
        "a plan without its fields",
    ),
    "its data are short": (
        lambda message: setattr(message, "data", message.data[:-8]),
        "a plan of 424 bytes that should be 432",
    ),
    "its points are short": (
        lambda message: setattr(message, "point_step", 8),
        "a plan of 432 bytes that should be 48",
    ),
    "its times go back": (
        lambda message: setattr(message, "data", np.tile(message.data[:216], 2)),
        "a plan whose times",
    ),
    "its times are no numbers": (
        lambda message: setattr(message, "data", np.full(432, 255, np.uint8)),
        "a plan whose times",
    ),
    "it has no points": (
        lambda message: (
            setattr(message, "width", 0),
            setattr(message, "data", message.data[:0]),
        ),
        "a plan of 0 bytes that should be 0",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_what_is_no_plan_is_not_read_as_one(case: str) -> None:
    controller = a_controller()
    (state,) = states(controller, 1)
    controller.compute_effort(state, state.stamp_ns)
    assert controller.outlook is not None
    raw = plan_message(controller.outlook, state.stamp_ns)
    whole, message = decode_plan(raw), typed.decode(raw, topics.PLAN.type_name)
    alter, text = BROKEN[case]
    alter(message)

    with pytest.raises(MessageError, match=text):
        decode_plan(typed.encode(message))

    assert whole.stamp_ns == state.stamp_ns
    np.testing.assert_array_equal(whole.centres, controller.outlook.centres)
    np.testing.assert_array_equal(whole.costs, controller.outlook.costs)
