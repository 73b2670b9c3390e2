"""What the simulator's numbers mean: the frames of states and efforts, and nothing added to them.

The oracles are conservation laws and Newton's, on the numbers that the engine has of every link.
"""

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from sim_node.physics.bullet.client import pybullet
from sim_node.physics.settings import WorldSettings
from tests.support.physics import (
    EVERY_CHARACTER,
    FLOATING_CHARACTERS,
    FLOATING_TURNED_FRAMES,
    INSTANT,
    LoneWorld,
    acceleration,
    advance,
    character,
    character_id,
    free_random_state,
    kinetic_energy,
    link_motions,
    link_number,
    link_poses,
    momentum,
    random_state,
    still_world,
    without_self_collision,
)

every_character = pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
floating_characters = pytest.mark.parametrize("name", FLOATING_CHARACTERS, ids=character_id)

BALL_JOINTS = [
    ("humanoid", "chest"),
    ("humanoid", "left_ankle"),
    (FLOATING_TURNED_FRAMES, "shoulder"),
    (FLOATING_TURNED_FRAMES, "wrist"),
]
ball_joints = pytest.mark.parametrize(
    ("name", "joint"), BALL_JOINTS, ids=[joint for _, joint in BALL_JOINTS]
)


def child_and_parent(whole: Character, joint: str) -> tuple[int, int]:
    """Index of the link that a joint moves, and of the link that it moves against."""
    child = next(i for i, link in enumerate(whole.links) if link.joint.name == joint)
    return child, whole.links[child].parent


# --- states --------------------------------------------------------------------------------------


@every_character
def test_a_state_is_read_back_as_it_was_set(name: str) -> None:
    whole = without_self_collision(name)
    rng = np.random.default_rng(1)
    with still_world(whole) as world:
        for _ in range(50):
            position, velocity = random_state(whole, rng)

            world.body.set_state(position, velocity)

            read_position, read_velocity = world.body.read()
            np.testing.assert_allclose(read_position, position, rtol=0.0, atol=1e-12)
            np.testing.assert_allclose(read_velocity, velocity, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, np.pi - 1e-9])
@floating_characters
def test_very_small_and_very_large_rotations_are_read_back_as_they_were_set(
    name: str, angle: float
) -> None:
    whole = without_self_collision(name)
    position = np.zeros(whole.layout.size)
    position[whole.layout.rotation_entries] = angle * np.array([0.48, -0.6, 0.64])
    with still_world(whole) as world:
        world.body.set_state(position, np.zeros_like(position))
        read_position, _ = world.body.read()

    np.testing.assert_allclose(read_position, position, rtol=0.0, atol=1e-12)


@every_character
def test_setting_a_state_leaves_nothing_of_the_state_before(name: str) -> None:
    whole = without_self_collision(name)
    rng = np.random.default_rng(2)
    with still_world(whole) as world:
        position, velocity = free_random_state(world.body, whole, rng)
        fresh = acceleration(world, np.zeros_like(position))

        for _ in range(5):
            free_random_state(world.body, whole, rng)
            advance(world, rng.uniform(-20.0, 20.0, len(position)))
        world.body.set_state(position, velocity)

        np.testing.assert_array_equal(acceleration(world, np.zeros_like(position)), fresh)


@floating_characters
def test_the_root_is_at_the_base_links_origin_and_turns_in_the_base_frame(name: str) -> None:
    whole = without_self_collision(name)
    rng = np.random.default_rng(3)
    with still_world(whole) as world:
        for _ in range(20):
            position, velocity = random_state(whole, rng)
            world.body.set_state(position, velocity)

            origins, turns = link_poses(world.body, whole)
            base = link_motions(world.body, whole)[0]

            axes = rotations.matrix(turns[0])
            arm = origins[0] - base.centre
            origin_velocity = base.velocity + np.cross(base.angular_velocity, arm)
            np.testing.assert_allclose(position[:3], origins[0], atol=1e-12)
            np.testing.assert_allclose(
                axes, rotations.matrix(rotations.exp(position[3:6])), atol=1e-12
            )
            np.testing.assert_allclose(velocity[:3], origin_velocity, atol=1e-12)
            np.testing.assert_allclose(velocity[3:6], axes.T @ base.angular_velocity, atol=1e-12)


