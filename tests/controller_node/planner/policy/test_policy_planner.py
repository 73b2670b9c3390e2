"""A policy in a planner's place: its decisions, its memory, its bits, and what it refuses."""

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.bags.recording import read_recording
from actuated_characters.cli import main
from actuated_characters.metrics.recording_metrics import plan_errors
from actuated_characters.replay.replay import replay
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from actuated_characters.runs.planned.velocities import plan_velocities
from actuated_characters.runs.planned.wrenches import plan_push
from controller_node.behaviours.factory import choose_behaviour
from controller_node.controller import Controller
from controller_node.parameters import make_controller, make_controller_settings, resolve_for
from controller_node.planner.base import TickState
from controller_node.planner.compiled.network import evaluate
from controller_node.planner.compiled.observation import (
    find_deviation,
    heading,
    observe,
    write_frame,
)
from controller_node.planner.compiled.rollout import features_against, features_of
from controller_node.planner.contact_model import ContactModel
from controller_node.planner.policy import choosing
from controller_node.planner.policy.file import read_policy
from controller_node.planner.policy.planner import PolicyPlanner
from controller_node.references.factory import make_motion
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError
from msgs_config.memory import MemoryFormat
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from sim_node.physics.engine import INSTALLED_ENGINES
from tests.support.physics import character
from tests.support.policies import UNIT, write_random_policy
from tests.support.runs import summary_of

HUMANOID = character("humanoid")
N = HUMANOID.layout.size
ENTRIES = np.arange(N)
GAINS = make_controller_settings(HUMANOID, resolve_for(HUMANOID, {"planner": "policy"})).gains
CLOCK = TickClock(240)
WALK = {"reference": "clip", "clip": "walk"}
DUPLICATES = pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))]
)


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The file of a policy that decides every 8 ticks."""
    folder = tmp_path_factory.mktemp("policies")
    return str(write_random_policy(folder / "humanoid.npz", HUMANOID))


@pytest.fixture(scope="module")
def make(policy: str) -> Callable[..., Controller]:
    """Makes controllers of a walk that a policy keeps."""

    def made(**given: object) -> Controller:
        named = {"planner": "policy", "policy": policy, **WALK, **given}
        values = resolve_for(HUMANOID, named)
        return make_controller(HUMANOID, make_motion(HUMANOID, values).reference, values)

    return made


def states(count: int, moved: float = 0.0) -> list[StampedState]:
    """Some states near the walk, or moved along x in m, a tick apart."""
    draw, found = np.random.default_rng(4), []
    motion = make_motion(HUMANOID, resolve_for(HUMANOID, WALK))
    for tick in range(count):
        state = motion.reference.sample(tick / 240)
        position = state.configuration.position + 0.01 * draw.normal(size=N)
        position += moved * (ENTRIES == 0)
        found.append(StampedState(CLOCK.stamp_ns(1 + tick), position, state.velocity, None))
    return found


def planner_of(controller: Controller) -> PolicyPlanner:
    assert isinstance(controller.planner, PolicyPlanner)
    return controller.planner


def offsets(
    controller: Controller, sent: list[StampedState], ticks: range | list[int]
) -> list[bytes]:
    """What a controller's planner answers states with."""
    planner = planner_of(controller)
    reference = make_motion(HUMANOID, resolve_for(HUMANOID, WALK)).reference
    at = [TickState(tick, sent[tick]) for tick in ticks]
    return [
        planner.offset(seen, seen, GAINS, lambda each: reference.sample(each / 240)).tobytes()
        for seen in at
    ]


def efforts(controller: Controller, sent: list[StampedState], ticks: range) -> list[bytes]:
    """What a controller answers states with."""
    first = sent[0].stamp_ns
    return [controller.compute_effort(sent[tick], first)[0].tobytes() for tick in ticks]


# Decisions


@pytest.mark.parametrize("hold", [1, 5, 8])
def test_a_decision_holds_for_its_ticks(
    hold: int, make: Callable[..., Controller], tmp_path: Path
) -> None:
    file = write_random_policy(tmp_path / "policy.npz", HUMANOID, hold=hold)

    found = offsets(make(policy=str(file)), states(41), range(41))

    for tick in range(1, 41):
        assert (found[tick] != found[tick - 1]) == (tick % hold == 0)


