"""Walking and running at any speed, blended from captured cycles.

A cycle is split into a point that moves evenly over the ground and the pose above it. Poses of
equal phase are blended, and the lengths of the strides with them; the frequency follows from the
speed. Source: Park, Shin and Shin 2002, "On-line Locomotion Generation Based on Motion Blending";
a standing pose is the slowest of the cycles here.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller_node.references.base import Reference
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.errors import ConfigurationError
from msgs_config.geometry import fixed_order, rotations

_ROWS = 96  # steps of phase in a cycle
_LEAST_SPEED = 0.05  # m/s
_MOST_TURN = 0.5  # rad a cycle, at most; the turn is taken out


@dataclass(frozen=True)
class GaitCycle:
    """One cycle along x: poses at equal steps of its phase, above a point that moves evenly."""

    stride: float  # m a cycle
    period: float  # s
    positions: FloatArray  # (r + 1, n), but for rotations; the last is the first once more
    orientations_xyzw: FloatArray  # (r + 1, k, 4)

    @property
    def speed(self) -> float:
        """Mean speed in m/s."""
        return self.stride / self.period

    def pose(self, phase: float) -> GeneralizedPosition:
        """The pose at a phase from 0 to 1; only `orientations_xyzw` has its rotations."""
        rows = len(self.positions) - 1
        row = min(int(phase * rows), rows - 1)
        pair = slice(row, row + 2)
        pose = GeneralizedPosition(self.positions[pair], self.orientations_xyzw[pair])
        return _between(_row(pose, 0), _row(pose, 1), phase * rows - row)


def cycle_of(name: str, reference: Reference, period: float) -> GaitCycle:
    """The cycle of a reference that repeats its pose every `period` s, turned to go along x.

    Raises:
        ConfigurationError: it goes nowhere, or not straight ahead; names it.
    """
    states = [reference.sample(period * row / _ROWS).configuration for row in range(_ROWS + 1)]
    positions = np.array([state.position for state in states])
    turns = np.array([state.orientations_xyzw for state in states])
    x, y = (positions[-1, :2] - positions[0, :2]).tolist()
    stride = math.sqrt(x * x + y * y)
    bend = float(rotations.yaw(rotations.multiply(turns[-1, 0], rotations.conjugate(turns[0, 0]))))
    if stride / period < _LEAST_SPEED or abs(bend) > _MOST_TURN:
        raise ConfigurationError(
            f"clip '{name}' moves by {stride:.3g} m and turns by {bend:.3g} rad a cycle; to steer, "
            "it must go straight ahead"
        )
    heading = math.atan2(y, x)
    phases = np.arange(_ROWS + 1) / _ROWS
    positions[:, :3] = rotations.rotate(rotations.about_z(-heading), positions[:, :3])
    positions[:, 0] -= stride * phases
    positions[:, :2] -= fixed_order.mean(positions[:-1, :2], axis=0)
    straight = [rotations.about_z(-heading - bend * (phase - 0.5)) for phase in phases.tolist()]
    turns[:, 0] = rotations.multiply(np.array(straight), turns[:, 0])
    return GaitCycle(stride, period, positions, turns)


def standing_cycle(pose: GeneralizedPosition, period: float) -> GaitCycle:
    """A pose as a cycle that goes nowhere."""
    position = pose.position.copy()
    position[:2] = 0.0
    turns = pose.orientations_xyzw
    return GaitCycle(0.0, period, np.array([position, position]), np.array([turns, turns]))


class Gait:
    """Cycles of rising speed, as one motion of any speed up to the fastest."""

    def __init__(self, cycles: Sequence[GaitCycle]) -> None:
        """Blend two cycles or more.

        Raises:
            ConfigurationError: one is not faster than the one before.
        """
        self._cycles = cycles
        self._speeds = [cycle.speed for cycle in cycles]
        for slow, fast in zip(self._speeds, self._speeds[1:], strict=False):
            if fast <= slow:
                raise ConfigurationError(
                    f"a cycle of {fast:.3g} m/s follows one of {slow:.3g} m/s; to steer, the clip "
                    "to run must be faster than the one to walk"
                )

    @property
    def speeds(self) -> tuple[float, ...]:
        """Mean speeds of the cycles, m/s."""
        return tuple(self._speeds)

    def _around(self, speed: float) -> tuple[GaitCycle, GaitCycle, float]:
        """The cycles around a speed, and the share of the faster one."""
        row = 1
        while row < len(self._speeds) - 1 and speed >= self._speeds[row]:
            row += 1
        slow, fast = self._cycles[row - 1], self._cycles[row]
        share = (speed - slow.speed) / (fast.speed - slow.speed)
        return slow, fast, min(max(share, 0.0), 1.0)

    def frequency(self, speed: float) -> float:
        """Cycles a second at a speed in m/s; negative backwards, and zero for one that stands."""
        slow, fast, share = self._around(abs(speed))
        stride = slow.stride + share * (fast.stride - slow.stride)
        return speed / stride if stride > 0.0 else 0.0

    def pose(self, speed: float, phase: float) -> GeneralizedPosition:
        """The pose at a speed in m/s and a phase from 0 to 1, above the origin, along x.

        Only `orientations_xyzw` has its rotations.
        """
        slow, fast, share = self._around(abs(speed))
        if share == 0.0:
            return slow.pose(phase)
        return _between(slow.pose(phase), fast.pose(phase), share)


def _row(poses: GeneralizedPosition, row: int) -> GeneralizedPosition:
    return GeneralizedPosition(poses.position[row], poses.orientations_xyzw[row])


def _between(a: GeneralizedPosition, b: GeneralizedPosition, share: float) -> GeneralizedPosition:
    """Linear between coordinates, along the shorter turn between rotations."""
    inverse = rotations.conjugate(a.orientations_xyzw)
    turn = rotations.log(rotations.multiply(inverse, b.orientations_xyzw))
    return GeneralizedPosition(
        a.position + share * (b.position - a.position),
        rotations.multiply(a.orientations_xyzw, rotations.exp(share * turn)),
    )