@ball_joints
def test_a_ball_joints_velocity_is_the_childs_against_the_parent_in_the_child_frame(
    name: str, joint: str
) -> None:
    whole = without_self_collision(name)
    position, velocity = random_state(whole, np.random.default_rng(4))
    child, parent = child_and_parent(whole, joint)
    with still_world(whole) as world:
        world.body.set_state(position, velocity)
        motions, (_, turns) = link_motions(world.body, whole), link_poses(world.body, whole)

    relative = motions[child].angular_velocity - motions[parent].angular_velocity
    in_child = rotations.matrix(turns[child]).T @ relative
    np.testing.assert_allclose(velocity[whole.layout.joint(joint).entries], in_child, atol=1e-12)


@every_character
def test_a_velocity_is_the_rate_of_change_of_its_position(name: str) -> None:
    whole = without_self_collision(name)
    with still_world(whole) as world:
        position, velocity = free_random_state(world.body, whole, np.random.default_rng(5))

        advance(world, np.zeros_like(position))
        next_position, _ = world.body.read()

    layout = whole.layout
    moved = layout.difference(layout.configuration(position), layout.configuration(next_position))
    np.testing.assert_allclose(moved / INSTANT, velocity, rtol=0.0, atol=1e-4)


def test_a_y_up_humanoid_stands_upright_in_the_z_up_world_and_faces_x() -> None:
    whole = character("humanoid")
    rest = np.array(whole.rest_position)
    with still_world(whole) as world:
        world.body.set_state(rest, np.zeros_like(rest))
        origins, _ = link_poses(world.body, whole)
        place = {link.joint.name: origin for link, origin in zip(whole.links, origins, strict=True)}
        foot = link_number(world.body, whole, "right_ankle")
        lowest, highest = np.array(
            pybullet.getAABB(world.body._body, foot, physicsClientId=world.body._client)
        )

    heights = [place[joint][2] for joint in ("right_ankle", "right_knee", "right_hip", "root")]
    assert heights == sorted(heights)
    assert place["root"][2] == pytest.approx(0.9, abs=0.05)
    assert place["root"][2] < place["chest"][2] < place["neck"][2] < 1.6
    assert place["left_hip"][1] > 0.05 > -0.05 > place["right_hip"][1]  # left is y where x is ahead
    assert abs(lowest[2]) < 0.005  # the sole is on the ground
    assert highest[0] - place["right_ankle"][0] > place["right_ankle"][0] - lowest[0]  # toes ahead


def test_a_y_up_fixed_base_stands_upright_in_the_z_up_world() -> None:
    upright, turned = (
        character(FLOATING_TURNED_FRAMES.replace(".yaml", suffix))
        for suffix in ("_fixed.yaml", "_fixed_y_up.yaml")
    )
    origins = {}
    for whole in (upright, turned):
        with still_world(whole) as world:
            world.body.set_state(np.zeros(whole.layout.size), np.zeros(whole.layout.size))
            origins[whole.name] = link_poses(world.body, whole)[0]

    x, y, z = origins[upright.name].T
    np.testing.assert_allclose(origins[turned.name], np.stack([x, -z, y], axis=1), atol=1e-12)


# --- efforts -------------------------------------------------------------------------------------


