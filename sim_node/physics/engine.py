"""What a simulation needs of an engine: a world, the bodies in it, and the balls.

An engine is a folder beside this file that implements these three; nothing outside of it knows how.
All positions, velocities and efforts are (n,) arrays in message form, and arrays of links have one
row a link, in the order of `Character.links`. Frames are URDF link frames, axes the world's.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING, Protocol, Self

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.geometry.rotations import IDENTITY_XYZW
from msgs_config.messages.throw import ProjectileThrow

if TYPE_CHECKING:
    from sim_node.physics.batch import Batch, BatchSetup
    from sim_node.physics.settings import WorldSettings

UNLIMITED_SPEED = 1e9
"""A bound that nothing sound reaches, rad/s or m/s; an engine's own would hide a divergence."""


class Body(Protocol):
    """A character in a world."""

    has_armature: bool
    """Whether the engine knows the armature of joints; if not, it is a passive force."""

    def read(self) -> FloatArray:
        """Position and velocity, (2, n)."""

    def set_state(self, position: FloatArray, velocity: FloatArray) -> None:
        """Put the character into a state given as `read` gives it."""

    def set_motion(self, position: FloatArray, velocity: FloatArray) -> None:
        """Set the joints' positions and all velocities, as of `set_state`; the base stays."""

    def forget_reading(self) -> None:
        """Forget what was read last: the world's state was set to another one."""

    def apply(self, effort: FloatArray) -> None:
        """Apply a generalised effort (n,) during the world's next step, and only then."""

    def set_friction(self, friction: FloatArray) -> None:
        """Set the friction (n,) that joints oppose to contacts in the world's next step."""

    def push(self, pushes: Iterable[tuple[int, FloatArray, FloatArray]]) -> None:
        """Push links during the world's next step, and only then; to be called after `apply`.

        Of each push: the link's row, its wrench (6,) in N and N m, world axes, and the point (3,)
        in m, link frame, at which the force acts; that adds the torque `r x f` about the centre of
        mass.
        """

    def base_frame(self) -> tuple[FloatArray, FloatArray]:
        """Origin (3,) in m and orientation xyzw (4,) of the base link in the world."""

    def link_frames(self) -> tuple[FloatArray, FloatArray]:
        """Origins (links, 3) in m and orientations xyzw (links, 4) of the links in the world."""

    def centres(self) -> Sequence[Sequence[float]] | FloatArray:
        """Centres of mass (links, 3) in the world, m."""

    def kinetic_energy(self) -> float:
        """Kinetic energy of all links, J, by the engine's own masses, inertia and velocities."""

    def contact_wrenches(self) -> tuple[FloatArray, BoolArray]:
        """Net contact wrench (links, 6) of the world's last step; and which links (links,) touched.

        It is the force in N, and the torque in N m about the link's centre of mass when the step
        began. A contact between two links of the body counts on both, in opposite directions. To be
        asked for before `link_frames` and `centres`: those move the links to where they are now.
        Nothing touches before the first step, nor from `World.from_bytes` to the next step: a state
        does not say what led to it.
        """

    def gaps(self, ball: int) -> FloatArray:
        """Distance (links,) of each link's surface to a ball's, m; inf where there is none.

        `ball` is its place in the order of throws.
        """


class Balls(Protocol):
    """The balls and boxes of a world, in the order in which they were thrown; all are solid."""

    @property
    def throws(self) -> tuple[ProjectileThrow, ...]:
        """The throw of each ball."""

    def add(self, throw: ProjectileThrow) -> None:
        """Let a ball go: put it into the world with the position and velocity of the throw."""

    def replace(self, throws: Sequence[ProjectileThrow]) -> None:
        """Have the balls of these throws and no others; where they are is left open.

        A state that is restored afterwards says where they are.
        """

    def put_away(self, ball: int) -> None:
        """Put a ball, by its place in the order, far away: on the ground, where that is a plane."""

    def place(
        self,
        ball: int,
        centre: FloatArray | Sequence[float],
        turn_xyzw: FloatArray | Sequence[float] = IDENTITY_XYZW,
    ) -> None:
        """Put the centre of a ball, by its place in the order, to a point (3,), m, turned (4,)."""

    def set_motion(self, motion: FloatArray) -> None:
        """Give the balls a motion (m, 13), as `motion` returns it."""

    def motion(self) -> FloatArray:
        """Centre m, orientation xyzw, velocity m/s, angular velocity rad/s, world: (m, 13)."""


