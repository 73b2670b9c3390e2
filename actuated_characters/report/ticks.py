"""The ticks of a bag's characters and the gaps between its messages, in one reading of them all."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from actuated_characters.bags.character_timeline import CharacterTimeline
from actuated_characters.bags.collecting import collect
from actuated_characters.bags.reader import RecordedMessage, read_messages
from actuated_characters.bags.recording import Recording, make_recordings
from actuated_characters.metrics.error_measures import effort_sizes, limit_shares
from actuated_characters.metrics.recording_metrics import (
    fall_time,
    plan_errors,
    saturated_shares,
)
from actuated_characters.report.contents import Contents, read_number
from actuated_characters.report.events import Event, find_events
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.errors import ActuatedCharactersError
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND

_PERCENTILES = (50, 99)
_PAUSE_FACTOR = 10.0  # in usual times between two states: a pause is longer ...
_LEAST_PAUSE = 0.1  # s: ... and longer than this
_MIN_REPETITIONS = 8  # a state that takes long so often is usual ...
_SHARE = 0.01  # ... if it has this share of all, as with a planner every few states
_LONGEST_BACKLOG = 0.1  # s that the simulator catches up with; beyond it its schedule starts over


@dataclass(frozen=True)
class Pause:
    """A time in which no state came."""

    start: float  # s of simulated time since the first state
    duration: float  # s of wall time


@dataclass(frozen=True)
class TickFacts:
    """The ticks of one character; without events where its recording is not whole."""

    name: str  # its topics' namespace
    ticks: int  # from the first state to the last, those that are missing included
    sim_time_s: float
    repeated: int  # messages whose state had come before
    missing: list[tuple[int, int]]  # first and last tick of each gap
    missing_count: int
    tick_us: dict[str, float]  # percentiles of the wall time from state to state, without pauses
    pauses: list[Pause]
    late: dict[str, float]  # where the wall clock paces: ticks that were late, and by how much
    events: list[Event] = field(default_factory=list)
    saturated_shares: dict[str, float] = field(default_factory=dict)  # of its ticks, by joint
    # m by the time ahead, s: mean distance of the centre of mass from where plans had predicted it
    plan_errors: dict[float, float] = field(default_factory=dict)
    absent: list[str] = field(default_factory=list)  # names of what was not recorded


class _Gaps:
    """Takes note of the times of messages that pass."""

    def __init__(self) -> None:
        self.largest_ns: dict[str, int] = {}  # by topic, between two that follow each other
        self.has_wall_times = True
        self.first_ns, self.last_ns = 0, 0
        self.is_complete = False  # whether all messages have passed
        self._last_ns: dict[str, int] = {}  # by topic

    def watched(self, messages: Iterable[RecordedMessage]) -> Iterator[RecordedMessage]:
        """Yield the messages."""
        for message in messages:
            topic, sent_ns = message.topic, message.sent_ns
            self.has_wall_times &= message.published_ns is not None
            self.first_ns = min(self.first_ns or sent_ns, sent_ns)
            self.last_ns = max(self.last_ns, sent_ns)
            if topic in self._last_ns:
                gap_ns = sent_ns - self._last_ns[topic]
                self.largest_ns[topic] = max(self.largest_ns.get(topic, 0), gap_ns)
            self._last_ns[topic] = sent_ns
            yield message
        self.is_complete = True

    def added_to(self, contents: Contents) -> Contents:
        """The contents with largest gaps and wall times, as far as these are known."""
        if not self.has_wall_times or not self.last_ns:
            return contents
        gaps = {name: gap_ns / NANOSECONDS_PER_SECOND for name, gap_ns in self.largest_ns.items()}
        return replace(
            contents,
            start_ns=self.first_ns,
            wall_time_s=(self.last_ns - self.first_ns) / NANOSECONDS_PER_SECOND,
            topics=tuple(
                replace(each, largest_gap_s=gaps.get(each.name)) for each in contents.topics
            ),
        )


def read_ticks(contents: Contents) -> tuple[Contents, list[TickFacts]]:
    """Read all messages of a bag: its contents with what follows from them, and the ticks.

    Raises:
        RecordingError: the bag is damaged.
    """
    bag, gaps, lacks = Path(contents.bag), _Gaps(), contents.lacks
    messages = gaps.watched(read_messages(bag))
    timelines: list[CharacterTimeline] = []
    recordings: dict[str, Recording] = {}
    try:
        timelines, worlds = collect(bag, messages=messages)
        recordings = {each.name: each for each in make_recordings(bag, timelines, worlds)}
    except ActuatedCharactersError as error:
        lacks = lacks or str(error)
        for _ in messages:  # the gaps of topics are known all the same
            pass
        if not gaps.is_complete:
            raise
    facts = [
        _facts(timeline, recordings.get(timeline.namespace))
        for timeline in timelines
        if timeline.rebuilt is not None and len(timeline.states.stamps_ns)
    ]
    whole = replace(
        contents,
        sim_time_s=max((each.sim_time_s for each in facts), default=contents.sim_time_s),
        lacks=lacks,
    )
    return gaps.added_to(whole), facts


def _facts(timeline: CharacterTimeline, recording: Recording | None) -> TickFacts:
    parameters = timeline.simulator.parameters[0].parameters
    stamps, published = (
        timeline.states.integers("stamps_ns"),
        timeline.states.integers("published_ns"),
    )
    missing = sum(last - first + 1 for first, last in timeline.gaps)
    since = (stamps - stamps[0]) / NANOSECONDS_PER_SECOND
    period = _pace_period(parameters)
    if not timeline.has_wall_times:
        published, period = published[:0], 0.0
    gaps, steps = pauses(published), np.diff(published) / NANOSECONDS_PER_SECOND
    late = lateness(published, period)[1:] if period else np.zeros(0)
    counted = {"ticks": float((late > period).sum())} if period else {}
    facts = TickFacts(
        name=timeline.namespace,
        ticks=len(stamps) - 1 + missing,
        sim_time_s=float(since[-1]),
        repeated=timeline.repeated,
        missing=timeline.gaps,
        missing_count=missing,
        tick_us=_percentiles_us(np.delete(steps, gaps)),
        pauses=[Pause(float(since[row]), float(steps[row])) for row in gaps],
        late=counted | _percentiles_us(late),
    )
    return facts if recording is None else _with_events(facts, recording)


def _with_events(facts: TickFacts, recording: Recording) -> TickFacts:
    names, limits = recording.character.vector_names, recording.character.effort_limits()
    shares = saturated_shares(
        limit_shares(effort_sizes(recording.layout, recording.effort), limits)
    )
    recorded = {
        "reference": not np.isnan(recording.reference_position).all(),
        "contacts": bool(recording.contacts),
        "pushes": bool(recording.applied_wrench),
    }
    return replace(
        facts,
        events=find_events(recording, fall_time(recording)),
        saturated_shares={
            name: float(share)
            for name, share, limit in zip(names, shares, limits, strict=True)
            if math.isfinite(limit) and not math.isnan(share)
        },
        plan_errors={ahead: float(each.mean()) for ahead, each in plan_errors(recording).items()},
        absent=[name for name, is_there in recorded.items() if not is_there],
    )


def _pace_period(parameters: Mapping[str, Any]) -> float:
    """Wall time from tick to tick, s, by a simulator's parameters; 0 if nothing paces it."""
    rate = read_number(parameters.get("rate")) or 0.0
    factor = read_number(parameters.get("real_time_factor")) or 0.0
    if parameters.get("mode") == "realtime":
        factor = factor or 1.0
    return 1.0 / (factor * rate) if rate > 0.0 and factor > 0.0 else 0.0


