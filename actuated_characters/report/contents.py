"""The contents of a bag, of this project or any other, without reading its messages.

They come from the statistics of its files, its metadata, and a few messages of each character.
"""

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcap.records import Chunk
from mcap.stream_reader import StreamReader

from actuated_characters.bags.forked_from import KEY, ForkedFrom, read_forked_from
from actuated_characters.bags.format.metadata import storage_of
from actuated_characters.bags.format.storage import MCAP, SUFFIXES
from actuated_characters.bags.reader import OpenBag, open_bag
from actuated_characters.bags.recording import describe_foreign, find_bag
from actuated_characters.bags.robots.reading import is_own
from actuated_characters.report.verdict import describe_law
from msgs_config.character.layout import ROOT, JointLayout, JointType
from msgs_config.character.model import ROOT_TORQUE
from msgs_config.errors import ConfigurationError, MessageError
from msgs_config.messages import configuration, topics
from msgs_config.messages.cdr import decode_string
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND, TickClock
from msgs_config.messages.configuration import RunConfiguration

_STATES = topics.JOINT_STATES.name
_SIMULATOR = topics.CONFIGURATION.of(topics.SIM_NODE).name
_CONTROLLER = topics.CONFIGURATION.of(topics.CONTROLLER_NODE).name


@dataclass(frozen=True)
class TopicContents:
    """The messages of one topic."""

    name: str
    type: str  # such as "sensor_msgs/msg/JointState"
    count: int
    largest_gap_s: float | None = None  # s of wall time; None unless each message was read


@dataclass(frozen=True)
class GainsInForce:
    """A controller's gains of one joint; None where they were not recorded."""

    joint: str
    p: float | None  # N m/rad or N/m
    d: float | None  # N m s/rad or N s/m
    i: float | None  # N m/(rad s) or N/(m s)
    limit: float | None  # N m or N; infinite: none


@dataclass(frozen=True)
class CharacterContents:
    """A character, as its simulator and its controller have described it at the start."""

    name: str  # its topics' namespace
    character: str
    degrees_of_freedom: int
    mass: float  # kg
    rate_hz: int
    mode: str | None
    versions: dict[str, str]
    law: str | None  # None: no controller said it
    gains: list[GainsInForce]
    states: int  # messages; a state that was published again counts again


@dataclass(frozen=True)
class Contents:
    """A bag as it lies on the disk."""

    bag: str
    files: dict[str, int]  # bytes of each
    size_bytes: int
    storage: str
    compression: str
    metadata_version: int | None
    ros_distro: str
    forked_from: ForkedFrom | None
    start_ns: int | None  # wall time of the first message
    wall_time_s: float | None  # from the first message to the last
    sim_time_s: float | None  # by the number of states, or exactly if each message was read
    topics: tuple[TopicContents, ...]  # by name
    characters: tuple[CharacterContents, ...]  # by name
    lacks: str | None  # why nothing more is known


def read_contents(path: Path) -> Contents:
    """Read the contents of a run's bag, or of any bag or one file of a bag.

    Raises:
        RecordingError: there is no complete bag, or it is damaged in what is read of it.
    """
    path = find_bag(path)
    with open_bag(path) as bag:
        metadata, types, counted = bag.metadata.content, bag.types, bag.statistics()
        texts = _first_texts(bag)
    characters = tuple(_characters(texts, counted.counts))
    lengths = [(each.states - 1) / each.rate_hz for each in characters if each.states]
    inside = sorted(path.iterdir()) if path.is_dir() else [path]
    files = {file.name: file.stat().st_size for file in inside if file.is_file()}
    version, custom = metadata.get("version"), metadata.get("custom_data")
    has_times = bool(counted.counts) and not bag.has_simulated_log_times
    span = (counted.last_ns - counted.first_ns) / NANOSECONDS_PER_SECOND
    return Contents(
        bag=str(path),
        files=files,
        size_bytes=sum(files.values()),
        storage=str(metadata.get("storage_identifier") or storage_of(map(str, bag.metadata.files))),
        compression=_compression(inside, metadata),
        metadata_version=version if isinstance(version, int) else None,
        ros_distro=str(metadata.get("ros_distro") or "unknown"),
        forked_from=read_forked_from(custom.get(KEY)) if isinstance(custom, dict) else None,
        start_ns=counted.first_ns if has_times else None,
        wall_time_s=span if has_times else None,
        sim_time_s=max(lengths, default=None),
        topics=tuple(
            TopicContents(name, kind, counted.counts.get(name, 0))
            for name, kind in sorted({**_listed_topics(metadata), **types}.items())
        ),
        characters=characters,
        lacks=None if characters else _what_is_lacking(path, types),
    )


