"""Links in the engine: where they are, what a push does to them, and what touches them.

The oracles are MuJoCo's kinematics and Jacobians, and Newton's laws.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from sim_node.physics.engine import Body, make_world
from sim_node.physics.mujoco.body import MujocoBody
from sim_node.physics.settings import WorldSettings
from tests.support.engines import pybullet
from tests.support.physics import (
    EVERY_CHARACTER,
    INSTANT,
    TURNED_FRAMES,
    LoneWorld,
    advance,
    box_character,
    character,
    character_id,
    free_random_state,
    momentum,
    simulation,
    still_world,
    without_self_collision,
)

pytestmark = pytest.mark.usefixtures("engine")

ROUNDING = 1e-11
"""Of poses of order one, which need no difference quotient."""

NOISE = 1e-8
"""Of accelerations: the rounding of speeds of order one, over an instant."""

PUSHED = ["humanoid", "franka_panda", *TURNED_FRAMES]

every_character = pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
pushed_characters = pytest.mark.parametrize("name", PUSHED, ids=character_id)


# --- frames --------------------------------------------------------------------------------------


def frames_differ(world: LoneWorld, whole: Character, model: DynamicsModel) -> tuple[float, float]:
    """By how much, m and rad, link frames at the present state are not where MuJoCo has them."""
    position, velocity = world.body.read()
    model.update(position, velocity)
    expected_origins, expected_turns = model.link_poses()
    origins, turns = world.body.link_frames()
    far = np.abs(origins - expected_origins).max()
    return float(far), float(np.max(rotations.angle_between(turns, expected_turns)))


@every_character
def test_link_frames_are_where_mujoco_has_them(name: str) -> None:
    whole = without_self_collision(name)
    model, rng = DynamicsModel(whole), np.random.default_rng(1)
    with still_world(whole) as world:
        for _ in range(30):
            free_random_state(world.body, whole, rng)

            far, turned = frames_differ(world, whole, model)

            assert far < ROUNDING
            assert turned < ROUNDING


@every_character
def test_link_frames_are_those_of_the_state_after_a_step_too(name: str) -> None:
    # from a random state to the ground
    whole = without_self_collision(name)
    model, rng = DynamicsModel(whole), np.random.default_rng(2)
    with LoneWorld(whole, WorldSettings()) as world:
        free_random_state(world.body, whole, rng)
        for _ in range(240):
            advance(world, rng.uniform(-0.5, 0.5, whole.layout.size))

            far, turned = frames_differ(world, whole, model)

            assert far < ROUNDING
            assert turned < ROUNDING


@pytest.mark.slow
@every_character
def test_looking_at_links_changes_no_bit_of_what_follows(name: str) -> None:
    rng = np.random.default_rng(3)
    size = character(name).layout.size
    efforts = [rng.uniform(-0.5, 0.5, size) for _ in range(240)]
    with simulation(name) as blind, simulation(name) as watched:
        for effort in efforts:
            expected = blind.advance(effort)

            watched.simulated.link_frames()
            state = watched.advance(effort)
            watched.simulated.link_frames()

            assert state.position.tobytes() == expected.position.tobytes()
            assert state.velocity.tobytes() == expected.velocity.tobytes()


# --- pushes --------------------------------------------------------------------------------------


def generalised_force(
    model: DynamicsModel,
    link: int,
    force: FloatArray,
    torque: FloatArray,
    point: FloatArray,
) -> FloatArray:
    """MuJoCo's generalised force (n,) of a push at a point of the link frame."""
    origins, turns = model.link_poses()
    at = origins[link] + rotations.matrix(turns[link]) @ point
    result = np.zeros(len(model.bias_force()))
    mujoco.mj_applyFT(model._model, model._data, force, torque, at, link + 1, result)
    return result


def as_push(
    row: int, force: FloatArray, torque: FloatArray, point: FloatArray
) -> tuple[int, FloatArray, FloatArray]:
    """A push as a body takes it."""
    return row, np.concatenate((force, torque)), point


@dataclass
class Pushing:
    """A body in a random state without gravity, and MuJoCo's model in the same."""

    world: LoneWorld
    whole: Character
    model: DynamicsModel
    rng: np.random.Generator

    def draw(self) -> None:
        """Go to another random state."""
        position, velocity = free_random_state(self.world.body, self.whole, self.rng)
        self.state = position, velocity
        self.model.update(position, velocity)

    def acceleration(self, *pushes: tuple[int, FloatArray, FloatArray, FloatArray]) -> FloatArray:
        """What pushes add to the acceleration (n,) in one instant."""
        velocities = []
        for present in (pushes, ()):
            self.world.body.set_state(*self.state)
            self.world.body.apply(np.zeros(self.whole.layout.size))
            self.world.body.push([as_push(*push) for push in present])
            self.world.step()
            velocities.append(self.world.body.read()[1])
        return (velocities[0] - velocities[1]) / INSTANT

    def check(self, measured: FloatArray, generalised: FloatArray) -> None:
        """The acceleration is that of a generalised force, by MuJoCo's mass matrix.

        A force that nothing yields to, as one along a base that is fixed, leaves only rounding.
        """
        mass_matrix = self.model.mass_matrix()
        predicted = np.linalg.solve(mass_matrix, generalised)
        assert np.abs(measured - predicted).max() < 1e-6 * np.abs(predicted).max() + NOISE
        force = mass_matrix @ measured
        assert np.abs(force - generalised).max() < 1e-5 * np.abs(generalised).max() + NOISE


