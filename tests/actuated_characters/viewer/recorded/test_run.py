"""A recorded run as the viewer shows it: each state with what led to it, and plots by theory."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.bags.recording import read_recording
from actuated_characters.cli import main
from actuated_characters.render.scene import make_scene
from actuated_characters.viewer.recorded.plots import curves, resampled, run_curves
from actuated_characters.viewer.recorded.run import RecordedRun, beside, check_comparable, read_run
from msgs_config.errors import RecordingError
from tests.support.bags import Made, make_run, write_bag


@pytest.fixture(scope="module")
def walk() -> Made:
    return make_run("humanoid", 0.5, {"reference": "clip", "clip": "walk"})


@pytest.fixture(scope="module")
def directory(walk: Made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("walk")
    write_bag(found / "bag", walk.messages())
    return found


def test_a_sample_is_a_state_with_the_effort_that_led_to_it(walk: Made, directory: Path) -> None:
    run = read_run(directory)

    for row in (0, 1, 60, 120):
        sample, state = run.sample(0, row), walk.states[row]
        assert sample.state is not None
        assert sample.state.stamp_ns == state.stamp_ns
        assert sample.state.position.tolist() == state.position.tolist()
        found = None if sample.state.effort is None else sample.state.effort.tolist()
        assert found == (None if state.effort is None else state.effort.tolist())
    first = walk.ticks[0].reference
    assert first is not None
    reference = run.sample(0, 0).reference
    assert reference is not None and reference.tolist() == first.position.tolist()


def test_another_run_is_where_it_was_at_that_time(walk: Made, directory: Path) -> None:
    run = read_run(directory)

    for time, row in ((0.25, 60), (99.0, -1)):
        position = run.position_at(0, time)
        assert position is not None
        assert position.tolist() == walk.states[row].position.tolist()


def test_a_fork_that_begins_with_a_keyframe_is_at_the_time_of_its_original(directory: Path) -> None:
    run = read_run(directory)
    later = RecordedRun(directory, make_scene([run.recordings[0].rows(slice(48, 121))]))

    ghost = beside(run, later)

    assert ghost.starts == pytest.approx(0.2)
    assert ghost.position_at(0, 0.1) is None
    for time in (0.2, 0.3, 0.5):
        ours, theirs = run.position_at(0, time), ghost.position_at(0, time)
        assert ours is not None and theirs is not None
        assert ours.tolist() == theirs.tolist()
    (character,) = run_curves(ghost, "fork").values()
    (original,) = run_curves(run, "run").values()
    at = np.searchsorted(original.times, character.times + 1e-9) - 1
    for name, values in character.values.items():
        np.testing.assert_array_equal(values[1:], original.values[name][at][1:])


def test_another_run_that_begins_elsewhere_begins_together_with_the_run(directory: Path) -> None:
    run = read_run(directory)
    part = run.recordings[0].rows(slice(48, 121))
    moved = replace(part, position=part.position + 1e-6)

    assert beside(run, RecordedRun(directory, make_scene([moved]))).starts == 0.0


def test_the_ghosts_curve_has_the_largest_value_of_each_part_of_the_time() -> None:
    times, values = np.arange(10) / 10.0, np.array([0, 3, 1, 2, 9, 4, np.nan, 7, 8, 5], dtype=float)

    found = resampled(times + 0.2, values, np.array([0.0, 0.2, 0.5, 0.9]), 1.0)

    # 0.2 to 0.4 s, 0.5 to 0.8 s, and 0.9 s to the end, which is before the two last values
    np.testing.assert_array_equal(found, [np.nan, 3.0, 9.0, 8.0])


def test_runs_of_other_characters_cannot_be_compared(directory: Path, tmp_path: Path) -> None:
    write_bag(tmp_path / "bag", make_run("pendulum", 0.1).messages())

    check_comparable(read_run(directory), read_run(directory))
    with pytest.raises(RecordingError, match=r"cannot be shown beside .* \(pendulum, not humanoid"):
        check_comparable(read_run(directory), read_run(tmp_path))


def test_a_pendulums_curves_are_its_error_and_its_effort(tmp_path: Path) -> None:
    made = make_run("pendulum", 0.5, initial_position=[0.3])
    write_bag(tmp_path / "bag", made.messages())
    recording = read_recording(tmp_path)

    found = curves(recording)

    error, effort = found["largest joint error (rad)"], found["largest effort / limit"]
    expected = np.abs(recording.position[:, 0] - recording.reference_position[:, 0])
    assert error[:-1] == pytest.approx(expected[:-1], abs=1e-12)  # the last has no reference
    (limit,) = recording.character.effort_limits()
    assert np.isnan(effort[0])
    assert effort[1:] == pytest.approx(np.abs(recording.effort[:, 0]) / limit)
    assert "force / weight" not in found  # nothing touches the ground


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nowhere"], "no run or recording at nowhere"),
        (["."], "no recording in ."),
        (["nowhere", "--namespace", "/lab"], "--namespace is of running simulators"),
        (["nowhere", "--fps", "0"], "parameter 'fps' is 0.0; it must be 1 to 120 Hz"),
        (["nowhere", "--port", "70000"], "parameter 'port' is 70000"),
    ],
)
def test_what_cannot_be_viewed_is_one_clear_line(
    arguments: list[str],
    says: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    own_handlers: None,
) -> None:
    monkeypatch.chdir(tmp_path)

    assert main(["view", *arguments]) == 1

    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: {says}")
