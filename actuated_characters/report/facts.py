"""The facts of a bag and of the characters in it, as far as they are recorded."""

import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from actuated_characters.bags.recording import Recording, read_recordings
from actuated_characters.metrics.error_measures import effort_sizes, limit_shares
from actuated_characters.metrics.recording_metrics import PushSpan, push_spans, saturated_shares
from actuated_characters.report.changes import (
    Change,
    GainsInForce,
    gains,
    law,
    live_changes,
    number,
)
from actuated_characters.report.contents import Contents, StateMessages, read_contents
from actuated_characters.report.reactions import ModeSpan, ThrowMark, mode_spans, throw_marks
from actuated_characters.report.timing import lateness, pauses, state_times, wall_steps
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.layout import JointType
from msgs_config.errors import ActuatedCharactersError
from msgs_config.versions import read_versions

_PERCENTILES = (50, 99)
_HIGHEST_RATE = 100_000  # Hz


@dataclass(frozen=True)
class Span:
    """A time span in s; its start counts from the first state."""

    start: float
    duration: float


@dataclass(frozen=True)
class StreamFacts:
    """The facts in stamps and wall times of a stream of states, also of an incomplete one."""

    name: str  # of the character: its topics' namespace
    character: str | None
    degrees_of_freedom: int | None
    mass: float | None  # kg
    rate_hz: int | None
    mode: str | None
    versions: dict[str, str]
    states: int  # messages
    repeated: int | None = None  # messages whose state had come before
    ticks: int | None = None  # from the first state to the last, those that are missing included
    sim_time: float | None = None  # s
    missing: list[tuple[int, int]] = field(default_factory=list)  # first and last tick of each gap
    missing_count: int | None = None
    tick_us: dict[str, float] = field(default_factory=dict)  # wall time from state to state
    pauses: list[Span] = field(default_factory=list)  # start in simulated, duration in wall time
    late: dict[str, float] = field(default_factory=dict)  # lateness where the wall clock paces


@dataclass(frozen=True)
class RunFacts:
    """The facts of a complete recording of one character."""

    name: str
    reference: bool  # whether there is a reference
    contacts: bool
    episodes: list[Span]
    resets: int
    law: str | None
    gains: list[GainsInForce]  # those in force at the start
    changes: list[Change]
    pushes: list[PushSpan]
    pushes_recorded: bool
    throws: list[ThrowMark]
    modes: list[ModeSpan]
    saturated_shares: dict[str, float]  # by joint with a limit, of its ticks


@dataclass(frozen=True)
class BagFacts:
    """The facts that `info` prints."""

    contents: Contents
    streams: tuple[StreamFacts, ...]
    runs: tuple[RunFacts, ...]
    lacks: str | None  # why there are no facts of runs


def look_at(path: Path) -> BagFacts:
    """The facts of a run's bag, or of any bag.

    Raises:
        RecordingError: there is no complete bag, or it is damaged.
    """
    contents = read_contents(path)
    streams = tuple(_stream(name, found) for name, found in contents.states.items())
    try:
        recordings = read_recordings(path)
    except ActuatedCharactersError as error:
        return BagFacts(contents, streams, (), str(error))
    return BagFacts(contents, streams, tuple(map(run_facts, recordings)), None)


def _stream(name: str, messages: StateMessages) -> StreamFacts:
    told = _mapping(messages.configuration)
    parameters = told.get("parameters")
    parameters = parameters if isinstance(parameters, dict) else {}
    rate = parameters.get("rate")
    rate = rate if isinstance(rate, int) and 0 < rate <= _HIGHEST_RATE else None
    timing = _timing(messages, rate, parameters) if rate and messages.stamps_ns else {}
    return StreamFacts(
        name=name,
        character=_text(told.get("character")),
        degrees_of_freedom=_degrees_of_freedom(told),
        mass=number(told.get("mass")),
        rate_hz=rate,
        mode=_text(parameters.get("mode")),
        versions=read_versions(told.get("versions")),
        states=len(messages.stamps_ns),
        **timing,
    )


def _timing(messages: StateMessages, rate: int, parameters: dict[str, Any]) -> dict[str, Any]:
    stamps, sent = (np.array(each) for each in (messages.stamps_ns, messages.published_ns))
    times = state_times(stamps, sent, rate)
    ticks = times.ticks
    published = times.published_ns if messages.has_wall_times else times.published_ns[:0]
    gaps, steps = pauses(published), wall_steps(published)
    period = pace_period(parameters) if messages.has_wall_times else 0.0
    since = (ticks - ticks[0]) / rate
    return {
        "repeated": times.repeated,
        "ticks": int(ticks[-1] - ticks[0]),
        "sim_time": float(since[-1]),
        "missing": times.missing,
        "missing_count": times.missing_count,
        "tick_us": _percentiles_us(np.delete(steps, gaps)),
        "pauses": [Span(float(since[row]), float(steps[row])) for row in gaps],
        "late": late_facts(published, period) if period else {},
    }


