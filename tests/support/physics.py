"""What the tests of the physics share: characters, random states, and the engine's own numbers.

What a test compares with is computed here again, from what the engine says of each link's inertial
frame: none of the conversions under test is used, save for quaternion products.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from controller_node import parameters as for_controller
from controller_node.controller import Controller
from controller_node.references.factory import make_motion
from msgs_config.arrays import FloatArray
from msgs_config.character.file import shipped_characters
from msgs_config.character.layout import JointType
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from msgs_config.messages.state import StampedReference, StampedState
from msgs_config.messages.wrenches import WrenchArrays, select
from sim_node import parameters as for_simulator
from sim_node.physics.engine import Body, make_world
from sim_node.physics.mujoco.body import MujocoBody
from sim_node.physics.settings import SimulationSettings, WorldSettings
from sim_node.physics.simulated_character import CharacterSetup, SimulatedCharacter
from sim_node.physics.simulation import Simulation
from sim_node.physics.wrenches import ExternalWrench
from sim_node.simulation_factory import (
    make_character_setup,
    make_simulation,
    make_simulation_settings,
)
from tests.support.engines import pybullet

DATA = Path(__file__).parents[1] / "data"
TURNED_FRAMES = [str(path) for path in sorted(DATA.glob("turned_frames*.yaml"))]
FLOATING_TURNED_FRAMES = str(DATA / "turned_frames.yaml")
SIMPLE_BODIES = [str(DATA / "free_box.yaml"), str(DATA / "wheel.yaml")]
DAMPED = str(DATA / "damped.yaml")
EVERY_CHARACTER = [*shipped_characters(), *TURNED_FRAMES, *SIMPLE_BODIES, DAMPED]
FLOATING_CHARACTERS = ["humanoid", FLOATING_TURNED_FRAMES]

INSTANT = 1e-7
"""An engine step, s, so short that a difference quotient over it is a derivative."""

_HEIGHT = 3.0  # m, where a floating base is out of reach of the ground and near the origin
_WIDEST = 2.0  # rad or m, where a joint has no limits


def character_id(name_or_path: str) -> str:
    """A short name for a test's parameter."""
    return Path(name_or_path).stem


@lru_cache
def character(name_or_path: str) -> Character:
    """A character, loaded once for all tests."""
    return load_character(name_or_path)


def without_self_collision(name_or_path: str) -> Character:
    """A character whose links pass through each other."""
    whole = character(name_or_path)
    return replace(whole, loading=replace(whole.loading, self_collision=False))


def box_character(
    folder: Path, size: str, mass: float = 2.0, *, fixed: bool = False, name: str = "box"
) -> Character:
    """A box of a mass in kg and edges in m, about its link's origin, as files in a folder."""
    inertia = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
    (folder / f"{name}.urdf").write_text(
        f'<robot name="{name}"><link name="box"><inertial><mass value="{mass}"/>{inertia}'
        f'</inertial><collision><geometry><box size="{size}"/></geometry></collision></link>'
        "</robot>"
    )
    file = folder / f"{name}.yaml"
    file.write_text(f"urdf: {name}.urdf\nfixed_base: {str(fixed).lower()}\ninertia: file\n")
    return load_character(str(file))


