"""Balls in the engine: solid spheres and boxes that are thrown into the world."""

from collections.abc import Sequence

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Shape, ShapeType
from msgs_config.geometry.rotations import IDENTITY_XYZW
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.bullet.client import Engine, pybullet
from sim_node.physics.bullet.ground import touch_as_box

_AWAY_DISTANCE = 10_000.0  # m along x: where a ball lies that was taken out of the way


class BulletBalls:
    """The balls of a world, in the order in which they were thrown."""

    def __init__(self, client: Engine, friction: float) -> None:
        self._client = client
        self._friction = friction
        self.numbers: list[int] = []  # the engine's number of each ball
        self._shapes: dict[Shape, int] = {}  # the engine's number of each shape
        self.throws: tuple[ProjectileThrow, ...] = ()

    def add(self, throw: ProjectileThrow) -> None:
        """Let a ball go: put it into the world with the position and velocity of the throw."""
        client = self._client
        with client.alone():
            number = pybullet.createMultiBody(
                throw.mass,
                self._shape(throw.shape),
                -1,
                throw.position,
                throw.turn_xyzw,
                physicsClientId=client,
            )
            if throw.size is not None:
                touch_as_box(client, number)
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
        self.numbers.append(int(number))
        self.throws = (*self.throws, throw)

    def replace(self, throws: Sequence[ProjectileThrow]) -> None:
        """Have the balls of these throws and no others; where they are is left open.

        A state that is restored afterwards says where they are. The engine goes by the order of
        bodies, so surplus ones are removed from the last one on.
        """
        common = 0
        for old, new in zip(self.throws, throws, strict=False):
            if (old.mass, old.shape) != (new.mass, new.shape):
                break
            common += 1
        for number in reversed(self.numbers[common:]):
            pybullet.removeBody(number, physicsClientId=self._client)
        del self.numbers[common:]
        self.throws = tuple(throws[:common])
        for throw in throws[common:]:
            self.add(throw)

    def put_away(self, ball: int) -> None:
        """Put a ball, by its place in the order, far away: on the ground, where that is a plane.

        It stays a body of the engine, which goes by their order.
        """
        self.place(ball, (_AWAY_DISTANCE, 20.0 * ball, self.throws[ball].half_edges[2]))
        pybullet.resetBaseVelocity(
            self.numbers[ball], (0.0,) * 3, (0.0,) * 3, physicsClientId=self._client
        )

    def place(
        self,
        ball: int,
        centre: FloatArray | Sequence[float],
        turn_xyzw: FloatArray | Sequence[float] = IDENTITY_XYZW,
    ) -> None:
        """Put the centre of a ball, by its place in the order, to a point (3,), m, turned (4,)."""
        with self._client.alone():
            pybullet.resetBasePositionAndOrientation(
                self.numbers[ball], centre, turn_xyzw, physicsClientId=self._client
            )

    def set_motion(self, motion: FloatArray) -> None:
        """Give the balls a motion (m, 13), as `motion` returns it."""
        client = self._client
        with client.alone():
            for number, row in zip(self.numbers, motion, strict=True):
                pybullet.resetBasePositionAndOrientation(
                    number, row[:3], row[3:7], physicsClientId=client
                )
                pybullet.resetBaseVelocity(number, row[7:10], row[10:], physicsClientId=client)

    def motion(self) -> FloatArray:
        """Centre m, orientation xyzw, velocity m/s, angular velocity rad/s, world: (m, 13)."""
        client, rows = self._client, []
        for number in self.numbers:
            centre, turn = pybullet.getBasePositionAndOrientation(number, physicsClientId=client)
            linear, angular = pybullet.getBaseVelocity(number, physicsClientId=client)
            rows.append((*centre, *turn, *linear, *angular))
        return np.array(rows, dtype=float).reshape(-1, 13)

    def _shape(self, shape: Shape) -> int:
        if shape not in self._shapes:
            is_box = shape.type is ShapeType.BOX
            self._shapes[shape] = pybullet.createCollisionShape(
                pybullet.GEOM_BOX if is_box else pybullet.GEOM_SPHERE,
                **{"halfExtents": [0.5 * edge for edge in shape.size]}
                if is_box
                else {"radius": shape.size[0]},
                physicsClientId=self._client,
            )
        return self._shapes[shape]