@pytest.fixture
def pushing(name: str) -> Iterator[Pushing]:
    whole = without_self_collision(name)
    with still_world(whole) as world:
        yield Pushing(world, whole, DynamicsModel(whole, gravity=0.0), np.random.default_rng(4))


ZERO = np.zeros(3)


@pushed_characters
def test_a_push_at_any_point_of_any_link_accelerates_as_mujoco_says(pushing: Pushing) -> None:
    for link in range(len(pushing.whole.links)):
        for _ in range(5):
            pushing.draw()
            force, torque = pushing.rng.uniform(-50.0, 50.0, (2, 3))
            point = pushing.rng.uniform(-0.5, 0.5, 3)

            for push in ((link, force, ZERO, point), (link, ZERO, torque, point)):
                measured = pushing.acceleration(push)

                pushing.check(measured, generalised_force(pushing.model, *push))


@pushed_characters
def test_pushes_on_several_links_at_once_and_twice_on_one_add_up(pushing: Pushing) -> None:
    pushing.draw()
    last = len(pushing.whole.links) - 1
    pushes = [(link, *pushing.rng.uniform(-5.0, 5.0, (3, 3))) for link in (0, last, last, last - 1)]

    measured = pushing.acceleration(*pushes)

    total = sum(generalised_force(pushing.model, *push) for push in pushes)
    pushing.check(measured, np.asarray(total))


@pushed_characters
def test_a_push_lasts_one_engine_step(pushing: Pushing) -> None:
    body, world = pushing.world.body, pushing.world
    for link in range(len(pushing.whole.links)):
        pushing.draw()
        body.set_state(pushing.state[0], np.zeros(pushing.whole.layout.size))
        body.push([as_push(link, np.array([30.0, -20.0, 10.0]), np.array([1.0, 2.0, 3.0]), ZERO)])
        world.step()
        pushed = body.read()[1]

        world.step()

        assert np.abs(body.read()[1] - pushed).max() <= 1e-4 * np.abs(pushed).max()


def test_a_push_on_a_fixed_base_moves_nothing() -> None:
    whole = without_self_collision("franka_panda")
    position = np.array(whole.rest_position)
    with still_world(whole, step_s=1e-3) as world:
        world.body.set_state(position, np.zeros_like(position))

        world.body.push(
            [as_push(0, np.array([1e4, 1e4, 1e4]), np.array([1e4, 0.0, 0.0]), np.ones(3))]
        )
        world.step()
        origins, _ = world.body.link_frames()

    expected = whole.links[0].joint.pose_in_parent.position
    np.testing.assert_allclose(origins[0], expected, rtol=0.0, atol=ROUNDING)


# --- contacts ------------------------------------------------------------------------------------

BOX_MASS = 2.0


@pytest.fixture
def box(tmp_path: Path) -> Character:
    """A box of 2 kg, 0.2 m high."""
    return box_character(tmp_path, "0.5 0.5 0.2", BOX_MASS)


def at_height(z: float, x: float = 0.0) -> FloatArray:
    return np.array([x, 0.0, z, 0.0, 0.0, 0.0])


def contact_forces(body: Body) -> tuple[FloatArray, BoolArray]:
    """Contact forces (links, 3) of the last step."""
    wrenches, touching = body.contact_wrenches()
    return wrenches[:, :3], touching


def about_origin(wrenches: FloatArray, centres: FloatArray) -> FloatArray:
    """The sum (6,) of wrenches on links, its torque about the world's origin."""
    forces, torques = wrenches[:, :3], wrenches[:, 3:]
    return np.concatenate((forces.sum(axis=0), (np.cross(centres, forces) + torques).sum(axis=0)))


@pytest.mark.parametrize("gap", [1e-4, 1e-3, 5e-3, 1e-2, 0.9])
def test_what_is_only_near_does_not_touch(box: Character, gap: float) -> None:
    with LoneWorld(box, WorldSettings(gravity=0.0)) as world:
        world.body.set_state(at_height(0.1 + gap), np.zeros(6))
        advance(world, np.zeros(6))
        forces, touching = contact_forces(world.body)

    np.testing.assert_array_equal(forces, np.zeros((1, 3)))
    assert not touching.any()


