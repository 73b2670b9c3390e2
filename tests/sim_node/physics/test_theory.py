"""What each engine makes of motions that theory knows: flight, a swing, rest, and a slope."""

from pathlib import Path

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.geometry import rotations
from sim_node.physics.engine import make_world
from sim_node.physics.settings import WorldSettings
from tests.support.physics import (
    LoneWorld,
    advance,
    box_character,
    character,
    kinetic_energy,
    momentum,
)

pytestmark = pytest.mark.usefixtures("engine")

GRAVITY, STEP = 9.81, 1.0 / 240.0
FREE_BOX = str(Path(__file__).parents[2] / "data" / "free_box.yaml")
SLOPE = 0.2  # rad


@pytest.fixture
def box(tmp_path: Path) -> Character:
    """A flat box of 2 kg, 0.2 m high."""
    return box_character(tmp_path, "0.4 0.4 0.2")


def write_slope(folder: Path) -> UrdfOptions:
    """A plane through the origin that goes down along x."""
    file = folder / "slope.urdf"
    below = -0.5 / np.cos(SLOPE)
    file.write_text(
        '<robot name="slope"><link name="slope"><collision>'
        f'<origin xyz="0 0 {below}" rpy="0 {SLOPE} 0"/>'
        '<geometry><box size="40 40 1"/></geometry></collision></link></robot>'
    )
    return UrdfOptions(file, file.read_text(), fixed_base=True)


def test_a_body_in_free_flight_keeps_its_momentum_and_nearly_its_energy() -> None:
    # it tumbles about all axes; to first order in the step its energy is not quite kept
    whole = character(FREE_BOX)
    velocity = np.array([1.0, -2.0, 3.0, 3.0, 0.5, -2.0])
    with LoneWorld(whole, WorldSettings(gravity=0.0, ground=False)) as world:
        world.body.set_state(np.zeros(6), velocity)
        before, energy = momentum(world.body, whole), kinetic_energy(world.body, whole)
        advance(world, np.zeros(6), 240)
        after = momentum(world.body, whole)

        np.testing.assert_allclose(after[0], before[0], rtol=1e-12)
        np.testing.assert_allclose(after[1], before[1], rtol=0.02)
        assert kinetic_energy(world.body, whole) == pytest.approx(energy, rel=0.02)


def swing(whole: Character, start: float, seconds: float) -> tuple[float, float]:
    """Angle and speed of a pendulum that is let go, by Runge and Kutta's method in tiny steps."""
    link = whole.links[-1]
    arm = np.array(link.inertial_pose.position)
    axis = np.array(link.joint.axis_in_child)
    across = arm - axis * (arm @ axis)
    inertia = axis @ link.inertia_in_link_axes() @ axis + link.mass * across @ across
    rate = link.mass * GRAVITY * np.linalg.norm(across) / inertia

    def slope(state: FloatArray) -> FloatArray:
        return np.array([state[1], -rate * np.sin(state[0])])

    state, step = np.array([start, 0.0]), 1e-3
    for _ in range(round(seconds / step)):
        one = slope(state)
        two = slope(state + 0.5 * step * one)
        three = slope(state + 0.5 * step * two)
        four = slope(state + step * three)
        state = state + step / 6.0 * (one + 2.0 * two + 2.0 * three + four)
    return float(state[0]), float(state[1])


def test_a_pendulum_swings_as_its_equation_says(tmp_path: Path) -> None:
    rod = '<inertial><origin xyz="0 0 -0.5"/><mass value="1"/><inertia ixx="0.08" iyy="0.08" '
    rod += 'izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>'
    (tmp_path / "swing.urdf").write_text(
        f'<robot name="swing"><link name="world"/><link name="rod">{rod}</link>'
        '<joint name="hinge" type="continuous"><parent link="world"/><child link="rod"/>'
        '<axis xyz="0 1 0"/></joint></robot>'
    )
    (tmp_path / "swing.yaml").write_text("urdf: swing.urdf\nfixed_base: true\ninertia: file\n")
    whole = character(str(tmp_path / "swing.yaml"))
    with LoneWorld(whole, WorldSettings(step_s=1e-3, gravity=GRAVITY, ground=False)) as world:
        world.body.set_state(np.array([1.0]), np.zeros(1))
        advance(world, np.zeros(1), 3000)
        (angle,), (speed,) = world.body.read()

    assert (angle, speed) == pytest.approx(swing(whole, 1.0, 3.0), abs=5e-3)


