"""What efforts can do, and what they do to the whole character: the engine's momentum judges."""

import json

import numpy as np
import pytest

from controller_node.actuation import describe_actuation, net_wrench
from controller_node.parameters import commanded_joints, resolve_for
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from sim_node.physics.engine import Body
from sim_node.physics.settings import WorldSettings
from tests.support.physics import (
    EVERY_CHARACTER,
    FLOATING_CHARACTERS,
    INSTANT,
    LoneWorld,
    advance,
    character,
    character_id,
    free_random_state,
    link_motions,
    momentum,
    random_state,
    without_self_collision,
)
from tests.support.ros import ControllerClient, Processes, joint_state, stamp_ns

GRAVITY = np.array([0.0, 0.0, -9.81])  # m/s^2
RATE = 240  # Hz
SUBSTEPS = 200  # so many that the engine's own error, of the order of a step, is small
CLOCK = TickClock(RATE)
NET_WRENCH = topics.NET_WRENCH.of(topics.CONTROLLER_NODE)
COUNTS = {  # motors and degrees of freedom, counted in the files
    "franka_panda": (9, 9),
    "humanoid": (28, 34),
    "kuka": (7, 7),
    "laikago": (12, 18),
    "lift": (1, 1),
    "pendulum": (1, 1),
    "turned_frames": (9, 15),
    "turned_frames_fixed": (9, 9),
    "turned_frames_fixed_y_up": (9, 9),
    "turned_frames_y_up": (9, 15),
    "free_box": (0, 6),
    "wheel": (1, 1),
    "damped": (9, 15),
}
every_character = pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
floating_characters = pytest.mark.parametrize("name", FLOATING_CHARACTERS, ids=character_id)


def actuators(whole: Character, assistance: bool) -> int:
    """How many degrees of freedom the controller commands."""
    given = {"character": whole.name, "root_assistance": assistance}
    values = resolve_for(whole, given)
    return int(whole.layout.mask(commanded_joints(whole, values)).sum())


def random_effort(whole: Character, rng: np.random.Generator, largest: float) -> FloatArray:
    return rng.uniform(-largest, largest, whole.layout.size)


def spin(body: Body, whole: Character) -> tuple[FloatArray, FloatArray]:
    """The centre of mass (3,) in m, and the angular momentum (3,) about it in N m s."""
    motions = link_motions(body, whole)
    centre = sum(motion.mass * motion.centre for motion in motions) / whole.mass
    linear, angular = momentum(body, whole)
    return np.asarray(centre), angular - np.cross(centre, linear)


# How many actuators there are


@every_character
def test_a_fixed_base_is_fully_actuated_and_a_floating_one_only_with_assistance(name: str) -> None:
    whole, (motors, size) = character(name), COUNTS[character_id(name)]

    alone, assisted = (actuators(whole, assistance) for assistance in (False, True))

    assert (alone, assisted, whole.layout.size) == (motors, size, size)
    assert describe_actuation(alone, size)["fully_actuated"] == (motors == size)
    assert describe_actuation(assisted, size)["fully_actuated"]


# What efforts do to the character as a whole


@every_character
def test_joint_torques_alone_have_no_net_wrench(name: str) -> None:
    whole = character(name)
    rng = np.random.default_rng(1)
    position, _ = random_state(whole, rng)
    effort = random_effort(whole, rng, 100.0) * whole.layout.mask(whole.layout.actuated_joint_names)

    force, torque = net_wrench(whole.layout, position, effort)

    assert force == torque == (0.0, 0.0, 0.0)


