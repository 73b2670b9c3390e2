"""Fitting a window feedback: the model, the regulator, the runs, the command."""

import subprocess
import sys
from dataclasses import replace
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiment.cli import main
from experiment.samcon import reconstruction, window_fitting
from experiment.samcon.gains_file import read_gains, write_gains
from experiment.samcon.identification import CycleModel, Transitions, WindowModel, identified
from experiment.samcon.problem import Problem
from experiment.samcon.regulator import regulator
from experiment.samcon.rollout import Rollout
from experiment.samcon.search import Progress
from experiment.samcon.settings import preset
from experiment.samcon.window_fitting import WindowFit, WindowFitState, fitted_windows
from experiment.samcon.window_trials import WindowRun, WindowTrials, headings
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError, RunError

PROJECT = Path(__file__).parents[1]
SETTINGS = preset("humanoid", "walk", 240, window=0.0667, feedback={}, window_feedback="")
PROBLEM = Problem.of("humanoid", "walk", 0.4, SETTINGS, {"rate": 240})  # two cycles of 0.2 s
RNG = np.random.default_rng(4)


# The model

WIDTH, MOVED, CYCLE = 4, 2, 3
LARGEST = np.array((0.5, 2.0))
TRUE = RNG.normal(size=(CYCLE, WIDTH, WIDTH + MOVED + 1))


def transitions(count: int, noise: float = 0.0) -> Transitions:
    rng = np.random.default_rng(5)
    phases = np.arange(count) % CYCLE
    before, offsets = rng.normal(size=(count, WIDTH)), LARGEST * rng.normal(size=(count, MOVED))
    rows = np.hstack((before, offsets, np.ones((count, 1))))
    after = np.array([TRUE[phase] @ row for phase, row in zip(phases, rows, strict=True)])
    return Transitions(phases, before, offsets, after + noise * rng.normal(size=after.shape))


def predicted(model: CycleModel, phase: int, state: FloatArray, offset: FloatArray) -> FloatArray:
    row = np.concatenate((state / model.spreads, offset / model.largest, [1.0]))
    found: FloatArray = (model.windows[phase].matrix @ row) * model.spreads
    return found


def test_a_linear_motion_is_identified_window_by_window() -> None:
    model = identified(transitions(30_000), LARGEST, CYCLE)
    state, offset = RNG.normal(size=WIDTH), RNG.normal(size=MOVED)

    for phase in range(CYCLE):
        wanted = TRUE[phase] @ np.concatenate((state, offset, [1.0]))
        np.testing.assert_allclose(predicted(model, phase, state, offset), wanted, atol=5e-3)


def test_what_is_not_explained_is_the_residual() -> None:
    model = identified(transitions(30_000, noise=0.3), LARGEST, CYCLE)

    for window in model.windows:
        unit = np.diag(model.spreads) @ window.residual @ np.diag(model.spreads)
        np.testing.assert_allclose(unit, 0.09 * np.eye(WIDTH), atol=0.01)


# The regulator


def one_window(*rows: list[float], largest: float = 1.0) -> CycleModel:
    """A cycle of one number, one offset, and no doubt: a row (a, b, c) a window."""
    windows = tuple(
        WindowModel(np.array([row]), np.zeros((3, 3)), np.zeros((1, 1))) for row in rows
    )
    return CycleModel(windows, np.ones(1), np.array([largest]))


def test_a_cycle_of_one_window_gets_the_gain_of_the_riccati_equation() -> None:
    a, b, q, r = 1.3, 0.7, 1.0, 2.0
    model = one_window([a, b, 0.0])

    gains = regulator(model, ("hinge",), caution=0.0, offset_cost=r)

    # p = q + a^2 p r / (r + b^2 p), a quadratic in p
    half = 0.5 * (b * b * q + (a * a - 1.0) * r) / (b * b)
    p = half + sqrt(half * half + q * r / (b * b))
    assert gains.gains[0, 0, 0] == pytest.approx(-a * b * p / (r + b * b * p), rel=1e-4)
    assert gains.constants[0, 0] == 0.0


def cost(gains: FloatArray, constants: FloatArray, rows: list[list[float]]) -> float:
    """What a feedback of a cycle costs from 1 on, in many cycles."""
    state, total = 1.0, 0.0
    for step in range(200 * len(rows)):
        a, b, c = rows[step % len(rows)]
        offset = gains[step % len(rows)] * state + constants[step % len(rows)]
        state = a * state + b * offset + c
        total += state * state + 2.0 * float(offset) ** 2
    return float(total)


