"""The lockstep barrier: the tick goes on when every required degree of freedom has a command.

No ROS and no engine in here: a state machine over stamps, names and numbers.
"""

from collections import Counter
from collections.abc import Sequence
from enum import Enum

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.errors import CommandError


class Verdict(Enum):
    """What the barrier made of a command."""

    ACCEPTED = "accepted"
    DUPLICATE = "duplicate"  # repeats what it has already
    CONFLICT = "conflict"  # differs from what it has already; nothing of it is taken
    STALE = "stale"  # answers an earlier state
    FUTURE = "future"  # answers a state that was never published
    REJECTED = "rejected"  # malformed; nothing of it is taken


class LockstepBarrier:
    """Collects the commands that answer one state, until they cover all required entries.

    `required` (n,) is both what must be commanded and what may be. Several senders may share it.
    """

    def __init__(self, dof_names: Sequence[str], required: BoolArray) -> None:
        self._dof_names = tuple(dof_names)
        self._required = required
        self._given = np.zeros_like(required)
        self._effort = np.zeros(len(required))
        self._missing = int(required.sum())
        self.stamp_ns = 0
        self.conflict: str | None = None  # the first entry of the last conflict
        self.counts: Counter[Verdict] = Counter()

    def open(self, stamp_ns: int) -> None:
        """Begin to wait for the commands that answer the state of this stamp."""
        self.stamp_ns = stamp_ns
        self.conflict = None
        self._given[:] = False
        self._effort = np.zeros(len(self._required))
        self._missing = int(self._required.sum())

    @property
    def complete(self) -> bool:
        """Whether every required entry has its command."""
        return self._missing == 0

    @property
    def effort(self) -> FloatArray:
        """The effort (n,) collected so far; zero where nothing was commanded."""
        return self._effort

    @property
    def missing(self) -> list[str]:
        """Names of the required entries that still lack a command."""
        lacking = self._required & ~self._given
        return [name for name, lacks in zip(self._dof_names, lacking, strict=True) if lacks]

    def offer(self, stamp_ns: int, indices: IntArray, effort: FloatArray) -> Verdict:
        """Take a command: `effort` (m,) for the entries `indices` (m,), answering `stamp_ns`.

        Raises:
            CommandError: the lengths differ, a number is not finite, or an entry may not be
                commanded; nothing of the command is taken.
        """
        self._check(indices, effort)
        verdict = self._judge(stamp_ns, indices, effort)
        self.counts[verdict] += 1
        if verdict is Verdict.ACCEPTED:
            self._effort[indices] = effort
            self._given[indices] = True
            self._missing = int((self._required & ~self._given).sum())
        return verdict

    def count_rejected(self) -> None:
        """Count a command that was refused, here or before it could be offered."""
        self.counts[Verdict.REJECTED] += 1

    def fill_missing(self, effort: FloatArray) -> None:
        """Complete the tick with the entries of `effort` (n,) wherever a command is missing."""
        lacking = self._required & ~self._given
        self._effort[lacking] = effort[lacking]
        self._given |= lacking
        self._missing = 0

    def _judge(self, stamp_ns: int, indices: IntArray, effort: FloatArray) -> Verdict:
        if stamp_ns != self.stamp_ns:
            return Verdict.STALE if stamp_ns < self.stamp_ns else Verdict.FUTURE
        already = self._given[indices]
        if not already.any():
            return Verdict.ACCEPTED
        differs = already & (self._effort[indices] != effort)
        if differs.any():
            self.conflict = self._dof_names[indices[int(np.argmax(differs))]]
            return Verdict.CONFLICT
        return Verdict.DUPLICATE if already.all() else Verdict.ACCEPTED

    def _check(self, indices: IntArray, effort: FloatArray) -> None:
        if len(indices) != len(effort):
            raise CommandError(f"{len(indices)} names but {len(effort)} efforts")
        if len(indices) == 0:
            raise CommandError("an empty command")
        if not np.isfinite(effort).all():
            worst = int(np.argmin(np.isfinite(effort)))
            name = self._dof_names[indices[worst]]
            raise CommandError(f"effort of '{name}' is {effort[worst]}; it must be finite")
        if not self._required[indices].all():
            name = self._dof_names[indices[int(np.argmin(self._required[indices]))]]
            hint = "; root_assistance of controller_node is on" if name.startswith("root_") else ""
            raise CommandError(f"'{name}' is not among the commanded joints{hint}")
