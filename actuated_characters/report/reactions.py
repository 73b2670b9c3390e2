"""What was thrown in a recording, and what its character did about it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from actuated_characters.bags.recording import Recording
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND

TRACK = "TRACK"
"""The mode of who follows its reference."""


@dataclass(frozen=True)
class ModeSpan:
    """A time in one mode of a behaviour."""

    mode: str
    start: float  # s since the first state
    duration: float  # s
    facts: Mapping[str, Any]  # what led to it


@dataclass(frozen=True)
class ThrowMark:
    """A ball that was let go."""

    name: str
    start: float  # s since the first state
    mass: float  # kg
    radius: float  # m
    speed: float  # m/s


def mode_spans(recording: Recording) -> list[ModeSpan]:
    """The modes one after another, each until the next or the end; none if nobody said any."""
    changes = recording.modes
    first_ns, last_ns = (int(recording.stamps_ns[row]) for row in (0, -1))
    ends = [change.stamp_ns for change in changes[1:]] + [last_ns] * bool(changes)
    spans = []
    for change, end in zip(changes, ends, strict=True):
        start_ns, end_ns = (min(max(at, first_ns), last_ns) for at in (change.stamp_ns, end))
        start, duration = start_ns - first_ns, end_ns - start_ns
        second = NANOSECONDS_PER_SECOND
        spans.append(ModeSpan(change.mode, start / second, duration / second, change.facts))
    return spans


def throw_marks(recording: Recording) -> list[ThrowMark]:
    """The balls in the order in which they were thrown."""
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
    """What it is, in words."""
    return (
        f"{throw.name} thrown: {throw.mass:.4g} kg, radius {throw.radius:.3g} m, "
        f"{throw.speed:.4g} m/s"
    )


def mode_line(span: ModeSpan) -> str:
    """What it is, in words."""
    facts = ", ".join(f"{name} {_shown(value)}" for name, value in span.facts.items())
    return f"{span.mode} for {span.duration:.4g} s" + (f": {facts}" if facts else "")


def _shown(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
