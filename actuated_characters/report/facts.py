"""What is to be known of the characters of a bag: as far as the bag says it."""

import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from actuated_characters.bags.recording import Recording, read_recordings
from actuated_characters.metrics.error_measures import effort_sizes, limit_shares
from actuated_characters.metrics.recording_metrics import (
    PushSpan,
    push_spans,
    saturated_shares,
    vectors_of,
)
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
from msgs_config.errors import ActuatedCharactersError
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.versions import read_versions

_PERCENTILES = (50, 99)
_HIGHEST_RATE = 100_000  # Hz


@dataclass(frozen=True)
class Span:
    """Something that has a begin and a length, in s; the begin counts from the first state."""

    start: float
    duration: float


@dataclass(frozen=True)
class StreamFacts:
    """What the stamps and the wall times of a stream of states say, whether it is whole or not."""

    name: str  # of the character: its topics' namespace
    character: str | None
    degrees_of_freedom: int | None
    mass: float | None  # kg
    rate_hz: int | None
    mode: str | None
    versions: dict[str, str]
    states: int  # messages
    repeated: int | None = None  # of these, states that had come before
    ticks: int | None = None  # from the first state to the last, those that are missing included
    sim_time: float | None = None  # s
    missing: list[tuple[int, int]] = field(default_factory=list)  # first and last tick of each gap
    missing_count: int | None = None
    tick_us: dict[str, float] = field(default_factory=dict)  # wall time from state to state
    pauses: list[Span] = field(default_factory=list)  # start in simulated, duration in wall time
    late: dict[str, float] = field(default_factory=dict)  # of a run that the wall clock paces


@dataclass(frozen=True)
class RunFacts:
    """What more a whole recording of a character says."""

    name: str
    reference: bool  # whether there is any
    contacts: bool
    episodes: list[Span]
    resets: int
    law: str | None
    gains: list[GainsInForce]  # as they were first
    changes: list[Change]
    pushes: list[PushSpan]
    pushes_recorded: bool
    throws: list[ThrowMark]
    modes: list[ModeSpan]
    saturated_shares: dict[str, float]  # by joint, of its ticks; those with a limit


@dataclass(frozen=True)
class BagFacts:
    """All that `info` says."""

    contents: Contents
    streams: tuple[StreamFacts, ...]
    runs: tuple[RunFacts, ...]
    lacks: str | None  # why there is no more


def look_at(path: Path) -> BagFacts:
    """What there is to be known of the bag in a run's directory, or of a bag itself, of anybody.

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
    said = _configuration(messages.configuration)
    parameters = said.get("parameters")
    parameters = parameters if isinstance(parameters, dict) else {}
    rate = parameters.get("rate")
    known: dict[str, Any] = {
        "name": name,
        "character": _text(said.get("character")),
        "degrees_of_freedom": _size(said),
        "mass": number(said.get("mass")),
        "rate_hz": rate if isinstance(rate, int) and 0 < rate <= _HIGHEST_RATE else None,
        "mode": _text(parameters.get("mode")),
        "versions": read_versions(said.get("versions")),
        "states": len(messages.stamps_ns),
    }
    if known["rate_hz"] is None or not known["states"]:
        return StreamFacts(**known)
    return StreamFacts(**known, **_timing(messages, int(known["rate_hz"]), parameters))


def _timing(messages: StateMessages, rate: int, parameters: dict[str, Any]) -> dict[str, Any]:
    times = state_times(messages.stamps, messages.log_times, rate)
    ticks, published = times.ticks, times.published_ns
    gaps, steps = pauses(published), wall_steps(published)
    period = pace_period(parameters)
    return {
        "repeated": times.repeated,
        "ticks": int(ticks[-1] - ticks[0]),
        "sim_time": float(ticks[-1] - ticks[0]) / rate,
        "missing": times.missing,
        "missing_count": times.missing_count,
        "tick_us": _percentiles_us(np.delete(steps, gaps)),
        "pauses": [
            Span(float(ticks[row] - ticks[0]) / rate, float(steps[row])) for row in gaps.tolist()
        ],
        "late": late_facts(published, period) if period else {},
    }


def pace_period(parameters: dict[str, Any]) -> float:
    """Wall time from tick to tick, s, as a simulator's parameters say; 0 where nothing paces it."""
    rate = number(parameters.get("rate")) or 0.0
    factor = number(parameters.get("real_time_factor")) or 0.0
    if parameters.get("mode") == "realtime":
        factor = factor or 1.0
    return 1.0 / (factor * rate) if rate > 0.0 and factor > 0.0 else 0.0


def late_facts(published_ns: IntArray, period: float) -> dict[str, float]:
    """How many ticks began more than a period in s late, and percentiles of the lateness."""
    late = lateness(published_ns, period)[1:]
    missed = {"ticks": int((late > period).sum())}
    return missed | _percentiles_us(late)


def _percentiles_us(seconds: FloatArray) -> dict[str, float]:
    if not len(seconds):
        return {}
    values = 1e6 * np.percentile(seconds, _PERCENTILES)
    named = {f"p{p}_us": float(v) for p, v in zip(_PERCENTILES, values, strict=True)}
    return named | {"max_us": 1e6 * float(seconds.max())}


def recorded_versions(path: Path) -> dict[str, str]:
    """The versions that the simulator of a bag has said it runs with.

    Raises:
        RecordingError: there is no complete bag, or it is damaged.
    """
    found = (_stream(name, states) for name, states in read_contents(path).states.items())
    return next((stream.versions for stream in found if stream.versions), {})


def _configuration(text: str) -> dict[str, Any]:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}


def _text(value: object) -> str | None:
    return value if isinstance(value, str) else None


def _size(said: dict[str, Any]) -> int | None:
    """How many degrees of freedom the joints of a configuration have."""
    entries = {"revolute": 1, "prismatic": 1, "spherical": 3, "floating": 6, "fixed": 0}
    try:
        return sum(entries[joint["type"]] for joint in said["joints"])
    except (KeyError, TypeError):
        return None


def run_facts(recording: Recording) -> RunFacts:
    """What a whole recording says."""
    vectors = vectors_of(recording.character)
    shares = saturated_shares(
        limit_shares(effort_sizes(recording.layout, recording.effort), vectors.limits)
    )
    first = recording.controller[0].parameters if recording.controller else {}
    return RunFacts(
        name=recording.name,
        reference=not bool(np.isnan(recording.reference_position).all()),
        contacts=bool(recording.contacts),
        episodes=episodes(recording),
        resets=len(recording.episode_rows) - 1,
        law=law(first),
        gains=gains(first, vectors.names) if recording.controller else [],
        changes=live_changes(recording),
        pushes=push_spans(recording),
        pushes_recorded=bool(recording.applied_wrench),
        throws=throw_marks(recording),
        modes=mode_spans(recording),
        saturated_shares={
            name: float(share)
            for name, share, limit in zip(vectors.names, shares, vectors.limits, strict=True)
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
    """The facts as JSON; what is not known, or infinite, is null."""
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
                "largest_gap_s": topic.largest_gap_ns / NANOSECONDS_PER_SECOND,
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
