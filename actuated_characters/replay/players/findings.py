"""How a controller's commands differ from the recorded ones. No ROS in here."""

from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.recording import CommandArrays, Recording
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.messages.clock import TickClock
from msgs_config.shared_parameters import RATE


@dataclass(frozen=True)
class CommandDifference:
    """A command that is not what was recorded."""

    tick: int
    stamp_ns: int
    dof_name: str
    recorded: float  # N m or N
    received: float

    def __str__(self) -> str:
        difference = abs(self.received - self.recorded)
        return (
            f"tick {self.tick} ({self.stamp_ns} ns): command of '{self.dof_name}' is "
            f"{self.received!r}, recorded is {self.recorded!r}, {difference:.3g} apart"
        )


@dataclass(frozen=True)
class JointDifference:
    """The differences of one joint's effort over all ticks that were compared."""

    name: str
    mean: float  # N m or N, of the size of the difference
    largest: float
    recorded: float  # the mean size of what was recorded, to compare the two with


@dataclass(frozen=True)
class CommandFindings:
    """What a comparison of commands has found."""

    states: int  # to which the answers were compared
    first: CommandDifference | None  # the first that is not the same to the last bit
    largest: CommandDifference | None
    joints: tuple[JointDifference, ...]  # of the joints that are commanded
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
        return 0.0 if self.largest is None else abs(self.largest.received - self.largest.recorded)


def merged(layout: JointLayout, commands: tuple[CommandArrays, ...]) -> FloatArray:
    """The effort (n,) that commands say together, the first of each counts; NaN where none does.

    What the simulator would not take, an unknown name or a number that is not finite, says nothing.
    """
    effort = np.full(layout.size, np.nan)
    places = places_of(layout)
    for command in commands:
        for name, value in zip(command.names, command.efforts.tolist(), strict=False):
            place = places.get(name)
            if place is not None and np.isnan(effort[place]) and np.isfinite(value):
                effort[place] = value
    return effort


def places_of(layout: JointLayout) -> dict[str, int]:
    """Where each degree of freedom stands in the layout's arrays."""
    return {name: place for place, name in enumerate(layout.dof_names)}


def commanded(recording: Recording) -> FloatArray:
    """The commands (t + 1, n) that answer each state of a recording, NaN where there are none."""
    if not recording.commands:
        return np.full(recording.position.shape, np.nan)
    return np.array([merged(recording.layout, commands) for commands in recording.commands])


def compare_commands(recording: Recording, received: FloatArray) -> CommandFindings:
    """Compare what answered the states now, (r, n) with NaN where nothing did, with the recorded.

    Only what both have is compared: the states that were answered, up to the last one received.
    """
    rows = min(len(received), len(recording.stamps_ns))
    recorded, received = commanded(recording)[:rows], received[:rows]
    both = ~np.isnan(recorded) & ~np.isnan(received)
    answered = ~np.isnan(received).all(axis=1, keepdims=True)
    lacks = np.flatnonzero((answered & ~np.isnan(recorded) & ~both).any(axis=0))
    differs = both & (recorded.view(np.int64) != np.ascontiguousarray(received).view(np.int64))
    apart = np.where(both, np.abs(received - recorded), 0.0)
    first = largest = None
    if differs.any():
        first = _difference(recording, recorded, received, int(np.argmax(differs)))
        largest = _difference(
            recording, recorded, received, int(np.argmax(np.where(differs, apart, -1.0)))
        )
    return CommandFindings(
        states=int(both.any(axis=1).sum()),
        first=first,
        largest=largest,
        joints=_by_joint(recording, recorded, apart, both),
        lacking=tuple(recording.layout.dof_names[entry] for entry in lacks),
    )


def _difference(
    recording: Recording, recorded: FloatArray, received: FloatArray, flat: int
) -> CommandDifference:
    row, entry = divmod(flat, recorded.shape[1])
    stamp_ns = int(recording.stamps_ns[row])
    return CommandDifference(
        tick=TickClock(int(recording.parameters[RATE.name])).tick(stamp_ns),
        stamp_ns=stamp_ns,
        dof_name=recording.layout.dof_names[entry],
        recorded=float(recorded[row, entry]),
        received=float(received[row, entry]),
    )


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
