"""States and commands are compared to the last bit, or within a tolerance."""

from dataclasses import replace

import numpy as np
import pytest

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.error_measures import different_bits
from actuated_characters.replay.command_comparison import compare_commands, recorded_commands
from actuated_characters.replay.comparison import (
    EFFORT,
    POSITION,
    QUANTITIES,
    VELOCITY,
    compare_balls,
    compare_contacts,
    compare_world,
    unit_of,
)
from msgs_config.arrays import FloatArray
from msgs_config.messages.projectiles import BallStates
from msgs_config.messages.wrenches import WrenchArrays
from tests.support.bags import make_run
from tests.support.recordings import changed, commanding, recording_of

TICKS = 48


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    made = make_run("humanoid", TICKS / 240.0, {"reference": "clip", "clip": "walk"})
    return recording_of(made, tmp_path_factory.mktemp("walk"))


def found_again(recording: Recording) -> dict[str, FloatArray]:
    """States that are the recorded ones."""
    first = np.full((1, recording.layout.size), np.nan)
    effort = np.concatenate((first, recording.effort))
    position, velocity = recording.position.copy(), recording.velocity.copy()
    return {EFFORT: effort, POSITION: position, VELOCITY: velocity}


def test_the_sign_of_zero_is_a_bit() -> None:
    zeros = np.zeros(3)

    assert different_bits(zeros, -zeros).all()
    assert not different_bits(np.full(3, np.nan), np.full(3, np.nan)).any()


@pytest.mark.parametrize(
    ("name", "quantity", "unit"),
    [
        ("root_z", POSITION, "m"),
        ("root_rz", POSITION, "rad"),
        ("root_y", EFFORT, "N"),
        ("right_knee", EFFORT, "N m"),
        ("chest_x", VELOCITY, "rad/s"),
    ],
)
def test_units_are_those_of_the_joints(
    walk: Recording, name: str, quantity: str, unit: str
) -> None:
    assert unit_of(walk.layout, walk.layout.dof_names.index(name), quantity) == unit


# States


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_of_states_that_came_back_any_bit_is_found_at_its_tick(
    walk: Recording, quantity: str
) -> None:
    rng = np.random.default_rng(6)
    for _ in range(5):
        row, entry = int(rng.integers(1, TICKS + 1)), int(rng.integers(34))
        found = found_again(walk)
        found[quantity] = changed(found[quantity], row, entry, int(rng.integers(52)))
        found[VELOCITY][row + 1 :] += 1.0  # what it leads to comes later

        difference = compare_world([walk], [found]).difference

        assert difference is not None
        assert (difference.quantity, difference.tick) == (quantity, row + 1)
        assert difference.name == walk.layout.dof_names[entry]


def test_within_a_tolerance_the_largest_differences_are_told(walk: Recording) -> None:
    found = found_again(walk)
    found[VELOCITY][40] += 1e-6
    found[EFFORT][30] += 1e-3  # what is applied may be another one, if the states are not

    assert compare_world([walk], [found], tolerance=1e-5).identical
    result = compare_world([walk], [found], tolerance=1e-7)

    assert result.difference is not None
    assert (result.difference.tick, result.difference.quantity) == (41, VELOCITY)
    expected = {"rad": 0.0, "m": 0.0, "rad/s": 1e-6, "m/s": 1e-6}
    assert result.largest == pytest.approx(expected, abs=1e-12)


def test_beyond_a_tolerance_the_farthest_of_the_first_state_is_named(walk: Recording) -> None:
    names, found = walk.layout.dof_names, found_again(walk)
    for row, name, size in ((30, "root_x", 1e-5), (30, "root_y", 2e-5), (31, "root_z", 1e-3)):
        found[VELOCITY][row, names.index(name)] += size

    difference = compare_world([walk], [found], tolerance=1e-6).difference

    assert difference is not None and (difference.tick, difference.name) == (31, "root_y")


