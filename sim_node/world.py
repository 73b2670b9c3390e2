"""The physics world: PyBullet behind one class; the only place that steps the engine."""

from dataclasses import dataclass
from types import TracebackType

from msgs_config.bullet import connect, pybullet
from msgs_config.character import Character
from sim_node.body import Body


@dataclass(frozen=True)
class WorldSettings:
    """The physics of the world."""

    step_s: float = 1.0 / 240.0  # length of one engine step
    gravity: float = 9.81  # m/s^2, along -z
    friction: float = 0.9  # of the ground; a contact's is the product of both surfaces'
    link_friction: float = 0.5  # of every link
    solver_iterations: int = 10


class World:
    """A plane ground and one character, in a private engine.

    `save` and `restore` keep the engine's contact caches, so that what follows a restored state
    is what followed the saved one, to the bit; setting positions and velocities alone is not.
    Restore right after a step: the engine keeps an effort that was applied but not stepped yet.
    """

    def __init__(self, character: Character, settings: WorldSettings) -> None:
        self._client = connect()
        pybullet.setGravity(0.0, 0.0, -settings.gravity, physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=settings.step_s,
            numSolverIterations=settings.solver_iterations,
            numSubSteps=0,
            deterministicOverlappingPairs=1,
            enableFileCaching=0,
            physicsClientId=self._client,
        )
        self._add_ground(settings.friction)
        self.body = Body(self._client, character, settings.link_friction)

    def __enter__(self) -> "World":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the engine; the world cannot be used any more."""
        pybullet.disconnect(self._client)

    def step(self) -> None:
        """Advance by one engine step; efforts last one step and are to be applied anew."""
        pybullet.stepSimulation(physicsClientId=self._client)

    def save(self) -> int:
        """Keep the whole state in memory; returns its number for `restore`."""
        return int(pybullet.saveState(physicsClientId=self._client))

    def restore(self, saved: int) -> None:
        """Return to a saved state, exactly."""
        pybullet.restoreState(stateId=saved, physicsClientId=self._client)

    def _add_ground(self, friction: float) -> None:
        shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self._client)
        ground = pybullet.createMultiBody(0.0, shape, physicsClientId=self._client)
        pybullet.changeDynamics(ground, -1, lateralFriction=friction, physicsClientId=self._client)
