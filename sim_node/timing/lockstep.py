"""The lockstep barrier: the tick goes on when every required degree of freedom has a command.

No ROS and no engine in here: a state machine over stamps, names and numbers.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.errors import CommandError

_REMEMBERED = 1000  # ticks


class CommandStatus(Enum):
    """What the barrier made of a command."""

    ACCEPTED = "accepted"
    DUPLICATE = "duplicate"  # repeats what it has already
    CONFLICT = "conflict"  # differs from another for the same state
    STALE = "stale"  # answers an earlier state, and comes too late
    FUTURE = "future"  # answers a state that was never published
    REJECTED = "rejected"  # malformed; nothing of it is taken


@dataclass
class _Tick:
    """What was commanded at one tick."""

    given: BoolArray  # (n,)
    effort: FloatArray  # (n,)

    def conflict(self, indices: IntArray, effort: FloatArray) -> IntArray:
        """Those of the entries that have another command already."""
        conflicting: IntArray = indices[self.given[indices] & (self.effort[indices] != effort)]
        return conflicting


class LockstepBarrier:
    """Collects the commands that answer one state, until they cover all required entries.

    `required` (n,) is both what must be commanded and what may be. Several senders may share it.
    The ticks before are remembered for a while: a second sender of the same entries that is a
    little slower than the first is one too many, and not only late.
    """

    def __init__(self, dof_names: Sequence[str], required: BoolArray) -> None:
        self._dof_names = tuple(dof_names)
        self._required = required
        self._past: dict[int, _Tick] = {}  # by stamp, the oldest first
        self.stamp_ns = 0
        self.counts: Counter[CommandStatus] = Counter()
        self._begin()

    def begin_tick(self, stamp_ns: int) -> None:
        """Begin to wait for the commands that answer the state of this stamp."""
        if stamp_ns != self.stamp_ns:
            self._tick.given &= ~self._filled
            self._past[self.stamp_ns] = self._tick
            if len(self._past) > _REMEMBERED:
                del self._past[next(iter(self._past))]
        self.stamp_ns = stamp_ns
        self._begin()

    def clear(self) -> None:
        """Forget the commands of the episode before."""
        self._past.clear()
        self._begin()

    def _begin(self) -> None:
        self._tick = _Tick(np.zeros_like(self._required), np.zeros(len(self._required)))
        self._filled = np.zeros_like(self._required)  # (n,) what nobody commanded
        self._missing = int(np.count_nonzero(self._required))
        self.conflict: str | None = None  # the first entry of the last conflict

    @property
    def complete(self) -> bool:
        """Whether every required entry has its command."""
        return self._missing == 0

    @property
    def effort(self) -> FloatArray:
        """The effort (n,) collected so far; zero where nothing was commanded."""
        return self._tick.effort

    @property
    def missing(self) -> list[str]:
        """Names of the required entries that still lack a command."""
        lacking = self._required & ~self._tick.given
        return [name for name, lacks in zip(self._dof_names, lacking, strict=True) if lacks]

    def submit(self, stamp_ns: int, indices: IntArray, effort: FloatArray) -> CommandStatus:
        """Take a command: `effort` (m,) for the entries `indices` (m,), answering `stamp_ns`.

        Raises:
            CommandError: the lengths differ, a number is not finite, or an entry may not be
                commanded; nothing of the command is taken.
        """
        check_command(self._dof_names, self._required, indices, effort)
        verdict = self._judge(stamp_ns, indices, effort)
        self.counts[verdict] += 1
        if verdict is CommandStatus.ACCEPTED:
            self._tick.effort[indices] = effort
            self._tick.given[indices] = True
            self._missing = int(np.count_nonzero(self._required & ~self._tick.given))
        return verdict

    def fill_missing(self, effort: FloatArray) -> None:
        """Complete the tick with the entries of `effort` (n,) wherever a command is missing."""
        self._filled = self._required & ~self._tick.given
        self._tick.effort[self._filled] = effort[self._filled]
        self._tick.given |= self._filled
        self._missing = 0

    def _judge(self, stamp_ns: int, indices: IntArray, effort: FloatArray) -> CommandStatus:
        if stamp_ns > self.stamp_ns:
            return CommandStatus.FUTURE
        tick = self._tick if stamp_ns == self.stamp_ns else self._past.get(stamp_ns)
        if tick is None:
            return CommandStatus.STALE
        conflict = tick.conflict(indices, effort)
        if len(conflict):
            self.conflict = self._dof_names[conflict[0]]
            return CommandStatus.CONFLICT
        if tick is not self._tick:
            return CommandStatus.STALE
        return CommandStatus.DUPLICATE if tick.given[indices].all() else CommandStatus.ACCEPTED


def check_command(
    dof_names: Sequence[str], allowed: BoolArray, indices: IntArray, effort: FloatArray
) -> None:
    """Raise CommandError unless a command is whole, finite, and for entries that may be commanded.

    `effort` (m,) is for the entries `indices` (m,); `allowed` is (n,).
    """
    if len(indices) != len(effort):
        raise CommandError(f"{len(indices)} names but {len(effort)} efforts")
    if len(indices) == 0:
        raise CommandError("an empty command")
    if not np.isfinite(effort).all():
        worst = int(np.argmin(np.isfinite(effort)))
        name = dof_names[indices[worst]]
        raise CommandError(f"effort of '{name}' is {effort[worst]}; it must be finite")
    if not allowed[indices].all():
        name = dof_names[indices[int(np.argmin(allowed[indices]))]]
        hint = "; root_assistance of controller_node is on" if name.startswith("root_") else ""
        raise CommandError(f"'{name}' is not among the commanded joints{hint}")