def test_a_stack_of_boxes_stays_where_it_is(box: Character) -> None:
    with make_world(WorldSettings()) as world:
        bodies = [world.add(box) for _ in range(3)]
        for number, body in enumerate(bodies):
            height = 0.1 + 0.2 * number
            body.set_state(np.array([0.0, 0.0, height, 0.0, 0.0, 0.0]), np.zeros(6))
        for _ in range(480):
            for body in bodies:
                body.apply(np.zeros(6))
            world.step()
        forces = [body.contact_wrenches()[0][0, 2] for body in bodies]
        heights = [float(body.read()[0][2]) for body in bodies]
        speeds = [float(np.abs(body.read()[1]).max()) for body in bodies]

    np.testing.assert_allclose(heights, [0.1, 0.3, 0.5], atol=3e-3)
    np.testing.assert_allclose(forces, 3 * [2.0 * GRAVITY], atol=0.2)
    assert max(speeds) < 0.02


@pytest.mark.parametrize("friction", [0.1, 0.6])
def test_on_a_slope_a_box_slides_or_stays_by_its_friction(
    tmp_path: Path, box: Character, friction: float
) -> None:
    settings = WorldSettings(
        step_s=1e-3,
        ground=False,
        terrain=write_slope(tmp_path),
        friction=friction,
        link_friction=1.0,
    )
    turn = np.array([0.0, SLOPE, 0.0])
    axes = rotations.matrix(rotations.exp(turn))
    with LoneWorld(box, settings) as world:
        world.body.set_state(np.concatenate((axes @ (0.0, 0.0, 0.1), turn)), np.zeros(6))
        advance(world, np.zeros(6), 1000)
        position, velocity = world.body.read()
        beside = position[:3] + np.array([0.0, 2.0, 5.0])
        below = world.heights_below(beside[np.newaxis])[0]

    slides = max(GRAVITY * (np.sin(SLOPE) - friction * np.cos(SLOPE)), 0.0)
    assert axes[:, 0] @ velocity[:3] == pytest.approx(slides, abs=0.02)
    # the surface that a ray from above meets is the slope
    assert below == pytest.approx(-np.tan(SLOPE) * position[0], abs=1e-3)


def test_what_slides_stays_on_the_ground(box: Character) -> None:
    with LoneWorld(box, WorldSettings(friction=0.5, link_friction=1.0)) as world:
        world.body.set_state(np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0]), np.zeros(6))
        advance(world, np.zeros(6), 120)
        start, _ = world.body.read()
        world.body.set_state(start, np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
        heights = []
        for _ in range(60):
            advance(world, np.zeros(6))
            heights.append(world.body.read()[0][2])

    assert max(heights) < 0.1 + 1e-3
    assert min(heights) > 0.1 - 3e-3


@pytest.mark.parametrize("speed", [0.5, 2.0])
def test_a_sole_that_bears_a_load_stops_where_friction_says(box: Character, speed: float) -> None:
    """As a foot does that lands: it is light, and what presses is heavy."""
    friction, load = 0.5, np.array([0.0, 0.0, -450.0, 0.0, 0.0, 0.0])
    with LoneWorld(box, WorldSettings(friction=friction, link_friction=1.0)) as world:
        world.body.set_state(np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0]), np.zeros(6))
        advance(world, load, 120)
        start, _ = world.body.read()
        world.body.set_state(start, np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0]))
        advance(world, load, 60)
        end, _ = world.body.read()

    slowing = friction * (GRAVITY + 450.0 / 2.0)  # m/s^2
    within_a_step = speed * STEP
    assert end[0] - start[0] == pytest.approx(speed**2 / (2.0 * slowing), abs=within_a_step)