def pace_period(parameters: dict[str, Any]) -> float:
    """Wall time from tick to tick, s, by a simulator's parameters; 0 if nothing paces it."""
    rate = number(parameters.get("rate")) or 0.0
    factor = number(parameters.get("real_time_factor")) or 0.0
    if parameters.get("mode") == "realtime":
        factor = factor or 1.0
    return 1.0 / (factor * rate) if rate > 0.0 and factor > 0.0 else 0.0


def late_facts(published_ns: IntArray, period: float) -> dict[str, float]:
    """Number of ticks that began more than a period in s late, and percentiles of lateness."""
    late = lateness(published_ns, period)[1:]
    return {"ticks": int((late > period).sum())} | _percentiles_us(late)


def _percentiles_us(seconds: FloatArray) -> dict[str, float]:
    if not len(seconds):
        return {}
    values = 1e6 * np.percentile(seconds, _PERCENTILES)
    named = {f"p{p}_us": float(v) for p, v in zip(_PERCENTILES, values, strict=True)}
    return named | {"max_us": 1e6 * float(seconds.max())}


def _mapping(text: str) -> dict[str, Any]:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}


def _text(value: object) -> str | None:
    return value if isinstance(value, str) else None


def _degrees_of_freedom(told: dict[str, Any]) -> int | None:
    """Number of degrees of freedom of the joints in a configuration."""
    try:
        return sum(len(JointType(joint["type"]).suffixes) for joint in told["joints"])
    except (KeyError, TypeError, ValueError):
        return None


def run_facts(recording: Recording) -> RunFacts:
    """The facts of a complete recording."""
    names, limits = recording.character.vector_names, recording.character.effort_limits()
    sizes = effort_sizes(recording.layout, recording.effort)
    shares = saturated_shares(limit_shares(sizes, limits))
    first = recording.controller[0].parameters if recording.controller else {}
    return RunFacts(
        name=recording.name,
        reference=not bool(np.isnan(recording.reference_position).all()),
        contacts=bool(recording.contacts),
        episodes=episodes(recording),
        resets=len(recording.episode_rows) - 1,
        law=law(first),
        gains=gains(first, names) if recording.controller else [],
        changes=live_changes(recording),
        pushes=push_spans(recording),
        pushes_recorded=bool(recording.applied_wrench),
        throws=throw_marks(recording),
        modes=mode_spans(recording),
        saturated_shares={
            name: float(share)
            for name, share, limit in zip(names, shares, limits, strict=True)
            if math.isfinite(limit) and not math.isnan(share)
        },
    )


def episodes(recording: Recording) -> list[Span]:
    """When each episode began, and how long it lasted, s of simulated time."""
    times, rows = recording.times, recording.episode_rows.tolist()
    ends = [row - 1 for row in rows[1:]] + [len(times) - 1]
    return [
        Span(float(times[row]), float(times[end] - times[row]))
        for row, end in zip(rows, ends, strict=True)
    ]


def as_json(facts: BagFacts) -> str:
    """The facts as JSON; an unknown or infinite number is null."""
    contents = facts.contents
    sim_time = longest_sim_time(facts)
    content = {
        "bag": str(contents.bag),
        "files": contents.files,
        "size_bytes": sum(contents.files.values()),
        "storage": contents.storage,
        "compression": contents.compression,
        "metadata_version": contents.version,
        "ros_distro": contents.ros_distro,
        "forked_from": None if contents.forked_from is None else asdict(contents.forked_from),
        "start_ns": contents.start_ns,
        "wall_time_s": contents.wall_time,
        "sim_time_s": sim_time,
        "topics": [
            {
                "name": topic.name,
                "type": topic.type_name,
                "count": topic.count,
                "rate_wall_hz": topic.rate_hz,
                "rate_sim_hz": topic.count / sim_time if sim_time else None,
                "largest_gap_s": topic.largest_gap,
            }
            for topic in contents.topics
        ],
        "characters": [asdict(stream) for stream in facts.streams],
        "runs": [asdict(run) for run in facts.runs],
        "lacks": facts.lacks,
    }
    return json.dumps(_finite(content), indent=2, allow_nan=False)


def longest_sim_time(facts: BagFacts) -> float | None:
    """Simulated time in s from the first state to the last; None if that is not known."""
    known = [stream.sim_time for stream in facts.streams if stream.sim_time is not None]
    return max(known, default=None)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
