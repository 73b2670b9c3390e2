"""Boxes that are thrown into a world, or slid over its ground: mechanics is the oracle."""

from pathlib import Path

import numpy as np
import pytest

from actuated_characters.runs.plan import make_plan
from msgs_config.arrays import FloatArray
from msgs_config.errors import CommandError
from msgs_config.geometry import rotations
from msgs_config.messages.projectiles import ThrowCodec
from msgs_config.messages.throw import BOX_NUMBERS, ProjectileThrow, parse_throw
from tests.sim_node.physics.test_throws import (
    FAR,
    FREE_BOX,
    RATE,
    WEIGHTLESS,
    fresh,
    in_bytes,
    walked,
)
from tests.support.physics import box_character, momentum, simulation

pytestmark = pytest.mark.usefixtures("engine")

EDGES = (0.4, 0.3, 0.2)
FRICTION = 0.9 * 0.5
AT_FEET = ProjectileThrow(12.0, None, (1.2, 0.0, 0.1), (-5.0, 0.0, 0.0), EDGES, 0.2)


def box_momentum(throw: ProjectileThrow, motion: FloatArray) -> FloatArray:
    """Linear (N s) and angular momentum (N m s, about the world's origin) of a solid box: (6,)."""
    assert throw.size is not None
    x, y, z = np.square(throw.size)
    inertia = throw.mass / 12.0 * np.array((y + z, x + z, x + y))
    linear = throw.mass * motion[7:10]
    own = rotations.rotate(rotations.conjugate(motion[3:7]), motion[10:])
    turning = rotations.rotate(motion[3:7], inertia * own)
    return np.concatenate((linear, np.cross(motion[:3], linear) + turning))


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_a_box_slides_as_far_as_friction_lets_it_and_stays_as_it_is_turned(yaw: float) -> None:
    way = np.array((np.cos(yaw), np.sin(yaw), 0.0))
    vx, vy, _ = (3.0 * way).tolist()
    throw = ProjectileThrow(8.0, None, (5.0, 0.0, 0.1), (vx, vy, 0.0), EDGES, yaw)

    with simulation(FREE_BOX, solver_iterations=50, link_friction=0.5) as run:
        run.step([np.zeros(6)], None, [throw])
        for _ in range(2 * RATE):
            run.step([np.zeros(6)])
        (motion,) = run.ball_motion()

    slack = 0.02 if yaw == 0.0 else 0.1  # Bullet's friction is not the same to all sides
    went = motion[:3] - throw.position
    assert went @ way == pytest.approx(3.0**2 / (2.0 * FRICTION * 9.81), rel=slack)
    assert abs(np.cross(way, went)[2]) < slack and abs(went[2]) < 2e-3
    assert np.linalg.norm(motion[7:]) < 1e-2
    assert rotations.angle_between(motion[3:7], rotations.about_z(yaw)) < slack


def test_momentum_is_conserved_through_an_impact_of_a_box(tmp_path: Path) -> None:
    throw = ProjectileThrow(0.5, None, (1.0, 0.16, 0.02), (-3.0, 0.0, 0.0), (0.2, 0.1, 0.1), 0.4)
    before = box_momentum(
        throw,
        np.array((*throw.position, *throw.turn_xyzw, *throw.velocity, 0.0, 0.0, 0.0)),
    )

    with simulation(str(box_character(tmp_path, "0.2 0.3 0.2").file), **WEIGHTLESS) as run:
        run.step([np.zeros(6)], None, [throw])
        for _ in range(RATE):
            run.step([np.zeros(6)])
        (motion,) = run.ball_motion()
        (simulated,) = run.characters
        total = np.concatenate(momentum(simulated._body, simulated.character))

    assert np.linalg.norm(motion[7:10] - throw.velocity) > 0.5  # it has hit
    assert np.linalg.norm(motion[10:]) > 0.5  # and turns
    np.testing.assert_allclose(total + box_momentum(throw, motion), before, atol=2e-3)


def test_a_saved_state_with_boxes_is_restored_to_the_bit() -> None:
    throws = {10: [AT_FEET], 30: [FAR]}
    walk = make_plan("humanoid", 1.0, {"reference": "clip", "clip": "walk"}, {}, {})

    with fresh(walk) as run:
        walked(walk, run, 50, throws)
        saved = run.snapshot()
        expected = in_bytes(walked(walk, run, 80)[0])
        run.load_snapshot(saved)
        again = in_bytes(walked(walk, run, 80)[0])
    with fresh(walk) as other:
        walked(walk, other, 20, {2: [FAR]})
        other.load_snapshot(saved)
        there = in_bytes(walked(walk, other, 80)[0])

    assert expected == again == there


# What a message says


def test_a_box_comes_back_from_its_message() -> None:
    codec = ThrowCodec("/session")

    assert codec.decode(codec.encode(7, AT_FEET)) == (7, AT_FEET)
    assert codec.decode(codec.encode(8, FAR)) == (8, FAR)
    straight = [name for name in BOX_NUMBERS if name != "yaw"]
    assert parse_throw(straight, AT_FEET.numbers()[:-1].tolist()).yaw == 0.0


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"radius": 0.1}, "unknown number 'radius'"),
        ({"size_x": 0.0}, "size_x is 0; it must be 0.01 to 10"),
        ({"yaw": float("nan")}, "yaw is nan; it must be finite"),
        ({"size_y": None}, "'size_y' is missing; there must be mass, size_x"),
    ],
)
def test_what_is_no_box_is_refused_in_a_line(
    changed: dict[str, float | None], sentence: str
) -> None:
    numbers = dict(zip(BOX_NUMBERS, AT_FEET.numbers().tolist(), strict=True)) | changed
    given = {name: value for name, value in numbers.items() if value is not None}

    with pytest.raises(CommandError, match=sentence) as caught:
        parse_throw(list(given), list(given.values()))

    assert "\n" not in str(caught.value)