def test_the_ground_carries_the_weight_of_a_box_at_rest(box: Character, engine: str) -> None:
    # Bullet's solver ends where four corners share it nearly as before; MuJoCo's starts from the
    # last step's accelerations, which only tend to zero
    tolerance = {"bullet": 1e-8, "mujoco": 1e-4}[engine]
    with LoneWorld(box, WorldSettings()) as world:
        world.body.set_state(at_height(0.1), np.zeros(6))

        advance(world, np.zeros(6), 480)
        forces, touching = contact_forces(world.body)

    np.testing.assert_allclose(forces, [[0.0, 0.0, BOX_MASS * 9.81]], rtol=0.0, atol=tolerance)
    assert touching.all()


def test_contacts_and_gravity_are_all_that_changes_the_momentum_of_a_tumbling_box(
    box: Character,
) -> None:
    # it falls on an edge, spinning and with speed along the ground, and rolls over
    step_s, weight = 1.0 / 240.0, np.array([0.0, 0.0, -BOX_MASS * 9.81])
    start = np.array([0.3, -0.2, 0.6, 0.4, 0.5, 0.2])
    turned = 0.0
    with LoneWorld(box, WorldSettings(link_friction=1.0)) as world:
        world.body.set_state(start, np.array([1.0, 0.5, -1.0, 3.0, 4.0, -2.0]))
        for _ in range(240):
            before = np.concatenate(momentum(world.body, box))
            centres = world.body.centres()

            advance(world, np.zeros(6))
            wrenches, _ = world.body.contact_wrenches()

            # Newton's and Euler's law, about the world's origin
            rate = (np.concatenate(momentum(world.body, box)) - before) / step_s
            gravity = np.concatenate((weight, np.cross(centres[0], weight)))
            total = about_origin(wrenches, centres) + gravity
            np.testing.assert_allclose(total, rate, rtol=1e-9, atol=1e-9)
            turned = max(turned, float(np.abs(wrenches[:, 3:]).max()))
    assert turned > 10.0


@pytest.mark.parametrize("order", [1, -1])
def test_two_boxes_that_collide_press_equally_in_opposite_directions(
    box: Character, order: int
) -> None:
    # one falls aslant onto the other's corner, and neither has weight
    step_s, touched = 1.0 / 240.0, 0
    with make_world(WorldSettings(gravity=0.0, ground=False)) as world:
        resting, coming = [world.add(box), world.add(box)][::order]
        resting.set_state(np.zeros(6), np.zeros(6))
        coming.set_state(
            np.array([0.3, 0.2, 0.25, 0.1, 0.2, 0.3]), np.array([0.5, 0.1, -1.0, 0.3, 0.2, 0.0])
        )
        for _ in range(60):
            before = momenta(box, resting, coming)

            for body in (resting, coming):
                body.apply(np.zeros(6))
            world.step()
            forces = [contact_forces(body)[0][0] for body in (resting, coming)]

            # Newton's third law, and his second for each
            rates = (momenta(box, resting, coming) - before) / step_s
            touched += bool(np.abs(forces[0]).max() > 1.0)
            np.testing.assert_allclose(forces[0], -forces[1], rtol=0.0, atol=1e-9)
            np.testing.assert_allclose(forces, rates, rtol=0.0, atol=1e-9)
    assert touched


def momenta(whole: Character, *bodies: Body) -> FloatArray:
    """Linear momentum (bodies, 3) of each body, N s."""
    return np.array([momentum(body, whole)[0] for body in bodies])


RawState = tuple[Any, Any, Any]


def raw_state(body: Any) -> RawState:
    """The engine's own state of a body: base pose, base velocity, joints."""
    if isinstance(body, MujocoBody):
        data = body._world.data
        return data.qpos.copy(), data.qvel.copy(), None
    client = {"physicsClientId": body._client}
    return (
        pybullet.getBasePositionAndOrientation(body._body, **client),
        pybullet.getBaseVelocity(body._body, **client),
        pybullet.getJointStatesMultiDof(body._body, body._joints, **client),
    )


def put_raw_state(body: Any, pose: RawState, motion: RawState) -> None:
    """Put a body into the pose of one state with the velocities of another."""
    if isinstance(body, MujocoBody):
        body._world.data.qpos[:], body._world.data.qvel[:] = pose[0], motion[1]
        return
    client = {"physicsClientId": body._client}
    pybullet.resetBasePositionAndOrientation(body._body, *pose[0], **client)
    pybullet.resetBaseVelocity(body._body, *motion[1], **client)
    for joint, where, moving in zip(body._joints, pose[2], motion[2], strict=True):
        pybullet.resetJointStateMultiDof(
            body._body, joint, targetValue=where[0], targetVelocity=moving[1], **client
        )