def test_decisions_are_at_the_same_ticks_wherever_it_begins(
    make: Callable[..., Controller],
) -> None:
    found = offsets(make(), states(17), range(3, 17))

    assert len(set(found[:5])) == 1  # ticks 3 to 7
    assert len(set(found[5:13])) == 1  # ticks 8 to 15
    assert len(set(found)) == 3


def test_nothing_is_added_to_the_root_and_no_more_than_a_policy_may(
    make: Callable[..., Controller],
) -> None:
    found = np.frombuffer(b"".join(offsets(make(), states(80), range(80)))).reshape(80, N)

    assert not found[:, :6].any()
    assert abs(found[:, 6:]).max() <= 2.0 * UNIT
    assert np.median(abs(found[:, 6:])) > 0.01 * UNIT


def test_it_answers_with_the_network_what_is_observed(
    make: Callable[..., Controller], policy: str
) -> None:
    controller, sent = make(), states(9)
    offsets(controller, sent, [0])
    (offset,) = offsets(controller, sent, [8])
    model = ContactModel(HUMANOID, period_s=1 / 240, gravity=9.81, friction=0.38)
    body, engine, read = model.body(GAINS), model.engine(), read_policy(policy, HUMANOID)
    reference = make_motion(HUMANOID, resolve_for(HUMANOID, WALK)).reference
    frames, wanted = [], []
    for ahead in read.ahead:
        desired = reference.sample((8 + ahead) / 240)
        position = model.position_of(desired.configuration.position)
        features, frame = np.zeros(model.feature_count), np.empty(read.scales.frame_mean.shape[1])
        features_of(features, position, desired.velocity, body, engine)
        joints = desired.configuration.position[6:].copy()
        write_frame(frame, position, joints, features, read.scales.centre)
        frames.append(frame)
        wanted.append((position, features))

    target, now = wanted[0]
    facing, features = heading(target, model.left), np.zeros(model.feature_count)
    position = model.position_of(sent[8].position)
    features_against(features, position, sent[8].velocity.copy(), target, body, engine)
    deviation = np.empty(model.feature_count)
    find_deviation(deviation, features, now, facing, read.scales.centre)
    told = np.empty(len(deviation) + np.size(frames), np.float32)
    observe(told, deviation, np.array(frames), facing, read.scales)
    answer, expected = np.empty(N - 6, np.float32), np.empty(1, np.float32)
    evaluate(read.network, told, answer)
    evaluate(read.value, told, expected)

    found = np.frombuffer(offset)[6:]
    np.testing.assert_allclose(found, UNIT * np.clip(answer.astype(float), -2.0, 2.0), rtol=1e-12)
    outlook = controller.outlook
    assert outlook is not None
    np.testing.assert_allclose(outlook.costs, np.clip(1.0 - expected, 0.0, 1.0), rtol=1e-6)
    centre = features[read.scales.centre : read.scales.centre + 3]
    np.testing.assert_allclose(outlook.centres, [centre], rtol=1e-12)


# Memory


def test_a_state_that_comes_again_is_answered_alike_and_moves_nothing(
    make: Callable[..., Controller],
) -> None:
    sent, once, thrice = states(40, moved=0.4), make(), make()
    found, again = [], []
    for tick in range(40):
        found += offsets(once, sent, [tick])
        answers = offsets(thrice, sent, [tick] * 3)
        assert len(set(answers)) == 1
        again.append(answers[0])
        assert once.outlook is not None and thrice.outlook is not None
        assert once.outlook.anchor == thrice.outlook.anchor

    assert again == found


def test_a_state_of_before_is_answered_as_if_none_had_followed(
    make: Callable[..., Controller],
) -> None:
    controller, sent = make(), states(40, moved=0.4)
    offsets(controller, sent, range(0, 40, 3))

    assert offsets(controller, sent, range(10, 40)) == offsets(make(), sent, range(10, 40))


