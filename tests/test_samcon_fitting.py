"""The fit of the balance feedback to a motion, and the angular momentum that its cost looks at."""

import json
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from physics import character

from controller_node.feedback_gains import FeedbackGains
from experiment.cli import main
from experiment.loop import ticks_in_process
from experiment.planned_push import planned_push
from experiment.samcon import fitting, trials
from experiment.samcon.features import Features
from experiment.samcon.fitting import State, fitted
from experiment.samcon.gain_space import Gains, GainSpace, names
from experiment.samcon.problem import Problem
from experiment.samcon.reconstruction import Job, duration_of, reconstruct
from experiment.samcon.rollout import Rollout
from experiment.samcon.search import Progress
from experiment.samcon.settings import preset
from experiment.samcon.trials import Fit, Level, Trials
from msgs_config import rotations
from msgs_config.arrays import FloatArray
from msgs_config.dynamics import DynamicsModel

pytestmark = pytest.mark.slow

HUMANOID = character("humanoid")
SIZE = HUMANOID.layout.size
SETTINGS = preset("humanoid", "jump")
PROBLEM = Problem.of("humanoid", "jump", 0.2, SETTINGS)
LEVEL = Level(0.0, 4, 0.0)


def mean_cost(gains: Gains) -> float:
    """What a feedback costs in the runs with which a fit tests it."""
    cost, _ = Trials(PROBLEM, SETTINGS, Fit(16)).test(LEVEL, gains)
    return cost


def position() -> FloatArray:
    """A bent and turned position (n,)."""
    found = np.array(HUMANOID.rest_position) + 0.3 * np.sin(np.arange(SIZE))
    found[HUMANOID.layout.joint("right_knee").start] = -0.5
    found[HUMANOID.layout.joint("left_knee").start] = -0.2
    return found


def momentum(velocity: FloatArray) -> FloatArray:
    """The angular momentum (3,) among the features."""
    return Features(HUMANOID).row(position(), velocity)[2 * SIZE + 6 : 2 * SIZE + 9]


def test_who_moves_on_without_turning_has_no_angular_momentum() -> None:
    velocity = np.zeros(SIZE)
    velocity[:3] = (1.0, -2.0, 3.0)

    np.testing.assert_allclose(momentum(velocity), 0.0, atol=1e-9)


def test_who_turns_as_one_body_has_that_of_twice_its_energy() -> None:
    spin = np.array((0.5, -1.0, 2.0))  # rad/s, world
    model = DynamicsModel(HUMANOID)
    model.update(position(), np.zeros(SIZE))
    velocity = np.zeros(SIZE)
    velocity[:3] = np.cross(spin, position()[:3] - model.centre_of_mass())
    back = rotations.conjugate(rotations.exp(position()[3:6]))
    velocity[3:6] = rotations.rotate(back, spin)

    model.update(position(), velocity)

    assert momentum(velocity) @ spin == pytest.approx(2.0 * model.kinetic_energy())


def test_what_is_fitted_are_gains() -> None:
    assert FeedbackGains.of(dict.fromkeys(names(), 1.0)).stance.any()


def test_gains_are_their_vector_again() -> None:
    space = GainSpace({"stance.knee.side": 0.3})
    vector = np.round(np.sin(np.arange(len(space.vector({})))), 2)

    gains = space.gains(vector)

    np.testing.assert_allclose(space.vector(gains), vector, rtol=0.01)
    assert gains[names()[3]] != 0.0
    assert "stance.knee.side" in gains


def test_it_gets_harder_step_by_step_to_a_last_level() -> None:
    fit, level = Fit(16, assistance=0.0117, push=5.0), Level(0.0117, 10, 0.0)

    steps = []
    while (harder := level.harder(fit, 20)) != level:
        level = harder
        steps.append((round(level.assistance, 4), level.windows, level.push))

    assert steps == [(0.0, 10, 0.0), (0.0, 14, 0.0), (0.0, 19, 0.0), (0.0, 20, 0.0), (0.0, 20, 5.0)]


def test_the_fit_is_the_same_on_two_processes_and_costs_what_it_says() -> None:
    told: list[State] = []
    without, fit = replace(PROBLEM, feedback={}), Fit(16)

    alone = fitted(without, SETTINGS, fit, 1, told.append)
    together = fitted(without, SETTINGS, fit, 2)

    assert alone == together
    assert [state.done for state in told] == [16]
    assert told[0].cost == mean_cost(alone) < mean_cost({})