def _percentiles_us(seconds: FloatArray) -> dict[str, float]:
    if not len(seconds):
        return {}
    values = 1e6 * np.percentile(seconds, _PERCENTILES)
    named = {f"p{p}_us": float(v) for p, v in zip(_PERCENTILES, values, strict=True)}
    return named | {"max_us": 1e6 * float(seconds.max())}


def pauses(published_ns: IntArray) -> IntArray:
    """Rows of the states after which the next one took far longer than usual."""
    steps = np.diff(published_ns) / NANOSECONDS_PER_SECOND
    if not len(steps):
        return np.zeros(0, dtype=np.intp)
    longest = max(_LEAST_PAUSE, _PAUSE_FACTOR * float(np.median(steps)))
    long = steps[steps > longest]
    if len(long) >= max(_MIN_REPETITIONS, _SHARE * len(steps)):
        longest = _PAUSE_FACTOR * float(np.median(long))
    return np.flatnonzero(steps > longest)


def lateness(published_ns: IntArray, period: float) -> FloatArray:
    """Lateness (m,) of each state by the schedule of a paced run, s; negative for an early one.

    The schedule is the simulator's: a period in s of wall time from state to state, which catches
    up after a short delay, and restarts at the first state, after a long delay and after a pause.
    """
    after_pauses = set((pauses(published_ns) + 1).tolist())
    times = ((published_ns - published_ns[:1]) / NANOSECONDS_PER_SECOND).tolist()
    late = np.zeros(len(times))
    due = 0.0
    for row, time in enumerate(times):
        if row in after_pauses:
            due = time
        late[row] = time - due
        if late[row] > max(_LONGEST_BACKLOG, period):
            due = time
        due += period
    return late