def test_an_episode_forgets_all(make: Callable[..., Controller]) -> None:
    controller, sent = make(), states(30, moved=0.4)
    first = offsets(controller, sent, range(30))
    assert controller.outlook is not None and controller.outlook.anchor.place != 0

    planner_of(controller).begin_episode(0)

    assert controller.outlook is None
    assert offsets(controller, sent, range(30)) == first


def test_another_reference_is_told_from_its_tick_on_and_the_decision_stays(
    make: Callable[..., Controller],
) -> None:
    planner = planner_of(make())
    at = {tick: TickState(tick, state) for tick, state in enumerate(states(30))}
    walk = make_motion(HUMANOID, resolve_for(HUMANOID, WALK)).reference
    held = replace(walk.sample(0.0), velocity=np.zeros(N))

    before = planner.offset(at[5], at[5], GAINS, lambda tick: walk.sample(tick / 240))
    planner.change_reference(6)
    stays = planner.offset(at[6], at[6], GAINS, lambda tick: held)
    after = planner.offset(at[8], at[8], GAINS, lambda tick: held)

    fresh = planner_of(make())
    fresh.offset(at[5], at[5], GAINS, lambda tick: walk.sample(tick / 240))
    unchanged = fresh.offset(at[8], at[8], GAINS, lambda tick: walk.sample(tick / 240))
    assert stays.tobytes() == before.tobytes()
    assert after.tobytes() != unchanged.tobytes()


@DUPLICATES
@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("taken", [0, 11, 16])
def test_a_copy_goes_on_to_the_same_bits(
    duplicate: Callable[[Controller], Controller],
    delay: int,
    taken: int,
    make: Callable[..., Controller],
) -> None:
    original, sent = make(command_delay_ticks=delay), states(40, moved=0.4)
    efforts(original, sent, range(taken))

    copied = duplicate(original)

    expected = efforts(original, sent, range(taken, 40))
    assert efforts(copied, sent, range(taken, 40)) == expected
    whole = make(command_delay_ticks=delay)
    assert efforts(whole, sent, range(40))[taken:] == expected
    assert copied.outlook is not None and original.outlook is not None
    assert copied.outlook.anchor == original.outlook.anchor


def test_its_memory_goes_without_its_weights(make: Callable[..., Controller]) -> None:
    original, other, sent = make(), make(), states(40, moved=0.4)
    efforts(original, sent, range(20))

    memory = MemoryFormat(*original.parts).write(original)
    found: Controller = MemoryFormat(*other.parts).read(memory)

    assert len(memory) < 4000  # the weights alone are 40 kB
    assert efforts(found, sent, range(20, 40)) == efforts(original, sent, range(20, 40))


@DUPLICATES
def test_a_behaviours_clip_is_decided_by_its_own_policy(
    duplicate: Callable[[Controller], Controller],
) -> None:
    values = resolve_for(HUMANOID, {"planner": "policy", "behaviour": "active_ragdoll", **WALK})
    walk = make_controller(HUMANOID, make_motion(HUMANOID, values).reference, values)
    planner_of(walk).change_reference(0, "getup_faceup")
    rise = {"planner": "policy", "reference": "clip", "clip": "getup_faceup"}
    alone = resolve_for(HUMANOID, rise)
    own = make_controller(HUMANOID, make_motion(HUMANOID, alone).reference, alone)
    sent = states(9)

    expected = offsets(own, sent, range(9))

    assert offsets(duplicate(walk), sent, range(9)) == expected
    planner_of(walk).change_reference()
    assert offsets(walk, sent, range(9)) != expected
    planner_of(walk).change_reference(0, "getup_faceup")
    planner_of(walk).begin_episode(0)
    assert offsets(walk, sent, range(9)) != expected


# The reference gives way


@pytest.mark.parametrize("gives_way", [True, False])
def test_a_reference_gives_way_to_a_push_unless_it_is_to_stay(
    gives_way: bool, make: Callable[..., Controller]
) -> None:
    controller = make(**{"plan.gives_way": gives_way})

    efforts(controller, states(33, moved=0.4), range(33))

    assert controller.outlook is not None
    assert (abs(controller.outlook.anchor.place) > 0.05) == gives_way


