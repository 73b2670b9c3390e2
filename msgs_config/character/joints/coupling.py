"""The coupling of a character's joints: followers, each of which mimics a leader.

`q_f = a q_l + b`. With G (n, n) that keeps all entries but a follower's, which it makes `a` times
its leader's, velocities are `G v`, and by virtual work an effort f acts as `G^T f`: what is given
to a follower acts on its leader, `a` times.
"""

from collections.abc import Mapping

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.character.urdf.mimic import Mimic


class Coupling:
    """Which entries of a layout follow which; false where none does."""

    def __init__(self, layout: JointLayout, mimics: Mapping[str, Mimic]) -> None:
        """`mimics` by the follower's name; each leader follows none itself."""
        pairs = [(layout.joint(name).start, mimic) for name, mimic in mimics.items()]
        self.followers = np.array([entry for entry, _ in pairs], dtype=np.intp)  # (k,)
        self.leaders = np.array([layout.joint(m.leader).start for _, m in pairs], dtype=np.intp)
        self.multipliers: FloatArray = np.array([mimic.multiplier for _, mimic in pairs])  # (k,)
        self.offsets: FloatArray = np.array([mimic.offset for _, mimic in pairs])  # (k,) rad or m

    def __bool__(self) -> bool:
        return bool(len(self.followers))

    def position(self, position: FloatArray) -> FloatArray:
        """A position (..., n), rad or m, with the followers where their leaders say."""
        coupled = self.velocity(position)
        coupled[..., self.followers] += self.offsets
        return coupled

    def velocity(self, velocity: FloatArray) -> FloatArray:
        """A velocity or an acceleration (..., n) with the followers' as their leaders' say."""
        coupled = velocity.copy()
        coupled[..., self.followers] = self.multipliers * velocity[..., self.leaders]
        return coupled

    def effort(self, effort: FloatArray) -> FloatArray:
        """An effort (n,), N m or N, with the followers' moved to their leaders."""
        moved = effort.copy()
        moved[self.followers] = 0.0
        for leader, multiplier, follower in zip(
            self.leaders, self.multipliers, self.followers, strict=True
        ):
            moved[leader] += multiplier * effort[follower]
        return moved

    def matrix(self, size: int) -> FloatArray:
        """G (n, n) of n entries."""
        matrix = np.eye(size)
        matrix[self.followers] = 0.0
        matrix[self.followers, self.leaders] = self.multipliers
        return matrix

    def rows(self, size: int) -> FloatArray:
        """The rows J (k, n) of `J v = 0`, one a follower: 1 at it, -a at its leader."""
        rows = np.zeros((len(self.followers), size))
        numbers = np.arange(len(self.followers))
        rows[numbers, self.followers] = 1.0
        rows[numbers, self.leaders] -= self.multipliers
        return rows

    def violation(self, position: FloatArray) -> FloatArray:
        """How far (k,) each follower is from where its leader says, rad or m."""
        return self.violation_rate(position) - self.offsets

    def violation_rate(self, velocity: FloatArray) -> FloatArray:
        """The rate (k,) of `violation`, rad/s or m/s: `J v`."""
        follower, leader = velocity[self.followers], velocity[self.leaders]
        rate: FloatArray = follower - self.multipliers * leader
        return rate

    def leader_bounds(self, lower: FloatArray, upper: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The bounds (n,) of all entries, a leader's also such that its followers are in theirs."""
        lower, upper = lower.copy(), upper.copy()
        for follower, leader, multiplier, offset in zip(
            self.followers, self.leaders, self.multipliers, self.offsets, strict=True
        ):
            if multiplier == 0.0:
                continue
            ends = sorted(
                (each - offset) / multiplier for each in (lower[follower], upper[follower])
            )
            lower[leader] = max(lower[leader], ends[0])
            upper[leader] = min(upper[leader], ends[1])
        return lower, upper
