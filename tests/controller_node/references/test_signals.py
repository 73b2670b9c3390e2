"""Steps and sines against their closed forms, for every type of joint."""

import re
from collections.abc import Callable

import numpy as np
import pytest

from controller_node.references.base import Reference
from controller_node.references.hold import HoldReference
from controller_node.references.signals import SineReference, StepReference
from msgs_config.character.model import Character
from msgs_config.errors import MotionError
from msgs_config.geometry import rotations
from tests.support.motion import (
    MOVED,
    assert_consistent,
    assert_moves_as_it_says,
    assert_same_place,
    loaded,
)
from tests.support.physics import EVERY_CHARACTER, character, character_id

PANDA, HUMANOID = character("franka_panda"), character("humanoid")
Make = Callable[[Character, list[str], float], Reference]
SIGNALS: dict[str, Make] = {
    "step": lambda whole, names, size: StepReference(whole, names, size, 1.0),
    "sine": lambda whole, names, size: SineReference(whole, names, size, 0.5),
}
both = pytest.mark.parametrize("signal", SIGNALS)


def movable(whole: Character, size: float) -> list[str]:
    """The degrees of freedom that have `size` of room on both sides of the rest pose."""
    lower, upper = whole.position_bounds()
    rest = np.array(whole.rest_position)
    room = np.minimum(rest - lower, upper - rest) >= size
    return [name for name, has in zip(whole.layout.dof_names, room, strict=True) if has]


@pytest.mark.parametrize("name", MOVED, ids=character_id)
def test_a_sines_velocity_and_acceleration_are_the_difference_quotients(name: str) -> None:
    whole, layout = loaded(name)
    names = movable(whole, 0.3)
    assert names
    reference = SineReference(whole, names, 0.3, 0.8)

    times = np.random.default_rng(1).uniform(0.0, 5.0, 30)

    assert_moves_as_it_says(layout, reference.sample, times.tolist())


@pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
def test_a_sine_is_a_sine_in_every_degree_of_freedom_alone(name: str) -> None:
    whole, layout = loaded(name)
    rest = layout.configuration(np.array(whole.rest_position))
    angular_frequency = 2.0 * np.pi * 0.8

    for dof in movable(whole, 0.3):
        reference, expected = SineReference(whole, [dof], 0.3, 0.8), np.zeros(layout.size)
        for time in (0.0, 0.21, 1.7):
            phase = angular_frequency * time
            state = reference.sample(time)
            expected[layout.dof_names.index(dof)] = 0.3
            moved = layout.difference(rest, state.configuration)
            np.testing.assert_allclose(moved, expected * np.sin(phase), atol=1e-12)
            rate = expected * angular_frequency
            np.testing.assert_allclose(state.velocity, rate * np.cos(phase), atol=1e-12)
            second = -rate * angular_frequency * np.sin(phase)
            np.testing.assert_allclose(state.acceleration, second, atol=1e-12)


def test_a_step_is_the_rest_pose_and_then_another() -> None:
    layout = PANDA.layout
    reference = StepReference(PANDA, ["panda_joint1", "panda_finger_joint1"], 0.02, 1.5)
    rest, expected = HoldReference(PANDA).sample(0.0), np.array(PANDA.rest_position)
    for name in ("panda_joint1", "panda_finger_joint1"):
        expected[layout.joint(name).start] += 0.02

    for time in (0.0, 1.4999):
        assert_same_place(layout, reference.sample(time), rest)
    for time in (1.5, 1.6, 99.0):
        state = reference.sample(time)
        np.testing.assert_allclose(state.configuration.position, expected, atol=1e-15)
        np.testing.assert_array_equal(state.velocity, 0.0)
        np.testing.assert_array_equal(state.acceleration, 0.0)


def test_a_step_turns_a_ball_joint_and_a_root_in_the_childs_frame() -> None:
    layout = HUMANOID.layout
    names = ["chest_x", "chest_z", "root_ry", "root_y"]

    state = StepReference(HUMANOID, names, 0.6, 0.0).sample(0.0)

    rest = layout.configuration(np.array(HUMANOID.rest_position)).orientations_xyzw
    turned = state.configuration.orientations_xyzw
    chest = [row.start for row in layout.joints if row.rotation is not None].index(
        layout.joint("chest").start
    )
    for row, vector in ((0, [0.0, 0.6, 0.0]), (chest, [0.6, 0.0, 0.6])):
        expected = rotations.matrix(rest[row]) @ rotations.matrix(rotations.exp(np.array(vector)))
        np.testing.assert_allclose(rotations.matrix(turned[row]), expected, atol=1e-12)
    assert state.configuration.position[1] == pytest.approx(HUMANOID.rest_position[1] + 0.6)
    assert_consistent(layout, state)


@both
def test_a_name_that_is_unknown_repeated_or_missing_is_refused(signal: str) -> None:
    make = SIGNALS[signal]
    for names, words in (
        (["panda_joint11"], "unknown degree of freedom 'panda_joint11'.*did you mean"),
        (["panda_joint1", "panda_joint1"], "'panda_joint1' is named twice"),
        ([], "no degree of freedom is named"),
    ):
        with pytest.raises(MotionError, match=words):
            make(PANDA, names, 0.1)


@both
@pytest.mark.parametrize("size", [np.nan, np.inf, -np.inf, 1e7])
def test_a_size_that_is_no_number_of_use_is_refused(signal: str, size: float) -> None:
    with pytest.raises(
        MotionError, match=f"the {signal}'s .* is {re.escape(f'{size:g}')}; it must"
    ):
        SIGNALS[signal](PANDA, ["panda_joint1"], size)


@pytest.mark.parametrize("value", [np.nan, -0.1, np.inf])
def test_a_time_or_a_frequency_below_zero_or_not_finite_is_refused(value: float) -> None:
    with pytest.raises(MotionError, match=r"the step's time is .*; it must be from 0 to"):
        StepReference(PANDA, ["panda_joint1"], 0.1, value)
    with pytest.raises(MotionError, match=r"the sine's frequency is .*; it must be from 0 to"):
        SineReference(PANDA, ["panda_joint1"], 0.1, value)


@both
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
def test_up_to_the_limits_is_taken_and_beyond_refused(name: str, sign: float, signal: str) -> None:
    whole, _ = loaded(name)
    lower, upper = whole.position_bounds()
    rest = np.array(whole.rest_position)
    for index in np.flatnonzero(np.isfinite(lower) & np.isfinite(upper)).tolist():
        up, down = upper[index] - rest[index], rest[index] - lower[index]
        if min(up, down) < 0.0:
            continue  # a rest pose beyond limits
        room = min(up, down) if signal == "sine" else (up if sign > 0.0 else down)
        dof = whole.layout.dof_names[index]

        SIGNALS[signal](whole, [dof], sign * room)

        with pytest.raises(MotionError) as caught:
            SIGNALS[signal](whole, [dof], sign * (room + 0.01))
        line = str(caught.value)
        assert f"'{dof}'" in line and "0.01 " in line and "\n" not in line
        assert f"{upper[index]:g}" in line and "must be" in line
