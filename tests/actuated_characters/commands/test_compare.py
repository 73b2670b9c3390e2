"""Two recordings are the same to the last bit, or where they part is named."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from matplotlib.image import imread

from actuated_characters.bags.recording import read_recording, read_recordings
from actuated_characters.bags.writer import BagWriter
from actuated_characters.cli import main
from actuated_characters.report.comparison import RecordingComparison, compare, pair
from msgs_config.arrays import FloatArray
from msgs_config.errors import RecordingError
from msgs_config.messages.state import StampedState
from tests.support.bags import (
    Made,
    add_to,
    make_run,
    raw_configuration,
    raw_references,
    raw_states,
    write_bag,
)
from tests.support.eventful import Eventful, eventful_run, raw_controller, write_timed

FORCE = (400.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def pendulum() -> Made:
    return make_run("pendulum", 0.05)


@pytest.fixture(scope="module")
def humanoid() -> Eventful:
    return eventful_run("humanoid", 24)


@pytest.fixture(scope="module")
def pushed() -> Eventful:
    return eventful_run("humanoid", 24, pushed=[(9, 4, "chest", FORCE)])


def bag_of(path: Path, made: Made, states: Sequence[StampedState]) -> Path:
    references = [tick.reference for tick in made.ticks if tick.reference is not None]
    messages = [
        raw_configuration(made.plan),
        *raw_states(made.plan, states),
        *raw_references(made.plan, references),
    ]
    return write_bag(path, messages)


def flipped(value: float, bit: int = 0) -> float:
    """A number with one bit of it flipped."""
    bits = np.array([value]).view(np.uint64) ^ np.uint64(1 << bit)
    return float(bits.view(np.float64)[0])


def changed(state: StampedState, quantity: str, value: float) -> StampedState:
    array: FloatArray = getattr(state, quantity).copy()
    array[0] = value
    return replace(state, **{quantity: array})


def compared(first: Path, second: Path, tolerance: float | None = None) -> RecordingComparison:
    return compare(read_recording(first), read_recording(second), tolerance)


def turn(first: FloatArray, second: FloatArray) -> float:
    """The angle between two orientations, given as rotation vectors, by MuJoCo."""
    quaternions = np.zeros((2, 4))
    for quaternion, vector in zip(quaternions, (first, second), strict=True):
        angle = float(np.linalg.norm(vector))
        mujoco.mju_axisAngle2Quat(quaternion, vector / (angle or 1.0), angle)
    between = np.zeros(3)
    mujoco.mju_subQuat(between, *quaternions)
    return float(np.linalg.norm(between))


def assert_parts(comparison: RecordingComparison, tick: int, quantity: str, dof: str) -> None:
    assert not comparison.identical
    assert comparison.first is not None
    found = comparison.first
    assert (found.tick, found.quantity, found.dof) == (tick, quantity, dof)


# To the last bit


def test_the_same_run_twice_is_identical(
    humanoid: Eventful, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = eventful_run("humanoid", 24)
    first = write_timed(tmp_path / "first", humanoid.messages())
    second = write_timed(tmp_path / "second", again.messages())

    assert main(["compare", str(first), str(second)]) == 0
    assert "identical to the last bit: 25 states each" in capsys.readouterr().out
    growth = compared(first, second).growth
    assert not growth.joints.any() and not growth.root.any()


@pytest.mark.parametrize(
    ("quantity", "bit"), [("position", 0), ("velocity", 0), ("effort", 0), ("velocity", 63)]
)
def test_one_flipped_bit_is_found_and_named_be_it_the_sign_of_a_zero(
    pendulum: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str], quantity: str, bit: int
) -> None:
    states = list(pendulum.states)
    if bit:
        states[7] = changed(states[7], quantity, 0.0)
    before = float(getattr(states[7], quantity)[0])
    first = bag_of(tmp_path / "first", pendulum, states)
    states[7] = changed(states[7], quantity, flipped(before, bit))
    second = bag_of(tmp_path / "second", pendulum, states)

    comparison = compared(first, second)

    assert_parts(comparison, 8, quantity, "hinge")  # ticks begin at 1
    assert comparison.first is not None
    assert comparison.first.values == (before, flipped(before, bit))
    assert comparison.first.amount == pytest.approx(abs(flipped(before, bit) - before), rel=1.0)
    assert main(["compare", str(first), str(second)]) == 1
    assert "tick 8" in capsys.readouterr().out


def test_a_tolerance_lets_small_differences_pass(
    pendulum: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    states = list(pendulum.states)
    states[3] = changed(states[3], "position", float(states[3].position[0]) + 1e-6)
    states[9] = changed(states[9], "velocity", float(states[9].velocity[0]) + 1e-3)
    first = bag_of(tmp_path / "first", pendulum, pendulum.states)
    second = bag_of(tmp_path / "second", pendulum, states)

    assert_parts(compared(first, second), 4, "position", "hinge")
    assert_parts(compared(first, second, 1e-5), 10, "velocity", "hinge")
    assert compared(first, second, 1e-2).identical
    arguments = ["compare", str(first), str(second), "--tolerance"]
    assert main([*arguments, "0.01"]) == 0
    assert main([*arguments, "-1"]) == 1
    assert "--tolerance is -1.0" in capsys.readouterr().err


def test_rotations_are_compared_as_rotations(humanoid: Eventful, tmp_path: Path) -> None:
    """A turn by pi about an axis and its negative is one turn, of other numbers."""
    bags = []
    for sign in (1.0, -1.0):
        states = list(humanoid.states)
        position = states[5].position.copy()
        position[3:6] = (0.0, sign * np.pi, 0.0)
        states[5] = replace(states[5], position=position)
        bags.append(
            write_timed(tmp_path / f"{sign:g}", replace(humanoid, states=states).messages())
        )

    assert_parts(compared(*bags), 6, "position", "root_ry")
    assert compared(*bags, 1e-9).identical


# How they part


def test_a_push_parts_them_and_the_difference_is_that_of_the_messages(
    humanoid: Eventful, pushed: Eventful, tmp_path: Path
) -> None:
    comparison = compared(
        write_timed(tmp_path / "first", humanoid.messages()),
        write_timed(tmp_path / "second", pushed.messages()),
    )

    assert comparison.first is not None
    assert comparison.first.tick == 11  # the state that the tenth tick led to
    assert comparison.growth.root[:10].tolist() == [0.0] * 10
    ours, theirs = (np.array([s.position for s in run.states]) for run in (humanoid, pushed))
    np.testing.assert_allclose(
        comparison.growth.root, np.linalg.norm(ours[:, :3] - theirs[:, :3], axis=1), atol=1e-15
    )
    largest = np.zeros(len(ours))
    for joint in humanoid.plan.character.layout.joints[1:]:
        first, second = ours[:, joint.entries], theirs[:, joint.entries]
        if first.shape[1] == 3:
            largest = np.maximum(largest, [turn(*both) for both in zip(first, second, strict=True)])
        else:
            largest = np.maximum(largest, np.abs(first - second)[:, 0])
    np.testing.assert_allclose(comparison.growth.joints, largest, atol=1e-9)
    assert comparison.growth.by_second()[0][1] == pytest.approx(largest.max())


def test_different_lengths_are_compared_in_what_is_common(
    pendulum: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = bag_of(tmp_path / "first", pendulum, pendulum.states)
    second = bag_of(tmp_path / "second", pendulum, pendulum.states[:5])

    comparison = compared(first, second)

    assert comparison.first is None and not comparison.identical
    assert comparison.states == (len(pendulum.states), 5) and comparison.common == 5
    assert main(["compare", str(first), str(second)]) == 1
    assert "identical to the last bit in what both have: 5 states" in capsys.readouterr().out


def test_parameters_and_gains_that_differ_are_listed(
    humanoid: Eventful, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = eventful_run("humanoid", 24, friction=0.5)
    stiffer = {**other.plan.controller, "gains.neck.p": 123.0}
    other.from_controller = [raw_controller(other.plan, stiffer)]  # type: ignore[arg-type]
    first = write_timed(tmp_path / "first", humanoid.messages())
    second = write_timed(tmp_path / "second", other.messages())

    comparison = compared(first, second)

    assert comparison.simulator == {"friction": (0.9, 0.5)}
    assert comparison.controller == {"gains.neck.p": (100.0, 123.0)}
    main(["compare", str(first), str(second)])
    output = capsys.readouterr().out
    assert "friction" in output and "gains.neck.p" in output and "state_hash" in output


def test_the_growth_is_drawn(
    humanoid: Eventful, pushed: Eventful, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = write_timed(tmp_path / "first", humanoid.messages())
    second = write_timed(tmp_path / "second", pushed.messages())
    picture = tmp_path / "growth.png"

    assert main(["compare", str(first), str(second), "--output", str(picture)]) == 1
    assert imread(picture).std() > 0.0
    assert main(["compare", str(first), str(first), "--output", str(picture)]) == 0
    assert main(["compare", str(first), str(first), "--output", "growth.txt"]) == 1
    assert "must be a .png file" in capsys.readouterr().err


# What cannot be compared


def test_what_cannot_be_compared_is_one_line(
    pendulum: Made, humanoid: Eventful, tmp_path: Path
) -> None:
    first = bag_of(tmp_path / "first", pendulum, pendulum.states)
    second = write_timed(tmp_path / "second", humanoid.messages())
    later = [replace(s, stamp_ns=s.stamp_ns + 10**9) for s in pendulum.states]

    with pytest.raises(RecordingError, match=r"'pendulum' \(1 .*'humanoid' \(34 "):
        compared(first, second)
    with pytest.raises(RecordingError, match="no stamp in common"):
        compared(first, bag_of(tmp_path / "later", pendulum, later))


def test_several_characters_are_paired_by_name(pendulum: Made, tmp_path: Path) -> None:
    paths = []
    for number, names in enumerate((("left", "right"), ("right", "left"), ("left", "other"))):
        paths.append(tmp_path / str(number))
        with BagWriter(paths[-1]) as bag:
            for name in names:
                add_to(bag, pendulum.messages(), name)
    first, second, third = map(read_recordings, paths)

    pairs = pair(first, second)

    assert {(ours.name, theirs.name) for ours, theirs in pairs} == {
        ("left", "left"),
        ("right", "right"),
    }
    with pytest.raises(RecordingError, match="different characters: left, right and left, other"):
        pair(first, third)