FEW = 8


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Feedbacks of a population."""
    monkeypatch.setattr(fitting, "POPULATION", FEW)


@pytest.mark.usefixtures("few")
def test_a_fit_never_ends_with_a_worse_feedback_than_it_began_with() -> None:
    best = fitted(PROBLEM, SETTINGS, Fit(FEW), 1)
    for _ in range(2):  # a fit of what was fitted tries others around it
        better = fitted(replace(PROBLEM, feedback=best), SETTINGS, Fit(FEW), 1)

        assert mean_cost(better) <= mean_cost(best)
        best = better


@pytest.mark.usefixtures("few")
def test_a_fit_of_longer_and_longer_runs_is_no_worse_at_the_last(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(trials, "_FIRST_RUN", 0.1)  # s, two windows
    monkeypatch.setattr(fitting, "_TEST_EVERY", 2)  # populations
    told: list[State] = []

    best = fitted(PROBLEM, SETTINGS, Fit(5 * FEW), 1, told.append)

    assert [state.level.windows for state in told][::2] == [2, 3, 4]
    assert told[-1].cost == mean_cost(best) <= mean_cost(PROBLEM.feedback)


def test_runs_of_one_window_get_longer_as_well() -> None:
    long = replace(PROBLEM, window=8.0)

    first = Trials(long, SETTINGS, Fit(16)).first_level()

    assert first.windows == 1
    assert first.harder(Fit(16), 3).windows == 2


def test_planned_pushes_are_not_those_of_the_trials() -> None:
    pushed = replace(PROBLEM, pushes=("root:500,0,0@0.05",))

    cost, _ = Trials(pushed, SETTINGS, Fit(16)).test(LEVEL, PROBLEM.feedback)

    assert cost == mean_cost(PROBLEM.feedback)


def test_a_motion_is_the_same_a_quarter_further_and_not_an_eighth() -> None:
    def cost(turn: float) -> float:
        turned = replace(PROBLEM, simulator={"placement": [0.0, 0.0, 0.0, turn * np.pi]})
        return Trials(turned, SETTINGS, Fit(16)).test(LEVEL, PROBLEM.feedback)[0]

    assert cost(0.5) == pytest.approx(cost(0.0), rel=1e-6)
    assert cost(0.25) != pytest.approx(cost(0.0), rel=1e-6)


def test_each_feedback_is_tried_at_all_headings() -> None:
    def cost(headings: int, turn: float) -> float:
        turned = replace(PROBLEM, simulator={"placement": [0.0, 0.0, 0.0, turn * np.pi]})
        fit = Fit(16, headings=headings, nudge=0.0)
        (found,) = Trials(turned, SETTINGS, fit).costs(LEVEL, [PROBLEM.feedback], 1)
        return found

    assert cost(2, 0.0) == np.mean([cost(1, 0.0), cost(1, 0.25)])


def test_a_push_in_a_trial_is_that_of_a_run() -> None:
    problem = replace(PROBLEM, feedback={}, feedforward=0.0)
    push = planned_push(problem.plan(), "chest", (200.0, 0.0, 0.0), 0.05)
    with closing(Rollout(problem)) as rollout:
        ends = rollout.follow(np.zeros((len(rollout.windows), SIZE)), [push])

    *_, last = ticks_in_process(problem.plan(), [push])
    *_, unpushed = ticks_in_process(problem.plan())

    assert ends[-1, :SIZE].tobytes() == last.following.position.tobytes()
    assert last.following.position.tobytes() != unpushed.following.position.tobytes()


def test_what_was_fitted_is_resumed_with(tmp_path: Path) -> None:
    output, stopped = tmp_path / "walk.json", KeyboardInterrupt()
    settings = preset("humanoid", "walk", 240, samples=8)
    simulator = {"rate": 240, "command_delay_ticks": 0}
    duration = duration_of("humanoid", "walk", 1)
    problem = Problem.of("humanoid", "walk", duration, settings, simulator)
    found = {**settings.feedback, "stance.knee.one": 0.0876}
    job = Job(problem, 1, settings, output).with_feedback(found)

    def report(progress: Progress, *_: float) -> None:
        if progress.window == 2:
            raise stopped

    with pytest.raises(KeyboardInterrupt):
        reconstruct(job, report)

    options = ["--samples", "8", "--workers", "1", "--output", str(output)]
    assert main(["reconstruct", *options, "--resume"]) == 0
    assert json.loads(output.read_text())["Feedback"] == found


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--fit", "-1"), "--fit is -1"),
        (("--fit", "16", "--open-loop"), "which --open-loop leaves out"),
        (("--fit", "16", "--resume"), "--resume goes on with what was fitted before"),
        (("--fit", "16", "--cluster", "localhost:1"), "not on a --cluster"),
        (("--fit-push", "5"), "--fit-push is for --fit"),
        (("--fit", "16", "--fit-assistance", "-1"), "--fit-assistance is -1"),
        (("--fit", "16", "--fit-push", "nan"), "--fit-push is nan"),
        (("--fit", "16", "--fit-headings", "9"), "--fit-headings is 9; it must be 1 to 8"),
        (("--fit-headings", "2"), "--fit-headings is for --fit"),
        (("--seed", "-1"), "seed is -1; it must be 0 to 4294967294"),
        (("--seed", "4294967295"), "seed is 4294967295"),
    ],
)
def test_a_wrong_fit_is_one_line(
    tmp_path_factory: pytest.TempPathFactory,
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
    reason: str,
) -> None:
    output = tmp_path_factory.mktemp("fit") / "jump.json"

    assert main(["reconstruct", "--output", str(output), *options]) != 0
    assert reason in capsys.readouterr().err