def test_no_other_feedback_of_a_cycle_costs_less() -> None:
    rows = [[1.3, 0.7, 0.1], [0.4, -2.0, -0.2], [1.8, 0.3, 0.0]]
    found = regulator(one_window(*rows), ("hinge",), caution=0.0, offset_cost=2.0)
    gains, constants = found.gains[:, 0, 0], found.constants[:, 0]

    least = cost(gains, constants, rows)

    for row in range(len(rows)):
        for change in (-0.02, 0.02):
            other = np.where(np.arange(len(rows)) == row, change, 0.0)
            assert cost(gains + other, constants, rows) > least
            assert cost(gains, constants + other, rows) > least


def test_an_offset_whose_effect_is_in_doubt_is_used_less() -> None:
    sure = one_window([1.3, 0.7, 0.0])
    doubt = replace(
        sure.windows[0], covariance=np.diag((0.0, 0.5, 0.0)), residual=np.array([[1.0]])
    )
    unsure = replace(sure, windows=(doubt,))

    wary = regulator(unsure, ("hinge",), caution=1.0, offset_cost=2.0).gains[0, 0, 0]
    bold = regulator(sure, ("hinge",), caution=1.0, offset_cost=2.0).gains[0, 0, 0]

    assert bold < wary < 0.0


def test_doubt_is_the_cost_that_the_expected_square_has() -> None:
    a, b, doubt, residual, caution = 1.3, 0.7, 0.5, 0.4, 3.0
    window = WindowModel(
        np.array([[a, b, 0.0]]), np.diag((0.0, doubt, 0.0)), np.array([[residual]])
    )
    model = CycleModel((window,), np.ones(1), np.ones(1))

    found = regulator(model, ("hinge",), caution=caution, offset_cost=2.0).gains[0, 0, 0]

    # E (a s + (b + e) u)^2 p, where e has `caution` times the variance `doubt * residual`
    value = 1.0
    for _ in range(12):  # windows
        gain = -a * b * value / ((b * b + caution * doubt * residual) * value + 2.0)
        value = 1.0 + a * (a + b * gain) * value
    assert found == pytest.approx(gain, rel=1e-4)


def test_gains_stay_numbers_where_what_is_expected_grows_for_ever() -> None:
    rng = np.random.default_rng(6)
    count, width, moved, windows = 1200, 20, 6, 40
    few = Transitions(
        np.arange(count) % windows,
        rng.normal(size=(count, width)),
        rng.normal(size=(count, moved)),
        3.0 * rng.normal(size=(count, width)),
    )
    model = identified(few, np.ones(moved), windows)

    found = regulator(model, ("hinge",) * moved, caution=1e5)

    assert np.isfinite(found.gains).all()
    assert np.isfinite(found.constants).all()


def test_a_window_that_was_never_seen_is_in_doubt() -> None:
    seen = transitions(300)
    rows = seen.phases != 1
    model = identified(
        Transitions(seen.phases[rows], seen.before[rows], seen.offsets[rows], seen.after[rows]),
        LARGEST,
        CYCLE,
    )

    np.testing.assert_allclose(model.windows[1].residual, np.eye(WIDTH))
    assert not model.windows[1].matrix.any()


def test_without_any_transition_nothing_is_fitted() -> None:
    with pytest.raises(RunError, match="nothing can be fitted"):
        identified(transitions(0), LARGEST, CYCLE)