def test_a_turn_by_more_than_pi_is_a_small_difference(walk: Recording) -> None:
    """A rotation vector jumps at norm pi; rotations are compared as rotations."""
    chest = walk.layout.joint("chest").entries
    position = walk.position.copy()
    position[:, chest] = [np.pi - 1e-6, 0.0, 0.0]
    turned = replace(walk, position=position)
    found = found_again(turned)
    found[POSITION][:, chest] = [-np.pi + 1e-6, 0.0, 0.0]

    assert compare_world([turned], [found], tolerance=3e-6).identical
    assert not compare_world([turned], [found], tolerance=1e-6).identical


# Contacts and balls


def test_contacts_are_compared_as_numbers() -> None:
    one = WrenchArrays.of_rows(5, ["chest", "neck"], np.arange(12.0).reshape(2, 6), [])
    turned = WrenchArrays.of_rows(5, ["neck", "chest"], one.wrenches[::-1], [])
    other = replace(one, wrenches=one.wrenches + np.eye(12)[8].reshape(2, 6))

    assert compare_contacts(2, one, replace(one, wrenches=one.wrenches * 1.0)) is None
    assert compare_contacts(2, one, turned) is None
    difference = compare_contacts(2, one, other, "left")
    assert difference is not None and (difference.recorded, difference.found) == (8.0, 9.0)
    expected = "tick 2 of left (0.000000005 s): z of the contact force on 'neck' was 8.0 in the"
    assert str(difference) == f"{expected} recording and is 9.0 now"


def test_balls_are_compared_to_the_last_bit() -> None:
    recorded = BallStates(7, ("ball_1", "ball_2"), np.zeros((2, 13)))
    other = recorded.motion.copy()
    other[1, 9] = -0.0

    assert compare_balls(3, recorded, recorded.motion.copy()) is None
    difference = compare_balls(3, recorded, other)
    assert difference is not None and difference.name == "ball_2"
    assert "z of the velocity in m/s was 0.0 in the recording and is -0.0" in str(difference)
    fewer = compare_balls(3, recorded, other[:1])
    assert "there were 2 balls in the recording and are 1 now" in str(fewer)


# Commands


def test_any_bit_of_any_command_is_found(walk: Recording) -> None:
    rng = np.random.default_rng(5)
    assert compare_commands(walk, walk.effort).identical
    for _ in range(20):
        row, entry, bit = int(rng.integers(TICKS)), int(rng.integers(34)), int(rng.integers(52))
        received = changed(walk.effort, row, entry, bit)

        comparison = compare_commands(walk, received)

        first, name = comparison.first, walk.layout.dof_names[entry]
        assert first is not None and first == comparison.largest
        assert (first.tick, first.name) == (row + 1, name)
        assert first.found == received[row, entry]
        assert comparison.largest_difference == abs(received[row, entry] - walk.effort[row, entry])


def test_a_ball_joints_difference_is_the_length_of_a_vector(walk: Recording) -> None:
    received = walk.effort[:10].copy()
    received[4, walk.layout.joint("chest").entries] += [3.0, 4.0, 12.0]

    comparison = compare_commands(walk, received)

    (found,) = [joint for joint in comparison.joints if joint.name == "chest"]
    assert found.largest == pytest.approx(13.0) and found.mean == pytest.approx(1.3)
    others = [joint.largest for joint in comparison.joints if joint.name != "chest"]
    assert others == [0.0] * (len(walk.character.vector_names) - 1)


def test_where_only_the_sign_of_zero_differs_the_largest_difference_is_that(
    walk: Recording,
) -> None:
    row, entry = 5, 7
    effort = walk.effort[row].copy()
    effort[entry] = 0.0
    recording = commanding(walk, row, effort)
    received = recorded_commands(recording)
    received[row, entry] = -0.0

    comparison = compare_commands(recording, received)

    assert not comparison.identical and comparison.within(0.0)
    assert comparison.largest is not None and comparison.largest == comparison.first
    assert comparison.largest.name == walk.layout.dof_names[entry]
