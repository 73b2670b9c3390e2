"""The reference's place: it gives way to what was pushed or has stopped, and comes back."""

import math
from dataclasses import replace

import numpy as np
import pytest

from controller_node.planner.anchor import Anchor, PlanarState, planar_state
from controller_node.planner.contact_model import ContactModel
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations
from tests.support.physics import character

PERIOD = 0.05
HUMANOID = character("humanoid")
MODEL = ContactModel(HUMANOID, period_s=1 / 240, gravity=9.81, friction=0.45)
FORWARDS = rotations.about_z(0.0)
STANDING = PlanarState(0j, 0j, FORWARDS)
WALKING = PlanarState(0j, 1.2 + 0j, FORWARDS)


def pushed(error: complex, *, heading: float = 0.0, velocity: complex = 0j) -> PlanarState:
    """A character away from a reference that walks through the origin."""
    return PlanarState(error, WALKING.velocity + velocity, rotations.about_z(heading))


def seen_from(anchor: Anchor, where: complex, heading: float) -> PlanarState:
    """A character that stands somewhere in the world, as it is in the reference's."""
    inside = (where - anchor.place) * complex(math.cos(anchor.yaw), -math.sin(anchor.yaw))
    return PlanarState(inside, 0j, rotations.about_z(heading - anchor.yaw))


def in_world(anchor: Anchor, point: complex) -> complex:
    """A point of the ground of the reference's world."""
    return complex(*anchor.to_world(np.array((point.real, point.imag, 0.0)))[:2])


def random_state(seed: int) -> tuple[FloatArray, FloatArray]:
    """MuJoCo's position (q,) and velocity (n,)."""
    draw = np.random.default_rng(seed)
    position = np.array(HUMANOID.rest_position) + draw.normal(size=HUMANOID.layout.size)
    return MODEL.position_of(position), draw.normal(size=HUMANOID.layout.size)


def test_undisturbed_it_stays_where_it_is_to_the_last_bit() -> None:
    anchor = Anchor()
    for tick in range(200):
        state = pushed(0.2 + 0.1j, velocity=0.4j)
        anchor = anchor.advanced(state, WALKING, WALKING, tick * PERIOD, PERIOD)
    position, velocity = random_state(0)

    seen, moving = anchor.to_reference_world(position, velocity)

    assert (anchor.place, anchor.yaw) == (0j, 0.0)
    assert seen is position
    assert moving is velocity


@pytest.mark.parametrize(
    ("now", "soon", "is_perturbed"),
    [
        (1.2, 1.2, False),
        (2.2, 1.2, False),  # one frame of a capture is faster
        (1.2, 2.2, False),  # it begins to go faster
        (2.2, 2.2, True),
    ],
)
def test_who_is_as_fast_as_the_reference_will_be_is_not_perturbed(
    now: float, soon: float, is_perturbed: bool
) -> None:
    wanted, later = (replace(WALKING, velocity=complex(speed)) for speed in (now, soon))

    anchor = Anchor().advanced(WALKING, wanted, later, 2.0, PERIOD)

    assert anchor.is_perturbed(2.1) == is_perturbed


@pytest.mark.parametrize("seed", range(3))
def test_a_state_is_seen_from_the_references_world(seed: int) -> None:
    draw = np.random.default_rng(seed)
    anchor = Anchor(complex(*draw.normal(size=2)), draw.normal())
    position, velocity = random_state(seed)

    seen, moving = anchor.to_reference_world(position, velocity)

    turn = rotations.about_z(anchor.yaw)
    shift = np.array((anchor.place.real, anchor.place.imag, 0.0))
    np.testing.assert_allclose(rotations.rotate(turn, seen[:3]) + shift, position[:3], atol=1e-12)
    np.testing.assert_allclose(rotations.rotate(turn, moving[:3]), velocity[:3], atol=1e-12)
    turned = rotations.multiply(turn, rotations.xyzw_from_wxyz(seen[3:7]))
    again = rotations.angle_between(turned, rotations.xyzw_from_wxyz(position[3:7]))
    assert float(again) == pytest.approx(0.0, abs=1e-7)
    assert seen[7:].tobytes() == position[7:].tobytes()
    assert moving[3:].tobytes() == velocity[3:].tobytes()


def test_pushed_away_it_follows_and_turns() -> None:
    # Arrange: the character stays where it was pushed to, in the world
    where, heading = 0.6 + 0.5j, 0.8
    anchor = Anchor()

    # Act
    places, yaws = [0j], [0.0]
    for tick in range(200):
        state = replace(seen_from(anchor, where, heading), velocity=WALKING.velocity)
        anchor = anchor.advanced(state, WALKING, WALKING, tick * PERIOD, PERIOD)
        places.append(anchor.place)
        yaws.append(anchor.yaw)

    # Assert: it comes near, but for the 0.15 m/s by which it returns; and never further off than
    # what it takes for calm
    assert min(abs(where - place) for place in places) < 0.15 * 0.3 + 0.01
    assert abs(where - places[-1]) < 0.3
    assert 0.3 < max(yaws) < heading


