"""Fitting a window feedback: its runs, and the fit."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller_node.window_gains import WindowGains
from experiment.cli import main
from experiment.samcon import window_fitting
from experiment.samcon.gains_file import read_gains
from experiment.samcon.problem import Problem
from experiment.samcon.rollout import Rollout
from experiment.samcon.settings import preset
from experiment.samcon.trials import headings
from experiment.samcon.window_fitting import WindowFit, WindowFitState, fitted_windows
from experiment.samcon.window_trials import WindowRun, WindowTrials
from msgs_config.errors import ConfigurationError, RunError

pytestmark = pytest.mark.slow

SETTINGS = preset("humanoid", "walk", 240, window=0.0667, feedback={}, window_feedback="")
PROBLEM = Problem.of("humanoid", "walk", 0.4, SETTINGS, {"rate": 240})  # two cycles of 0.2 s


# The runs


def test_the_transitions_of_a_run_are_what_the_engine_does() -> None:
    trials = WindowTrials(PROBLEM, SETTINGS, 2)
    gains = replace(trials.nothing(), constants=np.full((3, len(trials.dofs)), 0.02))

    (found,) = trials.tried([(gains, WindowRun(0.0, (1,), noise=0.1))])

    assert found.windows == 6
    rows = found.transitions
    np.testing.assert_array_equal(rows.phases, (1, 2, 0, 1, 2))
    np.testing.assert_array_equal(rows.before[1:], rows.after[:-1])
    noise = rows.offsets - 0.02
    assert 0.05 < np.abs(noise / trials.largest).mean() < 0.12  # 0.08 of a normal distribution

    engine = Rollout(PROBLEM)
    engine.act({}, gains)
    size = engine.layout.size
    offsets = np.zeros((6, size))
    rng = np.random.default_rng(np.random.SeedSequence((1,)))
    largest = SETTINGS.largest_offsets(engine.layout)
    offsets += 0.1 * largest * rng.normal(size=offsets.shape)
    offsets[0] += 0.03 * largest * rng.uniform(-1.0, 1.0, size)
    ends = engine.follow(offsets)
    engine.close()
    deviations = engine.deviations(gains.dofs)
    last = deviations.of(engine.windows.ends[-1], ends[-1, :size], ends[-1, size : 2 * size])
    np.testing.assert_array_equal(rows.after[-1], last)
    np.testing.assert_allclose(noise[-1], offsets[-1, deviations.entries], atol=1e-12)


_PUSHED_LATE = 0  # seed of a run that is pushed from 0.696 s on


def test_trials_begin_from_the_inverse_dynamics_as_the_search_does() -> None:
    problem = replace(PROBLEM, feedforward=0.7)
    trials = WindowTrials(problem, SETTINGS, 2)

    (found,) = trials.tried([(trials.nothing(), WindowRun(0.0, (1,)))])

    engine = Rollout(problem)
    size, deviations = engine.layout.size, engine.deviations(trials.dofs)
    offsets = np.array([engine.plain(window) for window in range(6)])
    rng = np.random.default_rng(np.random.SeedSequence((1,)))
    rng.normal(size=offsets.shape)
    largest = SETTINGS.largest_offsets(engine.layout)
    offsets[0] += 0.03 * largest * rng.uniform(-1.0, 1.0, size)
    ends = engine.follow(offsets)
    engine.close()
    last = deviations.of(engine.windows.ends[-1], ends[-1, :size], ends[-1, size : 2 * size])
    np.testing.assert_array_equal(found.transitions.after[-1], last)
    assert not found.transitions.offsets.any()  # no offsets beside them


def test_windows_with_a_push_are_no_transitions() -> None:
    problem = replace(PROBLEM, duration=1.2)
    trials = WindowTrials(problem, SETTINGS, 6)

    plain, pushed = (
        trials.tried([(trials.nothing(), WindowRun(0.0, (_PUSHED_LATE,), push=push))])[0]
        for push in (0.0, 1e-9)
    )

    assert plain.windows == pushed.windows == 11  # the last one ends at 0.733 s
    np.testing.assert_array_equal(plain.transitions.phases, np.arange(1, 11) % 3)
    np.testing.assert_array_equal(pushed.transitions.phases, np.arange(1, 10) % 3)


def test_headings_are_within_a_quarter_turn() -> None:
    assert headings(1) == [0.0]
    assert headings(2) == [0.0, pytest.approx(np.pi / 4)]


def test_cycles_of_unequal_windows_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="5 cycles are 6 windows"):
        WindowTrials(PROBLEM, SETTINGS, 5)


def test_a_feedback_of_other_joints_is_refused() -> None:
    trials = WindowTrials(PROBLEM, SETTINGS, 2)
    trials.check(trials.nothing())
    with pytest.raises(ConfigurationError, match="here it is"):
        trials.check(replace(trials.nothing(), dofs=("neck_x",)))


# The fit


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(window_fitting, "_FIRST_RUNS", 3)
    monkeypatch.setattr(window_fitting, "_PUSHED", 1)
    monkeypatch.setattr(window_fitting, "_NOISES", (0.02,))
    monkeypatch.setattr(window_fitting, "_FINAL_RUNS", 1)


@pytest.mark.usefixtures("short")
def test_a_fit_is_the_same_on_two_processes() -> None:
    fit, states = WindowFit(rounds=2, headings=1), list[WindowFitState]()

    found, held = fitted_windows(PROBLEM, SETTINGS, 2, fit, 1, states.append)
    other, same = fitted_windows(PROBLEM, SETTINGS, 2, fit, 2)

    assert found.content() == other.content()
    assert held == same
    assert 0.0 < held <= 1.0
    assert found.windows == 3
    assert [state.round for state in states] == [1, 2]
    assert states[1].best == max(state.held for state in states)
    assert np.abs(found.gains).max() > 0.0


@pytest.mark.usefixtures("short")
def test_the_command_writes_a_file_that_reconstruct_takes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gains, walk = tmp_path / "walk.gains.json", tmp_path / "walk.json"
    given = ["--cycles", "2", "--rounds", "1", "--headings", "1", "--workers", "1"]

    assert main(["fit-feedback", *given, "--output", str(gains)]) == 0
    told = capsys.readouterr()
    assert "that chose it" in told.out.replace("\n", " ")
    assert "of 26 windows" in told.err
    assert main(["fit-feedback", *given, "--output", str(gains)]) == 1
    assert "--overwrite replaces it" in capsys.readouterr().err

    options = ["--samples", "10", "--kept", "4", "--workers", "1", "--window-feedback", str(gains)]
    assert main(["reconstruct", *options, "--output", str(walk)]) == 0  # its states are verified
    assert '"WindowFeedback": {"dofs": ["chest_x"' in walk.read_text(encoding="utf-8")
    assert read_gains(str(gains)).windows == 13


@pytest.mark.usefixtures("short")
def test_a_fit_that_is_stopped_leaves_the_best_of_its_rounds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[WindowGains] = []
    make = window_fitting.regulator

    def three(*given: Any) -> WindowGains:
        """The first two alike, the third one throws it over."""
        last = replace(made[0], constants=made[0].constants + 1.0) if len(made) == 2 else None
        made.append(last or (made[0] if made else make(*given)))
        return made[-1]

    def stop(*_: object) -> None:
        raise RunError("stopped")

    output = tmp_path / "walk.gains.json"
    monkeypatch.setattr(window_fitting, "regulator", three)
    monkeypatch.setattr(window_fitting, "_best_of", stop)
    given = ["--cycles", "2", "--rounds", "3", "--headings", "1", "--workers", "1"]

    assert main(["fit-feedback", *given, "--output", str(output)]) == 1

    assert len(made) == 3
    assert read_gains(str(output)).content() == made[0].content()


@pytest.mark.usefixtures("short")
def test_a_fit_never_ends_with_worse_gains_than_it_began_with(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first = WindowTrials(PROBLEM, SETTINGS, 2).nothing()
    worse = replace(first, constants=first.constants + 1.0)
    monkeypatch.setattr(window_fitting, "regulator", lambda *_: worse)
    states = list[WindowFitState]()
    fit = WindowFit(rounds=3, headings=1)

    found, held = fitted_windows(PROBLEM, SETTINGS, 2, fit, 1, states.append, first)

    assert found.content() == first.content()
    assert states[-1].gains is first
    assert held == 1.0


@pytest.mark.usefixtures("short")
def test_the_mean_of_the_last_rounds_may_be_the_best(monkeypatch: pytest.MonkeyPatch) -> None:
    longer = replace(PROBLEM, duration=0.6)
    good = WindowTrials(longer, SETTINGS, 3).nothing()
    rounds = iter((1.0, 1.0, -1.0))  # each throws it over, the mean of the last two does nothing
    monkeypatch.setattr(
        window_fitting,
        "regulator",
        lambda *_: replace(good, constants=good.constants + next(rounds)),
    )

    found, held = fitted_windows(longer, SETTINGS, 3, WindowFit(rounds=3, headings=1), 1)

    assert not found.constants.any()
    assert held == 1.0


def test_the_mean_of_feedbacks_is_that_of_their_numbers() -> None:
    one = WindowTrials(PROBLEM, SETTINGS, 2).nothing()
    other = replace(one, constants=one.constants + 0.25, gains=one.gains - 3.0)

    mean = window_fitting._mean([one, other, other, other])

    np.testing.assert_allclose(mean.constants, 0.1875)
    np.testing.assert_allclose(mean.gains, -2.25)
    assert mean.dofs == one.dofs
