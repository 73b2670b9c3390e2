"""Motions carried over the ground, and switched to without a jump."""

import math

import numpy as np
import pytest

from controller_node.behaviours.targets import ClipTarget
from controller_node.references.base import Reference, ReferenceState
from controller_node.references.clip import ClipReference
from controller_node.references.curve import Curve
from controller_node.references.hold import HoldReference
from controller_node.references.inertialised import InertializationOffset
from controller_node.references.transformed import PlanarTransform, TransformedReference
from msgs_config.character.layout import JointLayout
from msgs_config.character.model import Character
from msgs_config.clips.reading import read_clip
from msgs_config.geometry import rotations
from tests.support.motion import (
    FLOATING,
    MOVED,
    Sample,
    assert_moves_as_it_says,
    assert_same_motion,
    loaded,
    random_knots,
)
from tests.support.physics import character, character_id

START, DURATION = 0.7, 0.4  # s
CARRY = PlanarTransform(turn=2.1, x=0.4, y=-1.7)

every_moved = pytest.mark.parametrize("name", MOVED, ids=character_id)
every_floating = pytest.mark.parametrize("name", FLOATING, ids=character_id)


def moving(whole: Character, seed: int) -> Reference:
    """A motion in every degree of freedom, with accelerations."""
    return Curve(whole.layout, random_knots(whole, np.array([0.0, 2.0]), seed))


def switch(layout: JointLayout, goal: Reference, wanted: ReferenceState) -> Sample:
    """The way to a motion from a state at the start."""
    offset = InertializationOffset(layout, goal.sample(START), wanted, START, DURATION)
    target = ClipTarget("goal", TransformedReference(layout, goal), offset)
    return lambda time: target.state_at(time, goal.sample(time))


def switched(name: str) -> tuple[Character, Reference, ReferenceState, Sample]:
    """A motion to go to, the state of another one, and the way between."""
    whole, layout = loaded(name)
    goal, wanted = moving(whole, 3), moving(whole, 4).sample(START)
    return whole, goal, wanted, switch(layout, goal, wanted)


@every_moved
def test_it_begins_as_the_other_motion_moves(name: str) -> None:
    whole, _, wanted, way = switched(name)

    assert_same_motion(whole.layout, way(START), wanted, atol=1e-9)


@every_moved
def test_its_velocity_and_acceleration_are_the_difference_quotients(name: str) -> None:
    whole, _, _, way = switched(name)
    times = START + DURATION * np.random.default_rng(2).uniform(0.01, 0.99, 25)

    assert_moves_as_it_says(whole.layout, way, times.tolist())


@every_moved
def test_it_comes_to_the_goal_without_a_jump_and_is_the_goal_from_then_on(name: str) -> None:
    whole, goal, _, way = switched(name)
    end = START + DURATION

    before = way(end - 1e-9)
    assert_same_motion(whole.layout, before, goal.sample(end - 1e-9), atol=1e-5)
    late = goal.sample(end + 0.1)
    assert way(end + 0.1).configuration.position.tobytes() == (
        late.configuration.position.tobytes()
    )


def test_from_rest_to_rest_the_offset_is_the_quintic() -> None:
    panda = character("franka_panda")
    goal = HoldReference(panda)
    rest = np.array(panda.rest_position)
    wanted_position = rest.copy()
    wanted_position[0] += 0.3
    still = np.zeros(panda.layout.size)
    wanted = ReferenceState(panda.layout.configuration(wanted_position), still, still)
    way = switch(panda.layout, goal, wanted)

    for u in (0.0, 0.3, 0.5, 0.9):
        share = 1.0 - 10.0 * u**3 + 15.0 * u**4 - 6.0 * u**5
        position = way(START + u * DURATION).configuration.position
        assert position[0] == pytest.approx(rest[0] + 0.3 * share, abs=1e-12)
        assert position[1:] == pytest.approx(rest[1:], abs=1e-12)


@every_floating
def test_a_carried_motion_moves_as_it_says(name: str) -> None:
    whole, layout = loaded(name)
    moved = TransformedReference(layout, moving(whole, 5), CARRY, start=START, motion_start=0.2)

    assert_moves_as_it_says(layout, moved.sample, [START + 0.1, START + 0.9])


@every_floating
def test_a_carried_motion_is_turned_and_shifted_and_begins_in_its_middle(name: str) -> None:
    whole, layout = loaded(name)
    motion = moving(whole, 5)
    moved = TransformedReference(layout, motion, CARRY, start=START, motion_start=0.2)

    there, here = motion.sample(0.5), moved.sample(START + 0.3)

    # the plane's complex numbers are the oracle
    place = complex(*there.configuration.position[:2]) * np.exp(1j * CARRY.turn)
    expected = place + complex(CARRY.x, CARRY.y)
    assert complex(*here.configuration.position[:2]) == pytest.approx(expected)
    assert here.configuration.position[2] == pytest.approx(there.configuration.position[2])
    assert here.configuration.position[6:] == pytest.approx(there.configuration.position[6:])
    axes = rotations.matrix(there.configuration.orientations_xyzw[0])
    cosine, sine = math.cos(CARRY.turn), math.sin(CARRY.turn)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    turned = rotations.matrix(here.configuration.orientations_xyzw[0])
    np.testing.assert_allclose(turned, turn @ axes, atol=1e-12)


def test_what_leads_from_one_place_and_heading_to_another_does_so() -> None:
    here, there = np.array([1.0, 2.0, 0.9]), np.array([-3.0, 0.5, 0.1])
    carry = PlanarTransform.leading(here, 3.0, there, -3.0)

    assert carry.turn == pytest.approx(math.tau - 6.0)  # the shorter way round
    place = complex(1.0, 2.0) * np.exp(1j * carry.turn) + complex(carry.x, carry.y)
    assert place == pytest.approx(complex(-3.0, 0.5))


def test_no_carry_changes_no_bit() -> None:
    humanoid = character("humanoid")
    motion = ClipReference(humanoid.layout, read_clip(humanoid, "walk"))
    moved = TransformedReference(humanoid.layout, motion)

    for time in (0.0, 0.31, 2.7):
        one, other = motion.sample(time), moved.sample(time)
        assert one.configuration.position.tobytes() == other.configuration.position.tobytes()
        assert one.velocity.tobytes() == other.velocity.tobytes()