def test_the_unit_of_an_offset_does_not_matter() -> None:
    row = [1.3, 0.7, 0.2]
    unit = regulator(one_window(row), ("hinge",), caution=0.0, offset_cost=2.0)
    fifth = [row[0], row[1] * 0.2, row[2]]
    scaled = regulator(one_window(fifth, largest=0.2), ("hinge",), caution=0.0, offset_cost=0.08)

    np.testing.assert_allclose(scaled.gains, unit.gains, rtol=1e-4)
    np.testing.assert_allclose(scaled.constants, unit.constants, rtol=1e-4)


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
    monkeypatch.setattr(window_fitting, "_FIRST_RUNS", 4)
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
    main(["reconstruct", *options, "--output", str(walk)])  # verifies its states
    assert '"WindowFeedback": {"dofs": ["chest_x"' in walk.read_text(encoding="utf-8")
    assert read_gains(str(gains)).windows == 13


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--output", "walk.txt"], "it must end in .json"),
        (["--output", "nowhere/walk.json"], "there is no directory nowhere"),
        (["--output", "walk.json", "--cycles", "1"], "--cycles is 1; it must be 2 to 1000"),
        (["--output", "walk.json", "--rounds", "0"], "--rounds is 0; it must be 1 to 1000"),
        (["--output", "walk.json", "--headings", "9"], "--headings is 9; it must be 1 to 8"),
        (["--output", "walk.json", "--push", "nan"], "--push is nan; it must be 0 to 1000"),
        (["--output", "walk.json", "--workers", "0"], "--workers is 0"),
        (["--output", "walk.json", "--clip", "getup_faceup", "--cycles", "2"], "--cycles is 2"),
        (["--output", "walk.json", "--first", "none.json"], "none.json: no such file"),
        (["--output", "walk.json", "--clip", "stroll"], "stroll"),
    ],
)
def test_a_mistake_is_one_line(
    arguments: list[str],
    reason: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)

    assert main(["fit-feedback", *arguments]) == 1

    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1
    assert reason in told[0]
    assert not list(tmp_path.iterdir())


def test_a_window_feedback_of_another_cycle_is_refused_before_anything_begins(
    tmp_path: Path,
) -> None:
    output = tmp_path / "walk.json"
    command = [sys.executable, "-m", "experiment.cli", "reconstruct", "--output", str(output)]
    command += ["--rate", "480", "--window", "0.2", "--window-feedback", "walk@480"]

    done = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, timeout=60)

    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "has 12 windows a cycle; here a cycle has 6" in done.stderr
    assert not output.exists()


@pytest.mark.parametrize("option", [["--fit", "16"], ["--open-loop"]])
def test_a_window_feedback_where_it_cannot_act_is_refused(
    option: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["reconstruct", *option, "--window-feedback", "walk@480"]

    assert main([*given, "--output", str(tmp_path / "walk.json")]) == 1

    assert "--fit and --open-loop do without" in capsys.readouterr().err


# What is resumed

QUICK = ["--samples", "1", "--kept", "1", "--workers", "1", "--rate", "480", "--delay-ticks", "1"]


@pytest.mark.parametrize(
    ("first", "then"),
    [
        ([], []),
        (["--window-feedback", "none"], []),
        (["--open-loop"], ["--open-loop"]),
        (["--window-feedback", "walk@480"], ["--window-feedback", "walk@480"]),
    ],
)
def test_a_search_resumes_with_the_feedbacks_that_it_had(
    first: list[str], then: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, stopped = tmp_path / "whole.json", tmp_path / "stopped.json"
    codes = [main(["reconstruct", *QUICK, *first, "--output", str(whole)])]
    write = reconstruction.write_checkpoint

    def stop(path: Path, key: dict[str, Any], progress: Progress) -> None:
        write(path, key, progress)
        if progress.window == 1:
            raise RunError("stopped")

    with monkeypatch.context() as patch:
        patch.setattr(reconstruction, "write_checkpoint", stop)
        assert main(["reconstruct", *QUICK, *first, "--output", str(stopped)]) == 1
    codes.append(main(["reconstruct", *QUICK, *then, "--resume", "--output", str(stopped)]))

    assert codes[0] == codes[1]
    assert stopped.read_bytes() == whole.read_bytes()


def test_another_window_feedback_is_another_search(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    output, gains = tmp_path / "walk.json", tmp_path / "walk.gains.json"
    shipped = read_gains("walk@480")
    write_gains(gains, shipped)
    write = reconstruction.write_checkpoint

    def stop(path: Path, key: dict[str, Any], progress: Progress) -> None:
        write(path, key, progress)
        raise RunError("stopped")

    named = ["--window-feedback", str(gains), "--output", str(output)]
    with monkeypatch.context() as patch:
        patch.setattr(reconstruction, "write_checkpoint", stop)
        assert main(["reconstruct", *QUICK, *named]) == 1
    write_gains(gains, replace(shipped, constants=2.0 * shipped.constants))
    capsys.readouterr()

    assert main(["reconstruct", *QUICK, *named, "--resume"]) == 1

    assert "is of a search whose window feedback's content is" in capsys.readouterr().err
