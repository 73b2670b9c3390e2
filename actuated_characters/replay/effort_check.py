"""Checks the efforts of a recording against the commands in it.

What was applied is a pure function of what was commanded (clipped, delayed, held), so the two tell
the same thing twice, and a bit that is wrong in either one shows, even where the engine's rounding
would hide it. What never acted has left no trace, and does not show: what a limit has cut away of
a command, and the commands for an episode's last states, after which no tick came.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from actuated_characters.bags.recording import CommandArrays, Recording
from actuated_characters.metrics.error_measures import different_bits
from actuated_characters.replay.comparison import EFFORT, Difference, clock_of, same_bits, unit_of
from actuated_characters.replay.world import of_character, simulator_values
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.errors import LayoutError
from msgs_config.parameters import Values
from sim_node.initial_state import CharacterSettings
from sim_node.node_settings import NodeSettings
from sim_node.physics.settings import SimulationSettings

_ARRIVAL_TICKS = 2  # ticks by which the arrival of a command without a stamp is uncertain


@dataclass(frozen=True)
class CommandCheck:
    """The outcome of a check of a recording's efforts against its commands."""

    difference: Difference | None  # the first effort that no command can have led to
    silent_stamps_ns: tuple[int, ...]  # stamps of states to which the recording lacks commands


class _RecordedTick(NamedTuple):
    """A tick of the lockstep, and the commands that it may have applied."""

    row: int  # row of its effort, and of the state that it begins with
    answered: int | None  # row of the state whose commands act; None before the first ones do
    previous: FloatArray  # (n,) what was commanded in the tick before
    collected: FloatArray  # (n,) what the commands add up to; of several with an entry, the first
    silent: BoolArray  # (n,) entries of a command that there must have been but was not recorded


def first_uncommanded(recordings: Sequence[Recording]) -> tuple[Difference | None, list[str]]:
    """The first effort that no command can have led to, and remarks on what could not be checked.

    Raises:
        RecordingError: see `check_commands`.
    """
    found: list[Difference] = []
    remarks: list[str] = []
    for recording in recordings:
        of = of_character(recording)
        if not recording.layout.size:
            continue
        if not (recording.unstamped_commands or any(recording.commands)):
            remarks.append(
                f"the recording has no commands{of}: its efforts were not compared with commands"
            )
            continue
        check = check_commands(recording)
        if check.silent_stamps_ns:
            remarks.append(
                f"the recording lacks commands{of} for {len(check.silent_stamps_ns)} states, the "
                f"first at {check.silent_stamps_ns[0]} ns: the efforts there were not compared "
                "with commands"
            )
        if check.difference is not None:
            found.append(check.difference)
    return min(found, key=lambda difference: difference.tick, default=None), remarks


def check_commands(recording: Recording) -> CommandCheck:
    """Look for applied efforts that no command can have led to.

    In lockstep each is the clip of what was commanded `command_delay_ticks` before, to the bit,
    and with `on_timeout` also what that fills in. In real time each is zero or the clip of a
    command that was there then, as it is held for a time that may have been changed meanwhile.

    Raises:
        RecordingError: this simulator does not have the recorded parameters.
    """
    values = simulator_values(recording)
    check = _Check(recording, values)
    found = (
        check.check_realtime()
        if NodeSettings.of(values).is_realtime
        else check.check_lockstep(values)
    )
    difference = next((each for each in found if each is not None), None)
    return CommandCheck(difference, tuple(recording.stamps_ns[check.silent_rows].tolist()))