class World(Protocol):
    """The ground and the characters on it, and what is thrown at them.

    What follows a state that `from_bytes` restores is what followed the one that was saved, to the
    bit.
    """

    @property
    def balls(self) -> Balls:
        """What was thrown into it."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *error: object) -> None: ...

    def close(self) -> None:
        """End the world; it cannot be used any more, nor what was added to it."""

    def add(self, character: Character, speed_bound: float = UNLIMITED_SPEED) -> Body:
        """Put a character into the world, at the pose of its URDF.

        No degree of freedom is let be faster than `speed_bound`, rad/s or m/s.

        Raises:
            CharacterError: the engine refuses the URDF or a mesh.
        """

    def set_gravity(self, gravity: float) -> None:
        """Set gravity in m/s^2 along -z."""

    def step(self) -> None:
        """Advance by one engine step; efforts last one step and are to be applied again."""

    def heights_below(self, points: FloatArray) -> FloatArray:
        """Height z (r,) in m of the highest surface below each point (r, 3); 0 without one."""

    def to_bytes(self) -> bytes:
        """The whole state, for any world of equal settings, characters and balls.

        Raises:
            SimulationError: it cannot be saved.
        """

    def from_bytes(self, state: bytes, throws: Sequence[ProjectileThrow] = ()) -> None:
        """Restore a state of `to_bytes`, exactly, in which there were the balls of `throws`.

        To be called right after a step: an effort that was applied but not stepped yet may stay.
        Contacts are none until the next step.
        """


@dataclass(frozen=True)
class Engine:
    """An engine that worlds can be simulated with."""

    package: str  # Python's name of what it takes
    make_world: Callable[["WorldSettings"], World]
    # What simulates many worlds, of a setup, their number and that of threads; None: it cannot.
    make_batch: Callable[["BatchSetup", int, int], "Batch"] | None = None


def _make_bullet_world(settings: "WorldSettings") -> World:
    from sim_node.physics.bullet.world import BulletWorld  # an engine is loaded where it is used

    return BulletWorld(settings)


def _make_mujoco_world(settings: "WorldSettings") -> World:
    from sim_node.physics.mujoco.world import MujocoWorld

    return MujocoWorld(settings)


def _make_mujoco_batch(setup: "BatchSetup", count: int, threads: int) -> "Batch":
    from sim_node.physics.mujoco.batch import MujocoBatch

    return MujocoBatch(setup, count, threads)


ENGINES = {
    "bullet": Engine("pybullet", _make_bullet_world),
    "mujoco": Engine("mujoco", _make_mujoco_world, _make_mujoco_batch),
}
"""By name, the preferred one first."""

INSTALLED_ENGINES = tuple(name for name, engine in ENGINES.items() if find_spec(engine.package))

DEFAULT_ENGINE = INSTALLED_ENGINES[0]


def describe_default_engine(engine: str) -> tuple[str, ...]:
    """Warnings if an engine is the default one in place of one that is not installed."""
    preferred = next(iter(ENGINES))
    if engine != DEFAULT_ENGINE or preferred == DEFAULT_ENGINE:
        return ()
    return (f"{ENGINES[preferred].package} is not installed, so the engine is {engine}",)


def make_world(settings: "WorldSettings") -> World:
    """A world without characters.

    Raises:
        ConfigurationError: the engine is not installed.
        CharacterError: the terrain cannot be loaded.
    """
    engine = ENGINES[settings.engine]
    if find_spec(engine.package) is None:
        raise ConfigurationError(
            f"parameter 'engine' is {settings.engine}, but {engine.package} is not installed; "
            f"install it, or take {DEFAULT_ENGINE}"
        )
    return engine.make_world(settings)


def make_batch(setup: "BatchSetup", count: int, threads: int) -> "Batch":
    """Many worlds of one character each, simulated by threads.

    Raises:
        ConfigurationError: the engine cannot, or the character's joints are not of those it can.
        CharacterError: the engine refuses the character or the terrain.
    """
    engine = setup.settings.world.engine
    if (make := ENGINES[engine].make_batch) is None:
        able = ", ".join(name for name, each in ENGINES.items() if each.make_batch is not None)
        raise ConfigurationError(
            f"parameter 'engine' is {engine}, which simulates no batch; it must be {able}"
        )
    return make(setup, count, threads)