class Untouched:
    """The same character where nothing can touch it: what contacts alone did to the momentum.

    Momentum is `M(q) v`. The step from `q` gave `v_touched`; without contacts it gives `v_free`.
    By Newton and Euler, the contacts' impulse is the momentum of `v_touched - v_free` in the pose
    `q`; what the links do to one another takes no part in it.
    """

    def __init__(self, name: str, settings: WorldSettings) -> None:
        self._whole = without_self_collision(name)
        self._step_s = settings.step_s
        self._world = LoneWorld(self._whole, settings)

    def close(self) -> None:
        self._world.close()

    def wrench(self, before: RawState, after: RawState) -> FloatArray:
        """The wrench (6,) over a step of all that touched, N, and N m about the world's origin."""
        body = self._world.body
        put_raw_state(body, before, before)
        self._world.body.apply(np.zeros(self._whole.layout.size))
        self._world.step()
        free = raw_state(body)
        momenta = []
        for motion in (after, free):
            put_raw_state(body, before, motion)
            momenta.append(np.concatenate(momentum(body, self._whole)))
        return (momenta[0] - momenta[1]) / self._step_s


def in_the_void(gravity: float = 9.81) -> WorldSettings:
    return WorldSettings(gravity=gravity, ground=False)


@pytest.mark.slow
def test_the_contact_wrenches_of_a_falling_humanoid_are_what_changes_its_momentum() -> None:
    # limp, moving over the ground and turning, so that there is friction; it lies in the
    # end, with links of its own on each other
    whole = character("humanoid")
    velocity = np.zeros(whole.layout.size)
    velocity[:2] = 1.0, 0.5
    velocity[5] = 2.0
    untouched = Untouched("humanoid", in_the_void())
    largest = np.zeros(6)
    with LoneWorld(whole, WorldSettings()) as world:
        world.body.set_state(np.array(whole.rest_position), velocity)
        for _ in range(480):
            before, centres = raw_state(world.body), world.body.centres()

            advance(world, np.zeros(whole.layout.size))
            wrenches, touching = world.body.contact_wrenches()

            expected = untouched.wrench(before, raw_state(world.body))
            total = about_origin(wrenches, centres)
            np.testing.assert_allclose(total, expected, rtol=1e-9, atol=1e-7)
            assert not wrenches[~touching].any()
            largest = np.maximum(largest, np.abs(expected))
    untouched.close()
    assert (largest > 200.0).all()


def test_a_contact_is_the_links_own_whatever_the_order_of_the_urdf(tmp_path: Path) -> None:
    # only `foot` is low; the file lists it last, the character right after `left`
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    inertial = f'<inertial><mass value="1"/>{inertia}</inertial>'
    block = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
    links = "".join(
        f'<link name="{name}">{inertial}{block}</link>'
        for name in ("base", "left", "right", "foot")
    )
    joints = "".join(
        f'<joint name="to_{child}" type="fixed"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{place}"/></joint>'
        for parent, child, place in (
            ("base", "left", "0 0.5 0"),
            ("base", "right", "0 -0.5 0"),
            ("left", "foot", "0 0 -0.5"),
        )
    )
    (tmp_path / "tower.urdf").write_text(f'<robot name="tower">{links}{joints}</robot>')
    (tmp_path / "tower.yaml").write_text("urdf: tower.urdf\ninertia: file\n")
    whole = load_character(str(tmp_path / "tower.yaml"))
    with LoneWorld(whole, WorldSettings()) as world:
        world.body.set_state(at_height(0.549), np.zeros(6))

        advance(world, np.zeros(6))
        forces, touching = contact_forces(world.body)

    assert [link.name for link in whole.links] == ["base", "left", "foot", "right"]
    np.testing.assert_array_equal(touching, [False, False, True, False])
    assert forces[2, 2] > 0.0


def test_contacts_inside_a_character_cancel() -> None:
    # in the void the knees and elbows are folded until the limbs press on each other
    whole = character("humanoid")
    rng, pressed = np.random.default_rng(6), 0
    motors = np.concatenate((np.zeros(6), np.ones(whole.layout.size - 6)))
    effort = 3.0 * motors * rng.normal(size=whole.layout.size)
    with LoneWorld(whole, in_the_void(gravity=0.0)) as world:
        world.body.set_state(np.array(whole.rest_position), np.zeros(whole.layout.size))
        for _ in range(30):
            advance(world, effort)
            forces, touching = contact_forces(world.body)

            largest = np.abs(forces).max()
            pressed += bool(largest > 10.0)
            assert np.abs(forces.sum(axis=0)).max() <= 1e-12 * max(largest, 1.0)
            assert touching.sum() != 1
    assert pressed
