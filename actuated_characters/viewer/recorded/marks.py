"""What is marked on the time line of a recorded run: when something has happened in it."""

from dataclasses import dataclass, replace

from actuated_characters.bags.keyframes import find_keyframes
from actuated_characters.bags.recording import Recording, find_bag
from actuated_characters.metrics.recording_metrics import fall_time
from actuated_characters.report.charts import mode_colors
from actuated_characters.report.events import MODE, PUSH, RESET, THROW, find_events
from actuated_characters.viewer.recorded.hits import find_hits
from actuated_characters.viewer.recorded.run import RecordedRun
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND

HIT, KEYFRAME, END = "hit", "keyframe", "end"
"""Kinds of marks beside those of events."""


@dataclass(frozen=True)
class Mark:
    """Something on the time line."""

    kind: str  # of an event, or HIT, KEYFRAME or END
    start: float  # s since the first state
    end: float  # s; the start, where it is a moment
    text: str
    label: str = ""  # what stands on a span
    color: str = ""  # of a mode, as a page has it
    lane: int = 0  # number of the character that has the mode, or of the row below others
    item: str = ""  # what it is called where it can be dragged; empty: it cannot


def find_marks(run: RecordedRun) -> list[Mark]:
    """All marks of a run, by their start, in the time of the run that it is beside.

    Raises:
        ActuatedCharactersError: its bag cannot be read.
    """
    several = len(run.recordings) > 1
    marks = [
        mark
        for number, recording in enumerate(run.recordings)
        for mark in _marks_of(recording, several=several, number=number)
    ]
    last = float(run.times[-1])
    marks += [*_keyframes(run), Mark(END, last, last, "the last state")]
    marks.sort(key=lambda mark: mark.start)
    since = run.starts
    return [replace(mark, start=mark.start + since, end=mark.end + since) for mark in marks]


def _marks_of(recording: Recording, *, several: bool, number: int) -> list[Mark]:
    """Events of one character, by its number, and hits; the world's are the first character's."""
    events = find_events(recording, fall_time(recording) if recording.parameters else None)
    colors = mode_colors(events)
    name = f"{recording.name}: " if several else ""
    marks = [
        Mark(
            each.kind,
            each.start,
            each.start + (each.duration if each.kind in (MODE, PUSH) else 0.0),
            name + each.text,
            each.label,
            colors[each.label] if each.kind == MODE else "",
            number if each.kind == MODE else 0,
        )
        for each in events
        if number == 0 or each.kind not in (THROW, RESET)
    ]
    return marks + [
        Mark(HIT, hit.time, hit.time, f"{name}{hit.ball} hits {hit.link}: {hit.impulse:.3g} N s")
        for hit in find_hits(recording)
    ]


def _keyframes(run: RecordedRun) -> list[Mark]:
    """Where a fork can begin, if that is not at the first state alone."""
    if not run.can_be_forked:
        return []
    found = find_keyframes(find_bag(run.path))
    first_ns, last_ns = (int(run.recordings[0].stamps_ns[row]) for row in (0, -1))
    stamps = [place.stamp_ns for place in (found.places if found is not None else ())]
    within = [stamp_ns for stamp_ns in stamps if first_ns <= stamp_ns <= last_ns]
    times = [(stamp_ns - first_ns) / NANOSECONDS_PER_SECOND for stamp_ns in within]
    if not any(time > 0.0 for time in times):
        return []
    return [Mark(KEYFRAME, time, time, "keyframe: a fork begins here") for time in times]
