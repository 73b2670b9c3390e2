"""Checks the efforts of a recording against the commands in it.

What was applied is a pure function of what was commanded (clipped, delayed, held), so the two tell
the same thing twice, and a bit that is wrong in either one shows, even where the engine's rounding
would hide it. What never acted has left no trace, and does not show: what a limit has cut away of
a command, and the commands for an episode's last states, after which no tick came.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.recording import CommandArrays, Recording
from actuated_characters.replay.comparison import EFFORT, Difference, differing, same_bits, unit_of
from actuated_characters.replay.world import simulator_values
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.errors import LayoutError
from msgs_config.messages.clock import TickClock
from msgs_config.parameters import Values
from sim_node.node_settings import make_node_settings

_ARRIVAL_TICKS = 2  # by which the arrival of a command without a stamp is uncertain


def has_commands(recording: Recording) -> bool:
    """Whether the recording says what was commanded."""
    return bool(recording.unstamped_commands) or any(recording.commands)


@dataclass(frozen=True)
class CommandCheck:
    """What the commands of a recording say of its efforts."""

    difference: Difference | None  # the first effort that no command can have led to
    silent_stamps_ns: tuple[int, ...]  # of states to which the recording has not all commands


def check_commands(recording: Recording) -> CommandCheck:
    """Look for applied efforts that no command can have led to.

    In lockstep each is the clip of what was commanded `command_delay_ticks` before, to the bit,
    and with `on_timeout` also what that fills in. In real time each is zero or the clip of a
    command that was young enough then.

    Raises:
        RecordingError: the simulator's parameters are none of this simulator's.
    """
    check = _Check(recording, simulator_values(recording))
    rows = check.realtime_rows() if check.is_realtime else check.lockstep_rows()
    difference = next((found for found in rows if found is not None), None)
    return CommandCheck(difference, tuple(recording.stamps_ns[check.silent_rows].tolist()))


class _Check:
    """A recording, with what decides on its commands."""

    def __init__(self, recording: Recording, values: Values) -> None:
        settings = make_node_settings(values)
        self.is_realtime = settings.is_realtime
        self._recording = recording
        self._layout = recording.layout
        self._clock = TickClock(values.integer("rate"))
        self._limits = recording.character.effort_limits()
        self._may: BoolArray = self._layout.mask(values.texts("commanded_joints"))
        self._delay = values.integer("command_delay_ticks")
        self._fills = "" if self.is_realtime else settings.on_timeout
        self._timeout_ns = settings.command_timeout_ns
        self._zero = np.zeros(self._layout.size)
        self._nothing = np.zeros(self._layout.size, dtype=np.bool_)
        self.silent_rows: list[int] = []

    def lockstep_rows(self) -> Iterator[Difference | None]:
        """What is wrong with each tick; None where nothing is."""
        for first, end in self._episodes():
            held = self._zero
            for row in range(first, end):
                answered = row - self._delay
                collected, silent = self._zero, self._nothing
                if answered >= first:
                    collected, silent = self._collect(answered, held)
                expected = self._layout.clipped(collected + 0.0, self._limits)
                if not same_bits(expected, self._recording.effort[row]):
                    yield self._settle(row, answered, collected, held, first, silent)
                held = collected

    def _episodes(self) -> Iterator[tuple[int, int]]:
        """The first tick of each episode and the one after its last, which may be a reset."""
        firsts = self._recording.episode_rows.tolist()
        ends = [first - 1 for first in firsts[1:]] + [len(self._recording.effort)]
        yield from zip(firsts, ends, strict=True)

    def _usable(self, command: CommandArrays) -> IntArray | None:
        """The entries that a command is for; None if the simulator refused it for its names."""
        try:
            indices = self._layout.indices(command.names)
        except LayoutError:
            return None
        fits = len(indices) == len(command.efforts) and self._may[indices].all()
        return indices if fits else None

    def _collect(self, row: int, held: FloatArray) -> tuple[FloatArray, BoolArray]:
        """The effort (n,) that the commands for a state add up to; what comes first counts.

        Also which entries (n,) must have been commanded, by a command that was not recorded.
        """
        effort = held.copy() if self._fills == "hold" else self._zero.copy()
        silent = self._nothing if self._fills in ("hold", "zero") else self._may.copy()
        for command in reversed(self._recording.commands[row]):
            indices = self._usable(command)
            if indices is not None:
                effort[indices] = command.efforts
                silent[indices] = False
        if silent.any():
            self.silent_rows.append(row)
        return effort, silent

    def _settle(
        self,
        row: int,
        answered: int,
        collected: FloatArray,
        held: FloatArray,
        first: int,
        silent: BoolArray,
    ) -> Difference | None:
        """Look for other commands of that tick that led to what was applied, joint by joint."""
        applied = self._recording.effort[row]
        candidates = [collected]
        if answered >= first:
            for command in self._recording.commands[answered]:
                indices = self._usable(command)
                if indices is not None:
                    candidate = collected.copy()
                    candidate[indices] = command.efforts
                    candidates.append(candidate)
            candidates += {"hold": [held], "zero": [self._zero]}.get(self._fills, [])
        clipped = [self._layout.clipped(each + 0.0, self._limits) for each in candidates]
        for start, length in zip(
            self._layout.vector_starts.tolist(), self._layout.vector_lengths.tolist(), strict=True
        ):
            entries = slice(start, start + length)
            if silent[entries].any():
                continue
            for candidate, effort in zip(candidates, clipped, strict=True):
                if same_bits(effort[entries], applied[entries]):
                    collected[entries] = candidate[entries]  # is what `hold` holds next
                    break
            else:
                return self._difference(row, answered, start, collected, clipped[0], first)
        return None

    def _difference(
        self,
        row: int,
        answered: int,
        start: int,
        collected: FloatArray,
        clipped: FloatArray,
        first: int,
    ) -> Difference:
        """The difference of the vector that begins at an entry: of that of its entries it is in."""
        applied = self._recording.effort[row]
        # where one entry was changed beyond the limit, the clip has changed the others with it
        wrong = [index for index in differing(clipped, applied) if index >= start]
        odd = [index for index in wrong if index in differing(collected + 0.0, applied)]
        index = (odd or wrong)[0]
        unit = unit_of(self._layout, index, EFFORT)
        commanded = f"but {float(collected[index])!r} {unit} was commanded"
        if clipped[index] != collected[index]:
            commanded += f" and clipped to {float(clipped[index])!r}"
        if not self._may[index]:
            commanded = "but it may not be commanded"
        elif answered < first:
            commanded = f"but the first {self._delay} ticks of an episode have no command"
        if answered >= first and self._delay:
            commanded += f" {self._delay} ticks before"
        return self._found(row, index, float(clipped[index]), commanded)

    def _found(self, row: int, index: int, expected: float, commanded: str) -> Difference:
        name, stamp_ns = self._layout.dof_names[index], int(self._recording.stamps_ns[row + 1])
        applied, unit = (
            float(self._recording.effort[row, index]),
            unit_of(self._layout, index, EFFORT),
        )
        return Difference(
            tick=self._clock.tick(stamp_ns),
            stamp_ns=stamp_ns,
            quantity=EFFORT,
            name=name,
            recorded=applied,
            found=expected,
            sentence=f"effort of '{name}' was {applied!r} {unit} in joint_states, {commanded}",
            character=self._recording.name,
        )

    def realtime_rows(self) -> Iterator[Difference | None]:
        """What is wrong with each tick; None where nothing is."""
        stamps = self._recording.stamps_ns
        later = _ARRIVAL_TICKS if self._recording.unstamped_commands else 0
        for first, end in self._episodes():
            sent = self._sent(first, end)
            for row in range(first, end):
                applied = self._recording.effort[row]
                answered, nothing = row - self._delay, applied.view(np.int64) == 0
                known = nothing.copy()
                if answered >= first:
                    oldest_ns = stamps[answered] - self._timeout_ns
                    oldest = int(np.searchsorted(stamps, oldest_ns, side="right"))
                    known |= sent.match(applied, max(oldest, first), answered)
                    if not known.all():  # the timeout may have been changed while it ran
                        known |= sent.match(applied, first, answered + later)
                if not known.all():
                    index = int(np.argmin(known))
                    yield self._found(row, index, 0.0, "but no command can have led to that")

    def _sent(self, first: int, end: int) -> "_Sent":
        """The commands of an episode, each clipped, in the order of the states they answer."""
        rows = [(row, each) for row in range(first, end) for each in self._recording.commands[row]]
        unstamped = self._recording.unstamped_commands
        if unstamped:
            sent_ns = [command.published_ns for command in unstamped]
            arrivals = np.searchsorted(self._recording.published_ns, sent_ns, side="right") - 1
            pairs = zip(arrivals.tolist(), unstamped, strict=True)
            rows = sorted(
                [*rows, *(pair for pair in pairs if first <= pair[0] < end)], key=lambda p: p[0]
            )
        usable = [(row, each, self._usable(each)) for row, each in rows]
        return _Sent(
            [
                (row, self._clip(each, entries), entries)
                for row, each, entries in usable
                if entries is not None
            ],
            self._layout.size,
        )

    def _clip(self, command: CommandArrays, indices: IntArray) -> FloatArray:
        effort = self._zero.copy()
        effort[indices] = command.efforts
        return self._layout.clipped(effort + 0.0, self._limits)


class _Sent:
    """Commands of an episode, clipped."""

    def __init__(self, commands: Sequence[tuple[int, FloatArray, IntArray]], size: int) -> None:
        self._rows = np.array([row for row, _, _ in commands], dtype=np.intp)  # they answer
        efforts = [effort for _, effort, _ in commands]
        self._bits = np.array(efforts).reshape(-1, size).view(np.int64)
        self._given = np.zeros(self._bits.shape, dtype=np.bool_)
        for number, (_, _, indices) in enumerate(commands):
            self._given[number, indices] = True

    def match(self, applied: FloatArray, first: int, last: int) -> BoolArray:
        """Which entries (n,) are those of a command that answers the states `first` to `last`."""
        begin, end = np.searchsorted(self._rows, [first, last + 1])
        same = self._bits[begin:end] == applied.view(np.int64)
        found: BoolArray = (same & self._given[begin:end]).any(axis=0)
        return found
