"""Bullet's world: PyBullet behind one class; the only place that steps it."""

import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import SimulationError
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.bullet.balls import BulletBalls
from sim_node.physics.bullet.body import BulletBody
from sim_node.physics.bullet.client import Engine, load_urdf, pybullet
from sim_node.physics.bullet.ground import add_ground, set_friction
from sim_node.physics.bullet.touches import Touch, TouchedLinks
from sim_node.physics.engine import UNLIMITED_SPEED
from sim_node.physics.settings import WorldSettings

_STATE_FILE = "state.bullet"  # the engine saves its state to files only
_RAYS = 10_000  # rays in one call; the engine takes up to 16,383
_MAX_DEPTH = 1000.0  # m: how far below a point a surface is looked for


class BulletWorld:
    """The ground and the characters on it, and what is thrown at them, in a private engine.

    `to_bytes` and `from_bytes` keep the engine's contact caches, so that what follows a restored
    state is what followed the saved one, to the bit; setting positions and velocities alone is not.
    Restore right after a step: the engine keeps an effort that was applied but not stepped yet.
    """

    def __init__(self, settings: WorldSettings) -> None:
        """Start the engine.

        Raises:
            CharacterError: the terrain cannot be loaded.
        """
        self._client = Engine(settings.contact_breaking_threshold)
        try:
            with self._client.alone():
                self._furnish(settings)
        except BaseException:
            self.close()
            raise

    def _furnish(self, settings: WorldSettings) -> None:
        """Put all into the world that is there before the characters."""
        self._link_friction = settings.link_friction
        self.set_gravity(settings.gravity)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=settings.step_s,
            numSolverIterations=settings.solver_iterations,
            numSubSteps=0,
            # They are for rigid bodies alone: a hinge 0.04 rad beyond its limit would stay there.
            useSplitImpulse=0,
            deterministicOverlappingPairs=1,
            enableFileCaching=0,
            physicsClientId=self._client,
        )
        if settings.ground:
            add_ground(self._client, settings.friction)
        if settings.terrain is not None:
            set_friction(self._client, load_urdf(self._client, settings.terrain), settings.friction)
        self.balls = BulletBalls(self._client, settings.link_friction)
        self._touched: TouchedLinks | None = None  # None: not asked for since the last step

    def __enter__(self) -> "BulletWorld":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the engine; the world cannot be used any more, nor what was added to it."""
        self._client.close()

    def add(self, character: Character, speed_bound: float = UNLIMITED_SPEED) -> BulletBody:
        """Put a character into the world, at the pose of its URDF.

        No degree of freedom is let be faster than `speed_bound`, rad/s or m/s.
        """
        with self._client.alone():
            return BulletBody(
                self._client,
                character,
                friction=self._link_friction,
                speed_bound=speed_bound,
                touched=self.touched_links,
                balls=self.balls,
            )

    def set_gravity(self, gravity: float) -> None:
        """Set gravity in m/s^2 along -z."""
        pybullet.setGravity(0.0, 0.0, -gravity, physicsClientId=self._client)

    def step(self) -> None:
        """Advance by one engine step; efforts last one step and are to be applied again."""
        self._touched = None
        with self._client.alone():
            pybullet.stepSimulation(physicsClientId=self._client)

    def touched_links(self) -> TouchedLinks:
        """The contacts of the last engine step, each on both bodies, in opposite directions.

        Points are where the surfaces were when the step began: the engine looks for contacts first,
        and moves last. On each body it is that body's own surface; the two are apart by the depth
        at which the bodies are in each other. The engine has them until its next step.
        """
        if self._touched is None:
            self._touched = self._find_touched()
        return self._touched

    def _find_touched(self) -> TouchedLinks:
        touched = defaultdict[int, list[Touch]](list)
        # The contacts of all bodies: asked for those of one body, the engine lets it come first in
        # each contact, and then turns the normal round but not the friction.
        for contact in pybullet.getContactPoints(physicsClientId=self._client):
            _, body, body_b, link, link_b, at, at_b, normal, distance, f, f1, a, f2, b = contact
            if distance > 0.0 and f == 0.0:
                continue  # near enough to be watched by the engine, but apart
            # Written out, because it is done for each contact at each tick.
            x = f * normal[0] + f1 * a[0] + f2 * b[0]
            y = f * normal[1] + f1 * a[1] + f2 * b[1]
            z = f * normal[2] + f1 * a[2] + f2 * b[2]
            touched[body].append(Touch(link, (x, y, z), at))
            touched[body_b].append(Touch(link_b, (-x, -y, -z), at_b))
        return touched

    def heights_below(self, points: FloatArray) -> FloatArray:
        """Height z (r,) in m of the highest surface below each point (r, 3); 0 without one."""
        heights = np.zeros(len(points))
        for first in range(0, len(points), _RAYS):
            rows = points[first : first + _RAYS]
            ends = rows - (0.0, 0.0, _MAX_DEPTH)
            hits = pybullet.rayTestBatch(rows.tolist(), ends.tolist(), physicsClientId=self._client)
            for row, (body, _, _, place, _) in enumerate(hits, start=first):
                if body >= 0:
                    heights[row] = place[2]
        return heights

    def to_bytes(self) -> bytes:
        """The whole state, for any world of equal settings, characters and balls.

        Raises:
            SimulationError: there is no place for temporary files, by which the engine saves it.
        """
        try:
            with tempfile.TemporaryDirectory() as directory:
                file = Path(directory) / _STATE_FILE
                pybullet.saveBullet(str(file), physicsClientId=self._client)
                return file.read_bytes()
        except (OSError, pybullet.error) as error:
            raise SimulationError(f"the engine's state cannot be saved: {error}") from error

    def from_bytes(self, state: bytes, throws: Sequence[ProjectileThrow] = ()) -> None:
        """Restore a state of `to_bytes`, exactly, in which there were the balls of `throws`."""
        self._touched = {}  # the engine would restore the saved state's contacts, too
        with self._client.alone(), tempfile.TemporaryDirectory() as directory:
            self.balls.replace(throws)
            file = Path(directory) / _STATE_FILE
            file.write_bytes(state)
            pybullet.restoreState(fileName=str(file), physicsClientId=self._client)
