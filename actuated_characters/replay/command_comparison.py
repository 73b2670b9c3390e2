"""Compares a controller's commands with the recorded ones."""

from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.recording import CommandArrays, Recording
from actuated_characters.metrics.error_measures import different_bits
from actuated_characters.replay.comparison import EFFORT, Difference, clock_of
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.layout import JointLayout


@dataclass(frozen=True)
class JointDifference:
    """The differences of one joint's effort over all ticks that were compared, N m or N."""

    name: str
    mean: float  # mean size of the difference
    largest: float
    recorded: float  # the mean size of what was recorded, to compare the two with


@dataclass(frozen=True)
class CommandComparison:
    """The outcome of a comparison of commands."""

    states: int  # states whose answers were compared
    first: Difference | None  # the first that is not the same to the last bit
    largest: Difference | None
    joints: tuple[JointDifference, ...]  # one for each joint that is commanded
    lacking: tuple[str, ...]  # degrees of freedom that were commanded then, and are not now

    @property
    def identical(self) -> bool:
        """Whether all are the same to the last bit."""
        return self.first is None and not self.lacking

    def within(self, tolerance: float) -> bool:
        """Whether no command differs by more than a tolerance, N m or N."""
        return not self.lacking and self.largest_difference <= tolerance

    @property
    def largest_difference(self) -> float:
        """By how much a command differs at the most, N m or N."""
        return 0.0 if self.largest is None else abs(self.largest.apart)


def merge_commands(layout: JointLayout, commands: tuple[CommandArrays, ...]) -> FloatArray:
    """The effort (n,) that commands add up to, of equal entries the first; NaN where none is.

    What the simulator would reject, an unknown name or a number that is not finite, is left out.
    """
    effort = np.full(layout.size, np.nan)
    indices = {name: index for index, name in enumerate(layout.dof_names)}
    for command in commands:
        for name, value in zip(command.names, command.efforts.tolist(), strict=False):
            index = indices.get(name)
            if index is not None and np.isnan(effort[index]) and np.isfinite(value):
                effort[index] = value
    return effort


def recorded_commands(recording: Recording) -> FloatArray:
    """The commands (t + 1, n) that answer each state of a recording, NaN where there are none."""
    return np.array([merge_commands(recording.layout, each) for each in recording.commands])


def compare_commands(recording: Recording, received: FloatArray) -> CommandComparison:
    """Compare the answers to the states (r, n), NaN where there is none, with the recorded ones.

    Only what both have is compared: the states that were answered, up to the last one received.
    """
    rows = min(len(received), len(recording.stamps_ns))
    recorded, received = recorded_commands(recording)[:rows], received[:rows]
    both = ~np.isnan(recorded) & ~np.isnan(received)
    answered = ~np.isnan(received).all(axis=1, keepdims=True)
    lacks = np.flatnonzero((answered & ~np.isnan(recorded) & ~both).any(axis=0))
    differs = both & different_bits(recorded, received)
    apart = np.where(both, np.abs(received - recorded), 0.0)
    first = largest = None
    if differs.any():
        sizes = np.where(differs, apart, -1.0)
        first, largest = (
            _difference(recording, recorded, received, int(np.argmax(each)))
            for each in (differs, sizes)
        )
    return CommandComparison(
        states=int(both.any(axis=1).sum()),
        first=first,
        largest=largest,
        joints=_by_joint(recording, recorded, apart, both),
        lacking=tuple(recording.layout.dof_names[entry] for entry in lacks),
    )


def _difference(
    recording: Recording, recorded: FloatArray, received: FloatArray, flat: int
) -> Difference:
    row, entry = divmod(flat, recorded.shape[1])
    stamp_ns, name = int(recording.stamps_ns[row]), recording.layout.dof_names[entry]
    before, now = float(recorded[row, entry]), float(received[row, entry])
    sentence = (
        f"command of '{name}' is {now!r}, recorded is {before!r}, {abs(now - before):.3g} apart"
    )
    tick = clock_of(recording).tick(stamp_ns)
    return Difference(tick, stamp_ns, EFFORT, name, before, now, sentence, recording.name)


def _by_joint(
    recording: Recording, recorded: FloatArray, apart: FloatArray, both: BoolArray
) -> tuple[JointDifference, ...]:
    """Of each physical vector; a ball joint's difference is the length of the vectors'."""
    layout, rows = recording.layout, both.any(axis=1)
    lengths = layout.norms(apart[rows])
    sizes = layout.norms(np.where(both, recorded, 0.0)[rows])
    return tuple(
        JointDifference(
            name,
            mean=float(lengths[:, vector].mean()),
            largest=float(lengths[:, vector].max()),
            recorded=float(sizes[:, vector].mean()),
        )
        for vector, name in enumerate(recording.character.vector_names)
        if both[:, layout.vector_starts[vector]].any()
    )
