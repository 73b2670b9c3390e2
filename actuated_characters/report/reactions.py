"""A recording's throws, and the modes of a behaviour that reacts."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from actuated_characters.bags.recording import Recording
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND as _SECOND

TRACK = "TRACK"
"""The mode in which the reference is tracked."""


@dataclass(frozen=True)
class ModeSpan:
    """A time in one mode of a behaviour."""

    mode: str
    start: float  # s since the first state
    duration: float  # s
    facts: Mapping[str, Any]  # what led to the mode

    @property
    def label(self) -> str:
        """The mode, or of a state machine its state and the foot that stands."""
        state, stance = self.facts.get("state"), self.facts.get("stance")
        return self.mode if state is None else f"{state}, {stance}"


@dataclass(frozen=True)
class ThrowMark:
    """A ball that was let go."""

    name: str
    start: float  # s since the first state
    mass: float  # kg
    radius: float  # m
    speed: float  # m/s


def mode_spans(recording: Recording) -> list[ModeSpan]:
    """The modes one after another, each until the next or the end; none without a behaviour."""
    changes = recording.modes
    first_ns, last_ns = (int(recording.stamps_ns[row]) for row in (0, -1))
    stamps = np.clip([*(change.stamp_ns for change in changes), last_ns], first_ns, last_ns)
    starts, lengths = stamps - first_ns, np.diff(stamps)
    return [
        ModeSpan(change.mode, int(start) / _SECOND, int(length) / _SECOND, change.facts)
        for change, start, length in zip(changes, starts, lengths, strict=False)
    ]


def throw_marks(recording: Recording) -> list[ThrowMark]:
    """The balls in the order in which they were thrown; each episode's first is `ball_1`."""
    begins, marks, count = set(recording.episode_rows.tolist()), [], 0
    for tick, throws in enumerate(recording.throws):
        count = 0 if tick in begins else count
        for throw in throws:
            count += 1
            speed = float(np.linalg.norm(throw.velocity))
            start = float(recording.times[tick])
            marks.append(ThrowMark(f"ball_{count}", start, throw.mass, throw.radius, speed))
    return marks


def thrown_line(throw: ThrowMark) -> str:
    """A throw in words."""
    return (
        f"{throw.name} thrown: {throw.mass:.4g} kg, radius {throw.radius:.3g} m, "
        f"{throw.speed:.4g} m/s"
    )


def mode_line(span: ModeSpan) -> str:
    """A mode in words."""
    shown = {k: f"{v:.4g}" if isinstance(v, float) else v for k, v in span.facts.items()}
    facts = ", ".join(f"{name} {value}" for name, value in shown.items())
    return f"{span.mode} for {span.duration:.4g} s" + (f": {facts}" if facts else "")
