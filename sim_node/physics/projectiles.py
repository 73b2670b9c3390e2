"""Balls in the engine: solid spheres that are thrown into the world."""

from collections.abc import Sequence

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.bullet import pybullet
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.links import Links

_AWAY = 10_000.0  # m along x


class Projectiles:
    """The balls of a world, in the order in which they were thrown."""

    def __init__(self, client: int, friction: float) -> None:
        self._client = client
        self._friction = friction
        self._numbers: list[int] = []  # the engine's
        self._shapes: dict[float, int] = {}  # by radius
        self.throws: tuple[ProjectileThrow, ...] = ()

    def add(self, throw: ProjectileThrow) -> None:
        """Put a ball into the world, as it is when it is let go."""
        client = self._client
        number = pybullet.createMultiBody(
            throw.mass, self._shape(throw.radius), -1, throw.position, physicsClientId=client
        )
        # One call a setting: a body silently loses some of those that share a call.
        settings = (
            {"linearDamping": 0.0, "angularDamping": 0.0},
            {"lateralFriction": self._friction},
            {"rollingFriction": 0.0},
            {"spinningFriction": 0.0},
            {"restitution": 0.0},
        )
        for setting in settings:
            pybullet.changeDynamics(number, -1, **setting, physicsClientId=client)
        pybullet.resetBaseVelocity(number, throw.velocity, (0.0, 0.0, 0.0), physicsClientId=client)
        self._numbers.append(int(number))
        self.throws = (*self.throws, throw)

    def have(self, throws: Sequence[ProjectileThrow]) -> None:
        """Have the balls of these throws and no others, wherever they are.

        It is for what restores a state, which says where they are. The engine goes by the order of
        bodies, so those that are too many go from the last one on.
        """
        common = 0
        while common < min(len(throws), len(self.throws)) and self._alike(throws, common):
            common += 1
        for number in reversed(self._numbers[common:]):
            pybullet.removeBody(number, physicsClientId=self._client)
        del self._numbers[common:]
        self.throws = tuple(throws[:common])
        for throw in throws[common:]:
            self.add(throw)

    def put_away(self, ball: int) -> None:
        """Put a ball, by its place in the order, far away: on the ground, where that is a plane.

        It stays a body of the engine, which goes by their order.
        """
        number, client = self._numbers[ball], self._client
        centre = (_AWAY, 20.0 * ball, self.throws[ball].radius)
        pybullet.resetBasePositionAndOrientation(
            number, centre, (0.0, 0.0, 0.0, 1.0), physicsClientId=client
        )
        pybullet.resetBaseVelocity(number, (0.0,) * 3, (0.0,) * 3, physicsClientId=client)

    def place(self, centre: FloatArray) -> None:
        """Put the last ball to where its centre (3,) is then, m."""
        pybullet.resetBasePositionAndOrientation(
            self._numbers[-1], centre, (0.0, 0.0, 0.0, 1.0), physicsClientId=self._client
        )

    def gaps(self, links: Links) -> FloatArray:
        """How far (links,) the last ball is from the surface of each link, m; inf: it has none."""
        return links.gaps(self._numbers[-1])

    def motion(self) -> FloatArray:
        """Centre m, orientation xyzw, velocity m/s, angular velocity rad/s, world: (m, 13)."""
        client, rows = self._client, []
        for number in self._numbers:
            centre, turn = pybullet.getBasePositionAndOrientation(number, physicsClientId=client)
            linear, angular = pybullet.getBaseVelocity(number, physicsClientId=client)
            rows.append((*centre, *turn, *linear, *angular))
        return np.array(rows, dtype=float).reshape(-1, 13)

    def _alike(self, throws: Sequence[ProjectileThrow], place: int) -> bool:
        one, other = throws[place], self.throws[place]
        return (one.mass, one.radius) == (other.mass, other.radius)

    def _shape(self, radius: float) -> int:
        if radius not in self._shapes:
            self._shapes[radius] = pybullet.createCollisionShape(
                pybullet.GEOM_SPHERE, radius=radius, physicsClientId=self._client
            )
        return self._shapes[radius]
