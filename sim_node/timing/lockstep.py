"""The lockstep barrier: a tick ends when every required degree of freedom has a command."""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence
from enum import StrEnum
from types import MappingProxyType

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray, all_finite
from msgs_config.errors import CommandError

_TICKS_REMEMBERED = 1000  # past ticks whose commands are remembered
NO_LEADERS: Mapping[str, str] = MappingProxyType({})


class CommandStatus(StrEnum):
    """The verdict on a command."""

    ACCEPTED = "accepted"
    DUPLICATE = "duplicate"  # repeats a command that was accepted
    CONFLICT = "conflict"  # differs from what was taken for the same state; it may come late, too
    STALE = "stale"  # answers an earlier state, too late, and contradicts nothing that was taken
    FUTURE = "future"  # answers a state that was never published
    REJECTED = "rejected"  # malformed; nothing of it is taken


class CommandCollector(ABC):
    """Checks and counts commands; a subclass decides which of them make the effort of a tick."""

    def __init__(
        self, dof_names: Sequence[str], allowed: BoolArray, leaders: Mapping[str, str] = NO_LEADERS
    ) -> None:
        """Only entries that are `allowed` (n,) may be commanded; `leaders` are by the follower."""
        self._dof_names, self._leaders = tuple(dof_names), leaders
        self._allowed = allowed
        self._allowed_indices: IntArray | None = None  # the last that were found allowed
        self.stamp_ns = 0
        self.conflict: str | None = None  # the first entry of the tick's last conflict
        self.counts: Counter[CommandStatus] = Counter()

    def submit(self, stamp_ns: int, indices: IntArray, effort: FloatArray) -> CommandStatus:
        """Take a command: `effort` (m,) for the entries `indices` (m,), answering `stamp_ns`.

        Raises:
            CommandError: the lengths differ, a number is not finite, or an entry may not be
                commanded; nothing of the command is taken.
        """
        self._check(indices, effort)
        status = self._take(stamp_ns, indices, effort)
        self.counts[status] += 1
        return status

    @abstractmethod
    def _take(self, stamp_ns: int, indices: IntArray, effort: FloatArray) -> CommandStatus:
        """Take a command that is well-formed, or not; which, its status says."""

    def _check(self, indices: IntArray, effort: FloatArray) -> None:
        if len(indices) != len(effort):
            raise CommandError(f"{len(indices)} names but {len(effort)} efforts")
        if len(indices) == 0:
            raise CommandError("an empty command")
        if not all_finite(effort):
            worst = int(np.argmin(np.isfinite(effort)))
            name = self._dof_names[indices[worst]]
            raise CommandError(f"effort of '{name}' is {effort[worst]}; it must be finite")
        # A sender's indices stay one array object, so that its identity says they are checked.
        if indices is not self._allowed_indices:
            self._check_allowed(indices)
            self._allowed_indices = indices

    def _check_allowed(self, indices: IntArray) -> None:
        if not self._allowed[indices].all():
            name = self._dof_names[indices[int(np.argmin(self._allowed[indices]))]]
            hint = "; root_assistance of controller_node is on" if name.startswith("root_") else ""
            if name in self._leaders:
                hint = f"; it mimics '{self._leaders[name]}' and has no motor"
            raise CommandError(f"'{name}' is not among the commanded joints{hint}")


class _Tick:
    """The commands of one tick."""

    def __init__(self, size: int) -> None:
        self.given: BoolArray = np.zeros(size, dtype=np.bool_)
        self.effort: FloatArray = np.zeros(size)
        self.is_empty = True


class LockstepBarrier(CommandCollector):
    """Collects the commands that answer one state, until they cover all required entries.

    The entries that may be commanded are those that must be. Several senders may share them.
    The ticks before are remembered for a while: a second sender of the same entries that is a
    little slower than the first is one too many, and not only late.
    """

    def __init__(
        self, dof_names: Sequence[str], required: BoolArray, leaders: Mapping[str, str] = NO_LEADERS
    ) -> None:
        super().__init__(dof_names, required, leaders)
        self._past: dict[int, _Tick] = {}  # by stamp, the oldest first
        self._required = np.count_nonzero(required)
        self._begin()

    def begin_tick(self, stamp_ns: int) -> None:
        """Begin to wait for the commands that answer the state of this stamp."""
        if stamp_ns != self.stamp_ns:
            if self._filled is not None:
                self._tick.given &= ~self._filled
            self._past[self.stamp_ns] = self._tick
            if len(self._past) > _TICKS_REMEMBERED:
                del self._past[next(iter(self._past))]
        self.stamp_ns = stamp_ns
        self._begin()

    def clear(self) -> None:
        """Discard the commands of the episode before."""
        self._past.clear()
        self._begin()

    def _begin(self) -> None:
        self._tick = _Tick(len(self._allowed))
        self._filled: BoolArray | None = None  # (n,) entries that no sender has commanded
        self.complete = self._required == 0
        """Whether every required entry has its command."""
        self.conflict = None

    @property
    def effort(self) -> FloatArray:
        """The effort (n,) collected so far; zero where nothing was commanded."""
        return self._tick.effort

    @property
    def missing(self) -> list[str]:
        """Names of the required entries that still lack a command."""
        return [self._dof_names[entry] for entry in np.flatnonzero(self._lacking)]

    def fill_missing(self, effort: FloatArray) -> None:
        """Complete the tick with the entries of `effort` (n,) wherever a command is missing."""
        lacking = self._lacking
        self._filled = lacking if self._filled is None else self._filled | lacking
        self._tick.effort[lacking] = effort[lacking]
        self._tick.given |= lacking
        self._tick.is_empty = False
        self.complete = True

    @property
    def _lacking(self) -> BoolArray:
        lacking: BoolArray = self._allowed & ~self._tick.given
        return lacking

    def _take(self, stamp_ns: int, indices: IntArray, effort: FloatArray) -> CommandStatus:
        if stamp_ns > self.stamp_ns:
            return CommandStatus.FUTURE
        tick = self._tick if stamp_ns == self.stamp_ns else self._past.get(stamp_ns)
        if tick is None:
            return CommandStatus.STALE
        if not tick.is_empty:
            given = tick.given[indices]
            differs = given & (tick.effort[indices] != effort)
            if differs.any():
                self.conflict = self._dof_names[indices[int(np.argmax(differs))]]
                return CommandStatus.CONFLICT
            if given.all() and tick is self._tick:
                return CommandStatus.DUPLICATE
        if tick is not self._tick:
            return CommandStatus.STALE
        tick.effort[indices] = effort
        tick.given[indices] = True
        tick.is_empty = False
        self.complete = np.count_nonzero(tick.given) == self._required
        return CommandStatus.ACCEPTED