def test_as_the_reference_comes_to_stand_its_world_follows_for_a_second_and_stays() -> None:
    # Arrange: too near for a push
    where, heading, wanted = 2.2 + 1.1j, 0.3, replace(STANDING, centre=2 + 1j)
    anchor = Anchor().advanced(WALKING, WALKING, WALKING, 0.0, PERIOD)
    before, settled = abs(where - wanted.centre), None
    for tick in range(1, 100):
        # Act
        state = seen_from(anchor, where, heading)
        anchor = anchor.advanced(state, wanted, wanted, tick * PERIOD, PERIOD)

        # Assert
        assert not anchor.is_perturbed(tick * PERIOD)
        if tick * PERIOD < 1.0:
            off = abs(where - in_world(anchor, wanted.centre))
            assert off == pytest.approx((1.0 - PERIOD / 0.3) * before, abs=1e-9)
            before, settled = off, anchor
        assert anchor == settled
    assert before < 0.01
    assert anchor.yaw == pytest.approx(heading * (1.0 - (1.0 - PERIOD) ** 19), abs=1e-9)

    # and it returns once the reference goes on
    for tick in range(100, 500):
        anchor = anchor.advanced(WALKING, WALKING, WALKING, tick * PERIOD, PERIOD)
    assert abs(anchor.place) < 0.01
    assert abs(anchor.yaw) < 0.01


@pytest.mark.parametrize(
    ("wanted", "follows"),
    [
        (STANDING, True),
        (replace(STANDING, velocity=0.01j, turn=-0.01), True),
        (replace(STANDING, velocity=0.03j), False),
        (replace(STANDING, turn=-0.03), False),  # as one that turns in place
    ],
)
def test_what_moves_is_not_at_rest_whatever_the_character_does(
    wanted: PlanarState, follows: bool
) -> None:
    anchor = Anchor().advanced(WALKING, WALKING, WALKING, 0.0, PERIOD)

    anchor = anchor.advanced(
        replace(WALKING, centre=0.1 + 0j, velocity=0.5), wanted, wanted, 0.5, PERIOD
    )

    assert not anchor.is_perturbed(0.5)
    assert abs(anchor.place) == pytest.approx(0.1 * PERIOD / 0.3 if follows else 0.0)


def test_pushed_while_the_reference_stands_it_follows_and_does_not_return() -> None:
    anchor, where = Anchor(), 0.6j
    for tick in range(200):
        state = seen_from(anchor, where, 0.0)
        anchor = anchor.advanced(state, STANDING, STANDING, tick * PERIOD, PERIOD)

    assert abs(where - anchor.place) < 0.02
    assert not anchor.is_perturbed(200 * PERIOD)


def test_the_way_back_leads_to_the_clips_own_place_and_heading() -> None:
    anchor = Anchor(0.5 - 0.3j, 0.7)
    walking, away = 0j, list[complex]()
    for tick in range(400):
        walking += 1.2 * PERIOD
        at_ease = replace(WALKING, centre=walking)
        turn = complex(math.cos(anchor.yaw), math.sin(anchor.yaw))
        before = turn * walking + anchor.place
        anchor = anchor.advanced(at_ease, at_ease, at_ease, tick * PERIOD, PERIOD)
        turn = complex(math.cos(anchor.yaw), math.sin(anchor.yaw))
        away.append(turn * walking + anchor.place - walking)
        assert abs(away[-1] + walking - before) <= 0.15 * PERIOD + 1e-12

    assert abs(anchor.yaw) < 0.02
    assert abs(away[-1]) < 0.05


def test_a_balance_is_read_off_a_state() -> None:
    position, _ = random_state(5)
    root = rotations.multiply(rotations.about_z(0.4), rotations.ABOUT_X_QUARTER_TURN_XYZW)
    position[3:7] = rotations.wxyz_from_xyzw(root)
    velocity = np.zeros(HUMANOID.layout.size)
    velocity[3:6] = 0.1, 0.7, 0.2  # in the root's frame, whose y points upwards

    found = planar_state(position, velocity, np.array((1.0, 2.0, 0.9)), np.array((3.0, 4.0, 5.0)))

    assert found.centre == 1.0 + 2.0j
    assert found.velocity == 3.0 + 4.0j
    assert found.turn == pytest.approx(0.7)
    np.testing.assert_array_equal(found.root, root)


@pytest.mark.parametrize("lean", [0.0, 0.5 * math.pi, math.pi])
def test_what_flips_over_turns_the_reference_by_how_far_it_is_off_about_z(lean: float) -> None:
    # Arrange: a body on its head, or flat, has no heading; what it is off by has one
    wanted = np.array((0.0, math.sin(0.5 * lean), 0.0, math.cos(0.5 * lean)))
    leaning = np.array((math.sin(0.03), 0.0, 0.0, math.cos(0.03)))
    off = rotations.multiply(rotations.about_z(0.2), leaning)
    state = PlanarState(0.4 + 0j, 0j, rotations.multiply(off, wanted))

    # Act
    anchor = Anchor().advanced(state, replace(WALKING, root=wanted), WALKING, 0.0, PERIOD)

    # Assert
    assert anchor.yaw == pytest.approx(0.2 * PERIOD / 1.0, rel=0.02)


def test_it_returns_while_it_gives_way_too() -> None:
    """What is never calm, as a flip after the other, may not drift for good."""
    anchor = Anchor(0.5 + 0j, 0.4)
    fast = pushed(0j, velocity=0.9 + 0j)  # where the reference is, but faster
    for tick in range(100):
        anchor = anchor.advanced(fast, WALKING, WALKING, tick * PERIOD, PERIOD)

    assert anchor.is_perturbed(100 * PERIOD)
    assert abs(anchor.place) < 0.15
    assert abs(anchor.yaw) < 0.1