def random_state(whole: Character, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """A position (n,) within the limits and a velocity (n,), high above the ground."""
    layout = whole.layout
    lower, upper = whole.position_bounds()
    position = rng.uniform(np.maximum(lower, -_WIDEST), np.minimum(upper, _WIDEST))
    for joint in layout.joints:
        if joint.rotation is not None:
            position[joint.rotation] = random_rotation_vector(rng)
        if joint.type is JointType.FLOATING:
            position[joint.start + 2] += _HEIGHT
    return position, rng.uniform(-2.0, 2.0, layout.size)


def random_rotation_vector(rng: np.random.Generator) -> FloatArray:
    """A rotation vector (3,) of any direction, its angle up to nearly pi."""
    direction = rng.normal(size=3)
    return direction / np.linalg.norm(direction) * rng.uniform(0.0, 3.14)


def touches(body: Any) -> bool:
    """Whether any link is in contact with anything, or about to be."""
    if isinstance(body, MujocoBody):
        mujoco.mj_fwdPosition(body._world.model, body._world.data)
        return bool(body._world.data.ncon)
    pybullet.performCollisionDetection(physicsClientId=body._client)
    return bool(pybullet.getContactPoints(physicsClientId=body._client))


def free_random_state(
    body: Body, whole: Character, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """A random state that the body is put into, drawn again until it touches nothing."""
    for _ in range(100):
        position, velocity = random_state(whole, rng)
        body.set_state(position, velocity)
        if not touches(body):
            return position, velocity
    raise AssertionError("no state without contact was found")


@dataclass(frozen=True)
class DenseDynamics:
    """A mass matrix (n, n) and a bias force (n,), solved by numpy; no passive damping."""

    mass_matrix: FloatArray
    bias: FloatArray

    def solve(self, force: FloatArray, added: FloatArray, period: float) -> FloatArray:
        """The acceleration (n,) of `(M + diag(added)) a = force`."""
        return np.array(np.linalg.solve(self.mass_matrix + np.diag(added), force))

    def bias_force(self) -> FloatArray:
        """The bias force (n,)."""
        return self.bias


class LoneWorld:
    """A world of one character; all else of it is the engine's own."""

    def __init__(self, whole: Character, settings: WorldSettings) -> None:
        self._world = make_world(settings)
        self.body = self._world.add(whole)

    def __enter__(self) -> "LoneWorld":
        return self

    def __exit__(self, *error: object) -> None:
        self._world.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._world, name)


class LoneSimulation(Simulation):
    """A simulation of one actor."""

    def __init__(self, setup: CharacterSetup, settings: SimulationSettings) -> None:
        super().__init__([setup], settings)
        (self.simulated,) = self.characters
        self.layout = self.simulated.layout

    @property
    def state(self) -> StampedState:
        """Its present state."""
        return self.simulated.state

    def advance(self, effort: FloatArray, *pushes: ExternalWrench) -> StampedState:
        """Advance one tick; the next state."""
        self.step([effort], [pushes])
        return self.simulated.state


def acceleration(world: LoneWorld, effort: FloatArray) -> FloatArray:
    """What an effort does to the velocity (n,) in one instant; the world must step by INSTANT."""
    before = world.body.read()[1]
    advance(world, effort)
    return (world.body.read()[1] - before) / INSTANT


@dataclass(frozen=True)
class LinkMotion:
    """How one link moves in the world, about its centre of mass; m, rad, s."""

    mass: float
    centre: FloatArray
    turn_xyzw: FloatArray  # of the inertial frame
    velocity: FloatArray
    angular_velocity: FloatArray
    inertia: FloatArray  # (3, 3) in world axes

    @property
    def kinetic_energy(self) -> float:
        """In J."""
        linear = self.mass * self.velocity @ self.velocity
        angular = self.angular_velocity @ self.inertia @ self.angular_velocity
        return float(0.5 * (linear + angular))

    @property
    def angular_momentum(self) -> FloatArray:
        """About the world's origin, N m s."""
        orbital = np.cross(self.centre, self.mass * self.velocity)
        return orbital + self.inertia @ self.angular_velocity


def link_motions(body: Any, whole: Character) -> list[LinkMotion]:
    """The motion of every link, in the character's order, by the engine's numbers."""
    motions = []
    of_link = _motion_by_mujoco if isinstance(body, MujocoBody) else _motion_by_bullet
    for row, link in enumerate(whole.links):
        centre, turn, velocity, angular = of_link(body, whole, row)
        axes = rotations.matrix(np.array(turn))
        motions.append(
            LinkMotion(
                mass=link.mass,
                centre=np.array(centre),
                turn_xyzw=np.array(turn),
                velocity=np.array(velocity),
                angular_velocity=np.array(angular),
                inertia=axes @ np.diag(link.inertia_diagonal) @ axes.T,
            )
        )
    return motions


def _motion_by_mujoco(body: MujocoBody, whole: Character, row: int) -> tuple[Any, ...]:
    """Centre, turn xyzw of the inertial frame, velocity and angular velocity of a link."""
    model, data = body._world.model, mujoco.MjData(body._world.model)
    data.qpos[:], data.qvel[:] = body._world.data.qpos, body._world.data.qvel
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    number, velocity = body.place.links.start + row, np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, number, velocity, 0)
    turn, axes = np.zeros(4), data.ximat[number]
    mujoco.mju_mat2Quat(turn, axes)
    return data.xipos[number], turn[[1, 2, 3, 0]], velocity[3:], velocity[:3]


def _motion_by_bullet(body: Any, whole: Character, row: int) -> tuple[Any, ...]:
    """Centre, turn xyzw of the inertial frame, velocity and angular velocity of a link."""
    number = link_numbers(body, whole)[row]
    if number < 0:
        centre, turn = pybullet.getBasePositionAndOrientation(
            body._body, physicsClientId=body._client
        )
        velocity, angular = pybullet.getBaseVelocity(body._body, physicsClientId=body._client)
        return centre, turn, velocity, angular
    centre, turn, *_, velocity, angular = pybullet.getLinkState(
        body._body,
        number,
        computeLinkVelocity=1,
        computeForwardKinematics=1,
        physicsClientId=body._client,
    )
    return centre, turn, velocity, angular


