"""Real time: the last commands are held while the world goes on by the wall clock."""

from collections.abc import Mapping, Sequence

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from sim_node.timing.lockstep import NO_LEADERS, CommandCollector, CommandStatus

_NEVER_TICK = -1


class ZeroOrderHold(CommandCollector):
    """The last command of each degree of freedom, held until it is too old; then zero.

    A tick never waits: it is always complete. Of two commands in conflict the later one is taken.
    A command without a stamp answers the last state.
    """

    complete = True
    missing: Sequence[str] = ()

    def __init__(
        self,
        dof_names: Sequence[str],
        allowed: BoolArray,
        timeout_ns: int,
        leaders: Mapping[str, str] = NO_LEADERS,
    ) -> None:
        """`allowed` (n,) may be commanded; `timeout_ns` is simulated time."""
        super().__init__(dof_names, allowed, leaders)
        self._effort = np.zeros(len(allowed))
        self._given_ns = np.full(len(allowed), _NEVER_TICK, dtype=np.int64)
        self._stamp_of_command_ns = np.full(len(allowed), _NEVER_TICK, dtype=np.int64)
        self._oldest_ns = 0  # stamp of the oldest state that a command of this episode can answer
        self.timeout_ns = timeout_ns
        self.timeouts = 0  # times that a held command became too old
        self._was_held = np.zeros(len(allowed), dtype=np.bool_)

    def begin_tick(self, stamp_ns: int) -> None:
        """Go on to the tick of the state of this stamp."""
        self.stamp_ns = stamp_ns
        self.conflict = None
        is_held = self._is_held
        self.timeouts += bool((self._was_held & ~is_held).any())
        self._was_held = is_held

    def clear(self) -> None:
        """Discard all commands, and those on their way: the next tick begins a new episode."""
        self._oldest_ns = self.stamp_ns + 1
        self._given_ns[:] = _NEVER_TICK
        self._was_held[:] = False

    @property
    def effort(self) -> FloatArray:
        """The effort (n,) of this tick; zero where no command is held."""
        return np.where(self._is_held, self._effort, 0.0)

    @property
    def age_ns(self) -> int | None:
        """Age of the oldest command that is held; None without any."""
        is_held = self._is_held
        return int(self.stamp_ns - self._given_ns[is_held].min()) if is_held.any() else None

    @property
    def _is_held(self) -> BoolArray:
        is_held: BoolArray = (self._given_ns != _NEVER_TICK) & (
            self.stamp_ns - self._given_ns < self.timeout_ns
        )
        return is_held

    def _take(self, stamp_ns: int, indices: IntArray, effort: FloatArray) -> CommandStatus:
        answered_ns = stamp_ns or self.stamp_ns
        status = self._judge(stamp_ns, answered_ns, indices, effort)
        if status in (CommandStatus.ACCEPTED, CommandStatus.CONFLICT):
            self._effort[indices] = effort
            self._given_ns[indices] = answered_ns
            self._stamp_of_command_ns[indices] = stamp_ns
            self._was_held[indices] = True
        return status

    def _judge(
        self, stamp_ns: int, answered_ns: int, indices: IntArray, effort: FloatArray
    ) -> CommandStatus:
        if answered_ns > self.stamp_ns:
            return CommandStatus.FUTURE
        oldest_ns = max(self._oldest_ns, int(self._given_ns[indices].max()))
        if answered_ns < oldest_ns or self.stamp_ns - answered_ns >= self.timeout_ns:
            return CommandStatus.STALE
        if stamp_ns:
            same = self._stamp_of_command_ns[indices] == stamp_ns
            differs = same & (self._effort[indices] != effort)
            if differs.any():
                self.conflict = self._dof_names[indices[int(np.argmax(differs))]]
                return CommandStatus.CONFLICT
            if same.all():
                return CommandStatus.DUPLICATE
        return CommandStatus.ACCEPTED