@floating_characters
def test_an_effort_inside_the_character_changes_no_momentum(name: str) -> None:
    whole = without_self_collision(name)
    rng = np.random.default_rng(6)
    with still_world(whole) as world:
        for joint in whole.layout.joints[1:]:
            position, _ = free_random_state(world.body, whole, rng)
            world.body.set_state(position, np.zeros_like(position))
            effort = np.zeros_like(position)
            effort[joint.entries] = rng.uniform(20.0, 50.0, len(joint.dof_names))

            advance(world, effort)

            impulse = np.linalg.norm(effort) * INSTANT
            linear, angular = momentum(world.body, whole)
            assert kinetic_energy(world.body, whole) > 0.0
            assert np.abs(linear).max() < 1e-6 * impulse, joint.name
            assert np.abs(angular).max() < 1e-6 * impulse, joint.name


@floating_characters
def test_root_force_is_the_worlds_at_the_base_links_origin_and_root_torque_the_base_frames(
    name: str,
) -> None:
    whole = without_self_collision(name)
    rng = np.random.default_rng(7)
    with still_world(whole) as world:
        for part in (slice(0, 3), slice(3, 6)):
            position, _ = free_random_state(world.body, whole, rng)
            world.body.set_state(position, np.zeros_like(position))
            effort = np.zeros_like(position)
            effort[part] = rng.uniform(20.0, 50.0, 3)

            advance(world, effort)
            linear, angular = momentum(world.body, whole)

            force, torque = effort[:3], rotations.matrix(rotations.exp(position[3:6])) @ effort[3:6]
            moment = np.cross(position[:3], force) + torque
            np.testing.assert_allclose(linear / INSTANT, force, rtol=1e-6, atol=1e-6)
            np.testing.assert_allclose(angular / INSTANT, moment, rtol=1e-6, atol=1e-5)


@ball_joints
def test_a_ball_joints_torque_is_that_on_the_child_in_the_child_frame(
    name: str, joint: str
) -> None:
    whole = without_self_collision(name)
    rng = np.random.default_rng(9)
    child, parent = child_and_parent(whole, joint)
    with still_world(whole) as world:
        position, velocity = free_random_state(world.body, whole, rng)
        effort = np.zeros_like(position)
        effort[whole.layout.joint(joint).entries] = rng.uniform(20.0, 50.0, 3)
        turn = link_poses(world.body, whole)[1][child]
        torque = rotations.matrix(turn) @ effort[whole.layout.joint(joint).entries]

        by_joint = acceleration(world, effort)
        world.body.set_state(position, velocity)
        apply_torque_in_world(world, whole, child, torque)
        apply_torque_in_world(world, whole, parent, -torque)
        by_torques = acceleration(world, np.zeros_like(position))

    assert np.abs(by_joint - by_torques).max() < 1e-7 * np.abs(by_joint).max()


def apply_torque_in_world(
    world: LoneWorld, whole: Character, link: int, torque: FloatArray
) -> None:
    joint = whole.links[link].joint
    floating = joint.type is JointType.FLOATING
    pybullet.applyExternalTorque(
        world.body._body,
        -1 if floating else link_number(world.body, whole, joint.name),
        torque,
        pybullet.WORLD_FRAME,
        physicsClientId=world.body._client,
    )


@every_character
def test_effort_times_velocity_is_the_rate_of_change_of_kinetic_energy(name: str) -> None:
    whole = without_self_collision(name)
    rng = np.random.default_rng(10)
    with still_world(whole) as world:
        for index in range(whole.layout.size):
            position, velocity = free_random_state(world.body, whole, rng)
            effort = np.zeros_like(position)
            effort[index] = 5.0

            energies = []
            for direction in (1.0, -1.0):  # what the motion alone does is the same in both
                world.body.set_state(position, velocity)
                advance(world, direction * effort)
                energies.append(kinetic_energy(world.body, whole))

            rate = (energies[0] - energies[1]) / (2.0 * INSTANT)
            power = effort @ velocity
            assert rate == pytest.approx(power, abs=1e-3), whole.layout.dof_names[index]