def link_numbers(body: Any, whole: Character) -> list[int]:
    """The engine's number of every link, in the character's order; -1 is the base."""
    count = pybullet.getNumJoints(body._body, physicsClientId=body._client)
    infos = [
        pybullet.getJointInfo(body._body, i, physicsClientId=body._client) for i in range(count)
    ]
    numbers = {info[12].decode(): info[0] for info in infos}
    return [-1, *(numbers[link.name] for link in whole.links[1:])]


def link_number(body: Any, whole: Character, joint_name: str) -> int:
    """The engine's number of the link that a joint moves."""
    index = [link.joint.name for link in whole.links].index(joint_name)
    return link_numbers(body, whole)[index]


def link_poses(body: Body, whole: Character) -> tuple[FloatArray, FloatArray]:
    """Origins (links, 3) and quaternions xyzw (links, 4) of the link frames in the world.

    From the inertial frames: what the engine says of link frames has single precision.
    """
    origins, turns = [], []
    for link, motion in zip(whole.links, link_motions(body, whole), strict=True):
        inertial_turn = np.array(link.inertial_pose.orientation_xyzw)
        turn = rotations.multiply(motion.turn_xyzw, rotations.conjugate(inertial_turn))
        turns.append(turn)
        offset = rotations.matrix(turn) @ np.array(link.inertial_pose.position)
        origins.append(motion.centre - offset)
    return np.array(origins), np.array(turns)


def kinetic_energy(body: Body, whole: Character) -> float:
    """Kinetic energy of all links, J."""
    return sum(motion.kinetic_energy for motion in link_motions(body, whole))


def momentum(body: Body, whole: Character) -> tuple[FloatArray, FloatArray]:
    """Linear (N s) and angular momentum (N m s, about the world's origin) of all links."""
    motions = link_motions(body, whole)
    linear = sum(motion.mass * motion.velocity for motion in motions)
    angular = sum(motion.angular_momentum for motion in motions)
    return np.asarray(linear), np.asarray(angular)


def still_world(whole: Character, step_s: float = INSTANT) -> LoneWorld:
    """A world without gravity."""
    return LoneWorld(whole, WorldSettings(step_s=step_s, gravity=0.0))


def advance(world: LoneWorld, effort: FloatArray, steps: int = 1) -> None:
    """Apply an effort again at each of some steps."""
    for _ in range(steps):
        world.body.apply(effort)
        world.step()


def simulation(name: str, **given: object) -> LoneSimulation:
    """A simulation with the parameters given, the others at their defaults."""
    whole = character(name)
    values = for_simulator.resolve_alone(whole, given)
    return LoneSimulation(make_character_setup(whole, values), make_simulation_settings(values))


def joint_simulation(given: Mapping[str, object]) -> Simulation:
    """A simulation of several characters, with the parameters given."""
    return make_simulation(for_simulator.load_parameters(given))


def controller(name: str, **given: object) -> Controller:
    """A controller with the parameters given, the others at their defaults."""
    return make_driver(character(name), given)


def make_driver(whole: Character, given: Mapping[str, object]) -> Controller:
    """A controller of a character with the parameters given, the others at their defaults."""
    values = for_controller.resolve_for(whole, given)
    return for_controller.make_controller(whole, make_motion(whole, values).reference, values)


def read_wrenches(simulated: SimulatedCharacter) -> tuple[WrenchArrays, WrenchArrays | None]:
    """The pushes and the contacts of the tick before, as the simulator publishes them."""
    stamp_ns, names = simulated.state.stamp_ns, [link.name for link in simulated.character.links]
    pushes = WrenchArrays.of_rows(
        stamp_ns,
        [names[push.link] for push in simulated.pushes],
        [push.wrench for push in simulated.pushes],
        [push.point for push in simulated.pushes],
    )
    if simulated.contacts is None:
        return pushes, None
    return pushes, select(stamp_ns, names, simulated.contacts.wrenches, simulated.contacts.touching)


def run_together(
    run: LoneSimulation, driver: Controller, ticks: int
) -> Iterator[tuple[StampedState, FloatArray, StampedReference]]:
    """Both sides in one process: each tick's state, the effort that answers it, the reference."""
    episode_ns = run.state.stamp_ns
    for _ in range(ticks):
        state = run.state
        effort, reference = driver.compute_effort(state, episode_ns)
        yield state, effort, reference
        run.advance(effort)