@floating_characters
def test_otherwise_it_is_the_roots_force_and_its_torque_turned_to_the_world(name: str) -> None:
    whole = character(name)
    rng = np.random.default_rng(2)
    position, _ = random_state(whole, rng)
    effort = random_effort(whole, rng, 100.0)

    force, torque = net_wrench(whole.layout, position, effort)

    axes = rotations.matrix(rotations.exp(position[3:6]))
    assert list(force) == effort[:3].tolist()
    np.testing.assert_allclose(torque, axes @ effort[3:6], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("assistance", [True, False])
@floating_characters
def test_in_any_state_it_is_what_changes_the_engines_momentum(name: str, assistance: bool) -> None:
    whole = without_self_collision(name)
    rng = np.random.default_rng(4)
    with LoneWorld(whole, WorldSettings(step_s=INSTANT)) as world:
        for _ in range(10):
            # Arrange
            free_random_state(world.body, whole, rng)
            position, _ = world.body.read()
            effort = random_effort(whole, rng, 50.0)
            effort[:6] *= assistance
            centre, _ = spin(world.body, whole)
            linear, angular = momentum(world.body, whole)
            force, torque = net_wrench(whole.layout, position, effort)

            # Act
            advance(world, effort)
            linear_after, angular_after = momentum(world.body, whole)

            # Assert: about the base link's origin, where it was
            origin, weight = position[:3], whole.mass * GRAVITY
            about_world = torque + np.cross(origin, force) + np.cross(centre, weight)
            np.testing.assert_allclose(
                (linear_after - linear) / INSTANT, weight + force, rtol=0.0, atol=0.05
            )
            np.testing.assert_allclose(
                (angular_after - angular) / INSTANT, about_world, rtol=0.0, atol=0.05
            )


# On the topic


@pytest.mark.parametrize("assistance", [True, False])
def test_the_controller_publishes_it_with_the_stamp_of_the_state_that_it_answers(
    processes: Processes, simulator: ControllerClient, assistance: bool
) -> None:
    # Arrange
    whole = character("humanoid")
    wrenches = simulator.listen(NET_WRENCH)
    processes.controller("humanoid", root_assistance=assistance)
    rng = np.random.default_rng(5)
    for tick in (1, 2):
        position = whole.rest_position + rng.uniform(-0.3, 0.3, whole.layout.size)
        velocity = rng.uniform(-0.5, 0.5, whole.layout.size)
        effort = () if tick == 1 else np.zeros(whole.layout.size).tolist()
        stamp, names = CLOCK.stamp_ns(tick), whole.layout.dof_names
        state = joint_state(stamp, names, position.tolist(), velocity.tolist(), effort)

        # Act
        torques = simulator.ask(state)
        simulator.send(state, lambda stamp=stamp: stamp in map(stamp_ns, wrenches.messages))

        # Assert
        published = wrenches.last
        efforts = dict(zip(torques.name, torques.effort, strict=True))
        root = np.array([efforts.get(f"root_{axis}", 0.0) for axis in ("x", "y", "z")])
        turning = np.array([efforts.get(f"root_r{axis}", 0.0) for axis in ("x", "y", "z")])
        in_world = rotations.matrix(rotations.exp(position[3:6])) @ turning
        force, torque = published.wrench.force, published.wrench.torque
        assert stamp_ns(published) == stamp
        assert published.header.frame_id == "world"
        assert [force.x, force.y, force.z] == root.tolist()
        np.testing.assert_allclose([torque.x, torque.y, torque.z], in_world, rtol=0.0, atol=1e-9)
        assert np.all(root != 0.0) if assistance else not root.any()
        assert np.all(np.abs(in_world) > 1e-6) if assistance else not in_world.any()


@pytest.mark.parametrize(
    ("name", "assistance", "expected"),
    [("humanoid", False, (28, 34)), ("pendulum", True, (1, 1))],
)
def test_the_controller_says_in_its_configuration_how_it_is_actuated(
    processes: Processes,
    simulator: ControllerClient,
    name: str,
    assistance: bool,
    expected: tuple[int, int],
) -> None:
    actuators, size = expected
    processes.controller(name, root_assistance=assistance)

    simulator.spin_until(lambda: simulator.configuration.messages, "configuration")

    content = json.loads(simulator.configuration.last.data)
    assert content["actuation"] == {
        "actuators": actuators,
        "degrees_of_freedom": size,
        "fully_actuated": actuators == size,
    }
