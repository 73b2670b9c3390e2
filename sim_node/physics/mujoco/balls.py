"""Balls in MuJoCo's world: solid spheres and boxes that are thrown into it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.mujoco.model import ball_link
from sim_node.physics.mujoco.part import Part

if TYPE_CHECKING:
    from sim_node.physics.mujoco.world import MujocoWorld

_AWAY_DISTANCE = 10_000.0  # m along x: where a ball lies that was taken out of the way


class Ball(Part):
    """One ball."""

    def __init__(self, number: int, throw: ProjectileThrow) -> None:
        super().__init__([ball_link(number, throw)])
        self.throw = throw

    def let_go(self, data: mujoco.MjData) -> None:
        """Put it where it is thrown, with the velocity of the throw."""
        self.move(data, self.throw.position, self.throw.turn_xyzw)
        data.qvel[self.place.velocities] = (*self.throw.velocity, 0.0, 0.0, 0.0)

    def move(
        self,
        data: mujoco.MjData,
        centre: FloatArray | Sequence[float],
        turn_xyzw: FloatArray | Sequence[float],
    ) -> None:
        """Put its centre (3,) somewhere, m, turned."""
        turn = rotations.wxyz_from_xyzw(np.array(turn_xyzw))
        data.qpos[self.place.positions] = (*centre, *turn)


class MujocoBalls:
    """The balls of a world, in the order in which they were thrown."""

    def __init__(self, world: "MujocoWorld") -> None:
        self._world = world
        self.balls: list[Ball] = []

    @property
    def throws(self) -> tuple[ProjectileThrow, ...]:
        """The throw of each ball."""
        return tuple(ball.throw for ball in self.balls)

    def add(self, throw: ProjectileThrow) -> None:
        """Let a ball go: put it into the world with the position and velocity of the throw."""
        self._world.check_open()
        self.balls.append(Ball(len(self.balls), throw))
        self._world.is_outdated = True

    def replace(self, throws: Sequence[ProjectileThrow]) -> None:
        """Have the balls of these throws and no others; where they are is left open.

        A state that is restored afterwards says where they are.
        """
        if tuple(throws) != self.throws:
            self.balls = [Ball(number, throw) for number, throw in enumerate(throws)]
            self._world.is_outdated = True

    def put_away(self, ball: int) -> None:
        """Put a ball, by its place in the order, far away: on the ground, where that is a plane.

        It stays a body of the engine, as it does with Bullet.
        """
        self.place(ball, (_AWAY_DISTANCE, 20.0 * ball, self.balls[ball].throw.half_edges[2]))
        self._world.data.qvel[self.balls[ball].place.velocities] = 0.0

    def place(
        self,
        ball: int,
        centre: FloatArray | Sequence[float],
        turn_xyzw: FloatArray | Sequence[float] = rotations.IDENTITY_XYZW,
    ) -> None:
        """Put the centre of a ball, by its place in the order, to a point (3,), m, turned (4,)."""
        data = self._world.data
        self.balls[ball].move(data, centre, turn_xyzw)
        self._world.forget_frames()

    def set_motion(self, motion: FloatArray) -> None:
        """Give the balls a motion (m, 13), as `motion` returns it."""
        data = self._world.data
        for ball, row in zip(self.balls, motion, strict=True):
            ball.move(data, row[:3], row[3:7])
            spin = rotations.rotate(rotations.conjugate(row[3:7]), row[10:])
            data.qvel[ball.place.velocities] = (*row[7:10], *spin)
        self._world.forget_frames()

    def motion(self) -> FloatArray:
        """Centre m, orientation xyzw, velocity m/s, angular velocity rad/s, world: (m, 13)."""
        data, rows = self._world.data, []
        for ball in self.balls:
            position, velocity = data.qpos[ball.place.positions], data.qvel[ball.place.velocities]
            turn = rotations.xyzw_from_wxyz(position[3:])
            spin = rotations.rotate(turn, velocity[3:])  # MuJoCo's is in the ball's own axes
            rows.append((*position[:3], *turn, *velocity[:3], *spin))
        return np.array(rows, dtype=float).reshape(-1, 13)