def _what_is_lacking(bag: Path, types: Mapping[str, str]) -> str:
    if is_own(types):
        return f"bag {bag}: what is on '{_SIMULATOR}' is no configuration of this project's"
    return describe_foreign(bag, types)


def _first_texts(bag: OpenBag) -> dict[str, str]:
    """The first configuration on each topic of simulators and controllers."""
    names = [
        name
        for name, kind in sorted(bag.types.items())
        if kind == topics.CONFIGURATION.type_name
        and f"/{name}".endswith((f"/{_SIMULATOR}", f"/{_CONTROLLER}"))
    ]
    texts: dict[str, str] = {}
    for message in bag.messages(names) if names else ():
        with suppress(MessageError):
            texts.setdefault(message.topic, decode_string(message.raw))
    return texts


def _characters(texts: Mapping[str, str], counts: Mapping[str, int]) -> Iterator[CharacterContents]:
    """The characters whose simulators have said what they are.

    Args:
        texts: Configurations of simulators and controllers, by topic.
        counts: Numbers of messages, by topic.
    """
    for topic, text in texts.items():
        below = topic.removesuffix(_SIMULATOR)
        if f"/{topic}".endswith(f"/{_SIMULATOR}"):
            with suppress(MessageError, ConfigurationError):  # it is another maker's
                known = configuration.parse(text)
                controller = _parameters(texts.get(below + _CONTROLLER, ""))
                mode = known.parameters.get("mode")
                yield CharacterContents(
                    name=below.strip("/"),
                    character=known.character,
                    degrees_of_freedom=known.layout.size,
                    mass=known.mass,
                    rate_hz=_rate(known),
                    mode=mode if isinstance(mode, str) else None,
                    versions=known.versions,
                    law=describe_law(controller),
                    gains=_gains(controller, known.layout) if controller else [],
                    states=counts.get(below + _STATES, 0),
                )


def _rate(known: RunConfiguration) -> int:
    rate = known.parameters.get("rate")
    if not isinstance(rate, int):
        raise MessageError(f"the simulator's 'rate' is {rate}, not a number")
    return TickClock(rate).rate_hz


def _parameters(text: str) -> dict[str, Any]:
    """The parameters in a controller's configuration; none where it is another maker's."""
    try:
        return dict(json.loads(text)["parameters"])
    except (ValueError, KeyError, TypeError, RecursionError):
        return {}


def _gains(parameters: Mapping[str, Any], layout: JointLayout) -> list[GainsInForce]:
    """Gains and limits of each vector of a layout, times the parameters that scale them."""
    names = [ROOT, ROOT_TORQUE] if layout.has_floating_base else []
    names += [joint.name for joint in layout.joints if joint.type is not JointType.FLOATING]
    assistance = float(bool(parameters.get("root_assistance", True)))

    def gain(name: str, kind: str) -> float | None:
        scale = read_number(parameters.get(f"gain_scale.{kind}", 1.0)) or 0.0
        value = read_number(parameters.get(f"gains.{name}.{kind}"))
        return value and value * (assistance if name in (ROOT, ROOT_TORQUE) else scale)

    return [
        GainsInForce(
            name,
            p=gain(name, "p"),
            d=gain(name, "d"),
            i=gain(name, "i"),
            limit=_limit(parameters.get(f"effort_limit.{name}", "unknown")),
        )
        for name in names
    ]


def _limit(value: object) -> float | None:
    """An effort limit as JSON has it, where no limit is null; None of what is no number."""
    return math.inf if value is None else read_number(value)


def read_number(value: object) -> float | None:
    """A number of a message from any node; None if it is none."""
    with suppress(OverflowError):
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return float(value)
    return None


def _listed_topics(metadata: Mapping[str, Any]) -> dict[str, str]:
    """Type by name of the topics that the metadata lists; some may have no messages."""
    try:
        listed = [entry["topic_metadata"] for entry in metadata["topics_with_message_count"]]
        return {str(topic["name"]): str(topic["type"]) for topic in listed}
    except (KeyError, TypeError):
        return {}


def _compression(files: list[Path], metadata: Mapping[str, Any]) -> str:
    """The compression of a bag's files: of whole files, single messages, or MCAP's chunks."""
    form, mode = metadata.get("compression_format"), metadata.get("compression_mode")
    if form:
        return f"{form} ({str(mode).lower()})"
    kinds = {_chunk_compression(file) for file in files if file.suffix == SUFFIXES[MCAP]}
    return ", ".join(f"{kind} (chunks)" for kind in sorted(kinds) if kind) or "none"


def _chunk_compression(file: Path) -> str:
    """Name of the compression of an MCAP file's first chunk; empty for none."""
    with file.open("rb") as stream:
        records = StreamReader(stream, emit_chunks=True).records
        return next((each.compression for each in records if isinstance(each, Chunk)), "")
