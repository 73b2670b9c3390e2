"""Drags and throws against mechanics: a spring's force, its sum over pushes, and a parabola."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from actuated_characters.viewer.controls.touch import (
    LIMIT,
    POURED,
    Drag,
    aim_throw,
    pour_balls,
    spring_force,
)
from msgs_config.errors import CommandError

GRAVITY = 9.81
ORIGIN = np.zeros(3)


def test_a_spring_pulls_towards_the_pointer_with_its_stiffness() -> None:
    force = spring_force(400.0, np.array((1.0, 0.0, 0.5)), np.array((1.0, 0.25, 0.5)))

    assert force.tolist() == [0.0, 100.0, 0.0]


def test_balls_that_are_poured_are_above_the_root_and_do_not_touch() -> None:
    root = np.array((3.0, -2.0, 0.9))

    throws = pour_balls(root, 2.0)
    centres = np.array([throw.position for throw in throws])
    apart = np.linalg.norm(centres[:, np.newaxis] - centres, axis=2)[np.triu_indices(POURED, 1)]

    assert len(throws) == POURED
    assert apart.min() > 2.0 * throws[0].radius
    assert centres[:, 2].min() > root[2] + 1.0
    assert centres[:, :2].mean(axis=0) == pytest.approx(root[:2])


def test_a_spring_never_pulls_harder_than_the_limit() -> None:
    force = spring_force(400.0, ORIGIN, np.array((300.0, 400.0, 0.0)))

    assert np.linalg.norm(force) == pytest.approx(LIMIT)
    assert force / LIMIT == pytest.approx([0.6, 0.8, 0.0])


@given(st.integers(1, 100), st.integers(1, 60))
def test_the_pushes_of_a_drag_have_the_impulse_of_a_constant_force(
    ticks_a_picture: int, ticks_a_push: int
) -> None:
    """At 240 Hz: each push holds for so many ticks, and one is sent with every picture."""
    drag = Drag("", 0, ORIGIN, ORIGIN)
    period = 10**9 // 240
    count = 40
    total = sum(
        drag.share((1 + picture * ticks_a_picture) * period, 1e-9 * ticks_a_push * period)
        for picture in range(count)
    )

    lasting = total * ticks_a_push  # ticks of the whole force
    expected = (count - 1) * min(ticks_a_picture, ticks_a_push)
    assert lasting == pytest.approx(expected)


def test_a_drag_sends_nothing_while_time_stands_still_or_has_begun_again() -> None:
    drag = Drag("", 0, ORIGIN, ORIGIN)

    shares = [drag.share(stamp, 0.1) for stamp in (10**9, 10**9, 2 * 10**9, 10**6, 2 * 10**6)]

    assert shares == pytest.approx([0.0, 0.0, 1.0, 0.0, 0.01])


@pytest.mark.parametrize("speed", [2.0, 8.0, 30.0])
@pytest.mark.parametrize("eye", [(3.0, -3.0, 1.5), (0.0, -8.0, 0.3), (0.1, 0.0, 9.0)])
def test_a_ball_flies_through_the_point_that_was_clicked_on(
    speed: float, eye: tuple[float, float, float]
) -> None:
    target = np.array((0.2, 0.1, 0.9))
    origin = np.array(eye)
    along = (target - origin) / np.linalg.norm(target - origin)

    throw = aim_throw(origin, along, target, mass=2.0, speed=speed, gravity=GRAVITY)

    start, velocity = np.array(throw.position), np.array(throw.velocity)
    seconds = np.linalg.norm(target - start) / speed
    there = start + velocity * seconds - (0.0, 0.0, 0.5 * GRAVITY * seconds**2)
    assert there == pytest.approx(target)
    assert throw.position[2] > throw.radius
    assert np.linalg.norm(target - start) == pytest.approx(2.0, abs=1e-9)


def test_a_ball_begins_above_the_ground_even_if_the_camera_is_below() -> None:
    origin, along = np.array((0.0, -5.0, -5.0)), np.array((0.0, 1.0, 1.0)) / np.sqrt(2.0)

    throw = aim_throw(origin, along, np.array((0.0, 0.5, 0.5)), mass=1.0, speed=5.0, gravity=0.0)

    assert throw.position[2] > throw.radius


def test_a_ball_that_cannot_be_is_one_clear_line() -> None:
    with pytest.raises(CommandError, match="speed"):
        aim_throw(ORIGIN, np.array((1.0, 0.0, 0.0)), np.array((5.0, 0.0, 1.0)),
                  mass=1.0, speed=1e4, gravity=0.0)  # fmt: skip