class _Check:
    """Checks the ticks of a recording."""

    def __init__(self, recording: Recording, values: Values) -> None:
        self._recording = recording
        self._layout = recording.layout
        self._limits = recording.character.effort_limits()
        self._commanded: BoolArray = self._layout.mask(
            CharacterSettings.of(values).commanded_joints
        )
        self._delay = SimulationSettings.of(values).command_delay_ticks
        self._zero = np.zeros(self._layout.size)
        self.silent_rows: list[int] = []

    def check_lockstep(self, values: Values) -> Iterator[Difference | None]:
        """Yield what is wrong with a tick; None where other commands explain it."""
        self._on_timeout = NodeSettings.of(values).on_timeout
        for first, end in self._episodes():
            previous = self._zero
            for row in range(first + self._unknown_ticks(first), end):
                tick = self._tick(row, first, previous)
                if not same_bits(self._clip(tick.collected), self._recording.effort[row]):
                    yield self._settle(tick)
                previous = tick.collected

    def _unknown_ticks(self, first: int) -> int:
        """The ticks from a row on in which commands act that are not in the recording."""
        if first or self._recording.keyframe is None:
            return 0
        return self._delay + (self._on_timeout == "hold")

    def _episodes(self) -> Iterator[tuple[int, int]]:
        """The first tick of each episode and the one after its last, which may be a reset."""
        firsts = self._recording.episode_rows.tolist()
        ends = [first - 1 for first in firsts[1:]] + [len(self._recording.effort)]
        yield from zip(firsts, ends, strict=True)

    def _usable(self, row: int | None) -> list[tuple[CommandArrays, IntArray]]:
        """The commands that answer a state and were not rejected, each with its entries."""
        commands = () if row is None else self._recording.commands[row]
        pairs = [(command, self._entries(command)) for command in commands]
        return [(command, entries) for command, entries in pairs if entries is not None]

    def _entries(self, command: CommandArrays) -> IntArray | None:
        """The entries of a command; None if the simulator rejected it for its names."""
        try:
            indices = self._layout.indices(command.names)
        except LayoutError:
            return None
        fits = len(indices) == len(command.efforts) and self._commanded[indices].all()
        return indices if fits else None

    def _tick(self, row: int, first: int, previous: FloatArray) -> _RecordedTick:
        """The tick of a row, in an episode that begins at row `first`."""
        answered = row - self._delay if row - self._delay >= first else None
        fills = answered is None or self._on_timeout in ("hold", "zero")
        is_held = answered is not None and self._on_timeout == "hold"
        effort = previous.copy() if is_held else self._zero.copy()
        silent = np.zeros_like(self._commanded) if fills else self._commanded.copy()
        for command, indices in reversed(self._usable(answered)):
            effort[indices] = command.efforts
            silent[indices] = False
        if answered is not None and silent.any():
            self.silent_rows.append(answered)
        return _RecordedTick(row, answered, previous, effort, silent)

    def _settle(self, tick: _RecordedTick) -> Difference | None:
        """Look for other commands of the tick that led to what was applied, joint by joint."""
        applied = self._recording.effort[tick.row]
        candidates = [tick.collected]
        for command, indices in self._usable(tick.answered):
            candidate = tick.collected.copy()
            candidate[indices] = command.efforts
            candidates.append(candidate)
        if tick.answered is not None:
            candidates += {"hold": [tick.previous], "zero": [self._zero]}.get(self._on_timeout, [])
        clipped = [self._clip(each) for each in candidates]
        for joint in self._layout.joints:
            for entries in joint.vectors:
                if tick.silent[entries].any():
                    continue
                for candidate, effort in zip(candidates, clipped, strict=True):
                    if not different_bits(effort[entries], applied[entries]).any():
                        tick.collected[entries] = candidate[entries]  # `hold` repeats it next
                        break
                else:
                    return self._difference(tick, entries.start, clipped[0])
        return None

    def _difference(self, tick: _RecordedTick, start: int, clipped: FloatArray) -> Difference:
        """The difference of the vector that begins at an entry: of that of its entries it is in."""
        applied = self._recording.effort[tick.row]
        # where one entry was changed beyond the limit, the clip has changed the others with it
        wrong = different_bits(clipped, applied)
        odd = wrong & different_bits(tick.collected + 0.0, applied)
        index = start + int(np.argmax(odd[start:] if odd[start:].any() else wrong[start:]))
        commanded, unit = tick.collected[index], unit_of(self._layout, index, EFFORT)
        reason = f"but {float(commanded)!r} {unit} was commanded"
        if clipped[index] != commanded:
            reason += f" and clipped to {float(clipped[index])!r}"
        if not self._commanded[index]:
            reason = "but it may not be commanded"
        elif tick.answered is None:
            reason = f"but the first {self._delay} ticks of an episode have no command"
        if tick.answered is not None and self._delay:
            reason += f" {self._delay} ticks before"
        return self._found(tick.row, index, float(clipped[index]), reason)

    def _found(self, row: int, index: int, expected: float, reason: str) -> Difference:
        """The difference of an entry of the effort that was applied in the tick of a row."""
        name, stamp_ns = self._layout.dof_names[index], int(self._recording.stamps_ns[row + 1])
        applied = float(self._recording.effort[row, index])
        unit = unit_of(self._layout, index, EFFORT)
        sentence = f"effort of '{name}' was {applied!r} {unit} in joint_states, {reason}"
        tick, character = clock_of(self._recording).tick(stamp_ns), self._recording.name
        return Difference(tick, stamp_ns, EFFORT, name, applied, expected, sentence, character)

    def check_realtime(self) -> Iterator[Difference]:
        """Yield what is wrong with a tick."""
        later = _ARRIVAL_TICKS if self._recording.unstamped_commands else 0
        for first, end in self._episodes():
            sent = deque(self._sent(first, end))
            known = [{0} for _ in range(self._layout.size)]  # bits that an entry can have; 0 is 0.0
            if not first and self._recording.keyframe is not None:  # one may be held from before
                held = self._recording.effort[: self._delay + 1 + later].view(np.int64)
                known = [{0, *bits} for bits in held.T.tolist()]
            for row in range(first, end):
                answered = row - self._delay
                while sent and first <= answered and sent[0][0] <= answered + later:
                    _, effort, indices = sent.popleft()
                    bits = effort.view(np.int64).tolist()
                    for index in indices.tolist():
                        known[index].add(bits[index])
                applied = self._recording.effort[row].view(np.int64).tolist()
                unknown = [n for n, bits in enumerate(applied) if bits not in known[n]]
                if unknown:
                    yield self._found(row, unknown[0], 0.0, "but no command can have led to that")

    def _sent(self, first: int, end: int) -> list[tuple[int, FloatArray, IntArray]]:
        """The commands of an episode, in the order of the rows of the states that they answer.

        Each with that row, the clipped effort (n,), and the entries that it is for.
        """
        rows = [(row, each) for row in range(first, end) for each in self._recording.commands[row]]
        unstamped = self._recording.unstamped_commands
        if unstamped:
            sent_ns = [command.published_ns for command in unstamped]
            arrivals = np.searchsorted(self._recording.published_ns, sent_ns, side="right") - 1
            pairs = zip(arrivals.tolist(), unstamped, strict=True)
            rows += [pair for pair in pairs if first <= pair[0] < end]
        sent = []
        for row, command in sorted(rows, key=lambda pair: pair[0]):
            indices = self._entries(command)
            if indices is not None:
                effort = np.zeros(self._layout.size)
                effort[indices] = command.efforts
                sent.append((row, self._clip(effort), indices))
        return sent

    def _clip(self, effort: FloatArray) -> FloatArray:
        return self._layout.clipped(effort + 0.0, self._limits)