# Runs


def walked(policy: str, duration: float, simulator: dict[str, object], **given: object) -> bytes:
    """The states of a walk in this process."""
    plan = make_plan(
        "humanoid", duration, WALK, simulator, {"planner": "policy", "policy": policy, **given}
    )
    found: list[FloatArray] = []
    for tick in ticks_in_process(plan):
        assert tick.following.effort is not None
        found.append(tick.following.position)
        if given.get("behaviour") is None:
            assert not tick.following.effort[:6].any()
    assert len(found) == round(240 * duration)
    return np.array(found).tobytes()


def test_commands_may_be_late(policy: str) -> None:
    at_once, late = walked(policy, 0.1, {}), walked(policy, 0.1, {"command_delay_ticks": 2})

    assert late != at_once
    assert walked(policy, 0.1, {"command_delay_ticks": 2}) == late


@pytest.mark.slow
@pytest.mark.parametrize("engine", INSTALLED_ENGINES)
def test_it_bears_late_commands(engine: str) -> None:
    late = {"command_delay_ticks": 2}
    plan = make_plan("humanoid", 5.0, WALK, {"engine": engine, **late}, {"planner": "policy"})

    (*_, last) = ticks_in_process(plan, [plan_push(plan, "root", (25.0, 0.0, 0.0), 1.0)])

    assert last.following.position[2] > 0.7


def test_it_decides_from_the_state_that_is_seen(make: Callable[..., Controller]) -> None:
    planner = planner_of(make(command_delay_ticks=2))
    walk = make_motion(HUMANOID, resolve_for(HUMANOID, WALK)).reference
    sent = states(3)

    found = planner.offset(
        TickState(2, sent[2]), TickState(0, sent[0]), GAINS, lambda tick: walk.sample(tick / 240)
    )

    assert [found.tobytes()] == offsets(make(), sent, [0])


def test_its_contacts_keep_their_points(policy: str) -> None:
    plan = make_plan("humanoid", 0.1, WALK, {}, {"planner": "policy", "policy": policy})

    assert plan.simulator["contact_breaking_threshold"] == 0.1


@pytest.mark.slow
@pytest.mark.parametrize("engine", INSTALLED_ENGINES)
def test_a_run_has_the_same_bits_again_and_in_a_replay(
    policy: str, engine: str, tmp_path: Path
) -> None:
    hashes = []
    for name in ("one", "other"):
        command = ["run", "--in-process", "--clip", "walk", "--duration", "0.6"]
        command += ["--planner", "policy", "--push", "chest:0,300,0@0.1"]
        command += ["--set", f"controller_node.policy:={policy}"]
        command += ["--set", f"sim_node.engine:={engine}", "--output", str(tmp_path / name)]
        assert main(command) == 0
        hashes.append(summary_of(tmp_path / name)["state_hash"])

    assert hashes[0] == hashes[1]
    recording = read_recording(tmp_path / "one")
    assert replay([recording]).identical
    assert [plan.stamp_ns for plan in recording.plans] == recording.stamps_ns[::8].tolist()
    assert not plan_errors(recording)  # it says where the character is, and foresees nothing
    assert main(["report", str(tmp_path / "one")]) == 0


@pytest.mark.slow
def test_a_controller_takes_the_policy_of_what_its_behaviour_tracks() -> None:
    behaviour = {"planner": "policy", "behaviour": "active_ragdoll"}
    plan = make_plan("humanoid", 5.0, WALK, {}, behaviour)
    controller = make_controller(HUMANOID, plan.reference, plan.controller)
    pushes = [plan_push(plan, "chest", (1700.0, 0.0, 0.0), 0.2)]
    led = set()
    for _ in ticks_in_process(plan, pushes, controller=controller):
        mode = controller.mode
        assert mode is not None
        (clip,) = planner_of(controller).policy.about["clips"]
        led.add((mode.phase.mode.value, mode.phase.facts.get("clip"), clip))

    rise = next(clip for mode, clip, _ in led if mode == "BLEND" and clip)
    assert ("TRACK", None, "walk") in led
    assert {clip for mode, tracked, clip in led if tracked == rise and mode == "BLEND"} == {rise}