@every_character
def test_an_effort_lasts_one_step(name: str) -> None:
    whole = without_self_collision(name)
    with still_world(whole) as world:
        position, _ = free_random_state(world.body, whole, np.random.default_rng(11))
        world.body.set_state(position, np.zeros_like(position))
        advance(world, np.full(whole.layout.size, 5.0))
        _, pushed = world.body.read()

        world.step()
        _, coasting = world.body.read()

    assert np.abs(coasting - pushed).max() < 1e-4 * np.abs(pushed).max()


# --- nothing added -------------------------------------------------------------------------------


def test_a_pendulum_keeps_its_energy() -> None:
    # 1 kg, 1 m, from rest at 1.5 rad
    step, seconds_a_window = 1e-3, 2.0
    energies = []
    with LoneWorld(character("pendulum"), WorldSettings(step_s=step)) as world:
        world.body.set_state(np.array([1.5]), np.zeros(1))

        for _ in range(10_000):
            (angle,), (speed,) = world.body.read()
            energies.append(speed**2 / 6.0 - 0.5 * 9.81 * np.cos(angle))
            advance(world, np.zeros(1))

    # the integrator lets it swing about the true one, by the first order of the step
    window = int(seconds_a_window / step)
    assert max(energies[-window:]) == pytest.approx(max(energies[:window]), abs=1e-6)
    assert min(energies[-window:]) == pytest.approx(min(energies[:window]), abs=1e-6)


@floating_characters
def test_a_character_in_free_fall_keeps_its_pose(name: str) -> None:
    whole = without_self_collision(name)
    step, steps = 1e-3, 1000
    start = np.array(whole.rest_position)
    start[2] = 100.0
    with LoneWorld(whole, WorldSettings(step_s=step)) as world:
        world.body.set_state(start, np.zeros_like(start))

        advance(world, np.zeros_like(start), steps)
        position, velocity = world.body.read()

    expected_velocity, expected_position = np.zeros_like(start), start.copy()
    expected_velocity[2] = -9.81 * steps * step
    expected_position[2] -= 9.81 * step**2 * steps * (steps + 1) / 2.0
    np.testing.assert_allclose(velocity, expected_velocity, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(position, expected_position, rtol=0.0, atol=1e-9)


@floating_characters
def test_joints_turn_without_friction(name: str) -> None:
    # slow enough that no hinge comes to its limit
    whole = without_self_collision(name)
    rng = np.random.default_rng(12)
    bounds = np.nan_to_num(np.array(whole.position_bounds()), posinf=0.0, neginf=0.0)
    middle = bounds.mean(axis=0)
    middle[2] = 3.0
    with still_world(whole, step_s=5e-4) as world:
        world.body.set_state(middle, rng.uniform(-0.5, 0.5, whole.layout.size))
        energy, (linear, angular) = kinetic_energy(world.body, whole), momentum(world.body, whole)

        advance(world, np.zeros(whole.layout.size), 2000)
        last_linear, last_angular = momentum(world.body, whole)

        assert kinetic_energy(world.body, whole) == pytest.approx(energy, rel=2e-3)
        np.testing.assert_allclose(last_linear, linear, rtol=0.0, atol=1e-3)
        np.testing.assert_allclose(last_angular, angular, rtol=0.0, atol=5e-3)


@pytest.mark.parametrize("name", ["lift", "pendulum", *FLOATING_CHARACTERS], ids=character_id)
def test_a_joint_and_a_base_move_on_at_their_speed_forever(name: str) -> None:
    # faster than 100, where the engine clamps speeds if it is not told otherwise
    whole = without_self_collision(name)
    velocity = np.zeros(whole.layout.size)
    velocity[:3] = [300.0, -200.0, 400.0] if whole.layout.has_floating_base else 400.0
    with still_world(whole, step_s=1e-3) as world:
        world.body.set_state(np.array(whole.rest_position), velocity)

        advance(world, np.zeros_like(velocity), 500)
        _, last_velocity = world.body.read()

    np.testing.assert_allclose(last_velocity, velocity, rtol=0.0, atol=1e-9)
