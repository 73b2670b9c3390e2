"""The events of a recording: pushes, pins, throws, resets, changed parameters, modes, a fall."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from itertools import chain, pairwise
from typing import Any

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.bags.thrown_balls import thrown_balls
from actuated_characters.metrics.recording_metrics import pin_spans, push_spans
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND

PUSH, THROW, RESET, CHANGE, MODE, FALL = "push", "throw", "reset", "change", "mode", "fall"
"""Kinds of events; a pin is marked as a push is."""

TRACK = "TRACK"
"""The mode in which the reference is tracked."""

_MOST_SHOWN = 3  # numbers of a list that are shown


@dataclass(frozen=True)
class Event:
    """Something that happened in a run, at a moment or for a time."""

    kind: str  # PUSH, THROW, RESET, CHANGE, MODE or FALL
    start: float  # s since the first state
    duration: float = 0.0  # s: of a push or pin, of a mode, and of the episode after a reset
    text: str = ""
    label: str = ""  # a mode's name in a legend
    facts: Mapping[str, Any] = field(default_factory=dict)  # the numbers in the text


def find_events(recording: Recording, fell_at: float | None = None) -> list[Event]:
    """All that happened, by its start; without modes where there is none but tracking.

    `fell_at` is when the character fell, s since the first state; None if it did not.
    """
    modes = mode_events(recording)
    found = [
        *_resets(recording),
        *_pushes(recording),
        *throw_events(recording),
        *(modes if any(event.label != TRACK for event in modes) else ()),
        *change_events(recording),
    ]
    if fell_at is not None:
        found.append(Event(FALL, fell_at, text="it fell"))
    return sorted(found, key=lambda event: event.start)


def mode_events(recording: Recording) -> list[Event]:
    """The modes one after another, each until the next or the end; none without a behaviour.

    Of a state machine the label is the state, and the foot that stands.
    """
    changes = recording.modes
    first_ns, last_ns = (int(recording.stamps_ns[row]) for row in (0, -1))
    stamps = np.clip([*(change.stamp_ns for change in changes), last_ns], first_ns, last_ns)
    starts, lengths = (stamps - first_ns).tolist(), np.diff(stamps).tolist()
    events = []
    for change, start_ns, length_ns in zip(changes, starts, lengths, strict=False):
        duration, facts = length_ns / NANOSECONDS_PER_SECOND, change.facts
        text = f"{change.mode} for {duration:.4g} s"
        if facts:
            text += f": {', '.join(f'{name} {_shown(value)}' for name, value in facts.items())}"
        state, stance = facts.get("state"), facts.get("stance")
        label = change.mode if state is None else f"{state}, {stance}"
        facts = {"mode": change.mode, **facts}
        start = start_ns / NANOSECONDS_PER_SECOND
        events.append(Event(MODE, start, duration, text, label, facts))
    return events


def throw_events(recording: Recording) -> list[Event]:
    """The balls in the order in which they were thrown; each episode's first is `ball_1`."""
    events, times = list[Event](), recording.times
    for ball in chain(*thrown_balls(recording).values()):
        throw = ball.throw
        speed = float(np.linalg.norm(throw.velocity))
        text = f"{ball.name} thrown: {throw.mass:.4g} kg, {throw.describe_size()}, {speed:.4g} m/s"
        size = {"radius": throw.radius} if throw.size is None else {"size": list(throw.size)}
        facts = {"mass": throw.mass, **size, "speed": speed}
        events.append(Event(THROW, float(times[ball.tick]), text=text, facts=facts))
    return events


def change_events(recording: Recording) -> list[Event]:
    """The nodes' parameters that were changed, each after the last state with its old value."""
    first_ns, events = int(recording.stamps_ns[0]), []
    for settings in (recording.simulator, recording.controller):
        for earlier, later in pairwise(settings):
            # Without a stamp it is another controller, or the same one restarted.
            after_ns = first_ns if later.after_stamp_ns is None else later.after_stamp_ns
            start = (after_ns - first_ns) / NANOSECONDS_PER_SECOND
            changed = differences(earlier.parameters, later.parameters)
            for name, (before, after) in changed.items():
                text = f"{name}: {_shown(before)} to {_shown(after)}"
                facts = {"name": name, "before": before, "after": after}
                events.append(Event(CHANGE, start, text=text, facts=facts))
    return events


def differences(
    first: Mapping[str, Any], second: Mapping[str, Any]
) -> dict[str, tuple[object, object]]:
    """Both values of each parameter that differs; None for one that is not there."""
    return {
        name: (first.get(name), second.get(name))
        for name in sorted(first.keys() | second.keys())
        if first.get(name) != second.get(name) or (name in first) != (name in second)
    }


def _resets(recording: Recording) -> list[Event]:
    times, rows = recording.times, recording.episode_rows
    starts = times[rows[1:]].tolist()
    ends = times[np.append(rows[2:] - 1, len(times) - 1)].tolist()
    return [
        Event(RESET, start, end - start, f"reset; the episode lasts {end - start:.4g} s")
        for start, end in zip(starts, ends, strict=False)
    ]


def _pushes(recording: Recording) -> list[Event]:
    return [
        Event(
            PUSH,
            push.start,
            push.duration,
            f"{what} {push.link} for {push.duration:.3g} s: up to {push.largest_force:.4g} N, "
            f"{push.impulse:.4g} N s",
            facts=asdict(push),
        )
        for what, spans in (("push on", push_spans), ("pin holds", pin_spans))
        for push in spans(recording)
    ]


def _shown(value: object) -> str:
    """A value, a long list by its first entries."""
    if isinstance(value, list) and len(value) > _MOST_SHOWN:
        first = ", ".join(map(_shown, value[:_MOST_SHOWN]))
        return f"[{first}, ... {len(value)} in all]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