@pytest.mark.slow
@pytest.mark.parametrize(
    "through",
    [[], pytest.param(["--through-topics", "controller"], marks=pytest.mark.nightly)],
)
def test_who_falls_gets_up_by_the_policy_of_that_clip(through: list[str], tmp_path: Path) -> None:
    run = tmp_path / "run"
    command = ["run", "--in-process", "--clip", "walk", "--duration", "5", "--planner", "policy"]
    command += ["--behaviour", "active_ragdoll", "--push", "chest:1700,0,0@0.2"]

    assert main([*command, "--output", str(run)]) == 0

    recording = read_recording(run)
    modes = [change.mode for change in recording.modes]
    assert modes[:4] == ["TRACK", "LIMP", "SEARCH", "BLEND"]
    assert recording.modes[3].facts["clip"] in ("getup_faceup", "getup_facedown")
    assert not recording.effort[:, :6].any()
    assert main(["replay", str(run), *through]) == 0


@pytest.mark.slow
@pytest.mark.parametrize("engine", INSTALLED_ENGINES)
def test_the_shipped_steered_one_goes_where_it_is_told_to(engine: str) -> None:
    """From standing, in a bend: 4 s, on an engine."""
    plan = make_plan(
        "humanoid",
        4.0,
        {"reference": "steered"},
        {"engine": engine},
        {"planner": "policy", "steering.timeout": 10.0},
    )
    steered, _ = plan_velocities(plan, "0.8,0,0.4@0.5")

    *_, last = ticks_in_process(steered)

    assert last.reference is not None
    off = last.state.position[:2] - last.reference.position[:2]
    assert float(np.linalg.norm(last.reference.position[:2])) > 1.5
    assert float(np.linalg.norm(off)) < 0.2
    assert last.state.position[2] > 0.75


# What it refuses


REFUSED: dict[str, tuple[str, dict[str, object], str]] = {
    "a fixed base": ("pendulum", {}, "planner 'policy' is for a floating base with joints"),
    "a limp one": (
        "humanoid",
        {"behaviour": "ragdoll"},
        "'policy' is for a behaviour that follows a motion",
    ),
    "clips without policies": (
        "humanoid",
        {"behaviour": "reactive", "library": ["roll"]},
        "there is no policy of roll",
    ),
    "a pursuit": (
        "humanoid",
        {"behaviour": "pursuit", "opponent": "b"},
        "whose way no planner can foresee",
    ),
    "a machine": (
        "humanoid",
        {"behaviour": "state_machine", "reference": "steered"},
        "'policy' is for a behaviour that follows clips",
    ),
    "another law": ("humanoid", {"law": "pd"}, "'law' is pd"),
    "virtual forces": ("humanoid", {"balance.enabled": True}, "'balance.enabled' must be false"),
    "no policy": (
        "humanoid",
        {"policy": "", "clip": "roll"},
        "parameter 'policy' is ''; it must be the path of",
    ),
    "another clip": ("humanoid", {"clip": "run"}, "was trained on walk; the clip is run"),
    "no clip": ("humanoid", {"reference": "hold"}, "was trained on walk; 'reference' is hold"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_it_cannot_do_is_one_clear_line(
    case: str, policy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(choosing, "shipped_policies", lambda: ("walk",))  # whatever is shipped
    name, given, reason = REFUSED[case]
    whole = character(name)
    clip = {"reference": "clip", "clip": "walk"} if name == "humanoid" else {}
    named: dict[str, Any] = {"planner": "policy", "policy": policy, **clip, **given}

    with pytest.raises(ConfigurationError) as caught:
        values = resolve_for(whole, named)
        choose_behaviour(whole, values)
        make_controller(whole, make_motion(whole, values).reference, values)

    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_it_knows_no_ground_but_the_plane(policy: str) -> None:
    given = {"planner": "policy", "policy": policy}
    with pytest.raises(ConfigurationError, match=r"'policy' knows .* 'terrain' is none"):
        make_plan("humanoid", 0.1, WALK, {"terrain": "none"}, given)
