"""The contents of a bag, of this project or any other: files, topics, and when messages came."""

import struct
from array import array
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.records import Chunk
from mcap.stream_reader import StreamReader

from actuated_characters.bags.format.metadata import METADATA, load_metadata, storage_of
from actuated_characters.bags.format.storage import MCAP, SUFFIXES
from actuated_characters.bags.reader import RecordedMessage, read_messages
from actuated_characters.bags.recording import find_bag
from actuated_characters.recorder.forked_from import KEY, ForkedFrom, read_forked_from
from msgs_config.errors import MessageError, RecordingError
from msgs_config.messages import topics
from msgs_config.messages.cdr import decode_string
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND

_STATES = topics.JOINT_STATES.name
_CONFIGURATION = topics.CONFIGURATION.of(topics.SIM_NODE).name
_STATE_TYPE, _TEXT_TYPE = "sensor_msgs/msg/JointState", "std_msgs/msg/String"
_HEADER_BYTES = 12  # bytes of a message up to the end of its stamp


@dataclass
class TopicContents:
    """The messages of one topic."""

    name: str
    type_name: str
    count: int = 0
    first_ns: int = 0  # when it was published, by the wall clock
    last_ns: int = 0
    largest_gap_ns: int = 0  # between two messages that follow each other
    has_wall_times: bool = True  # False: times are simulated log times

    def add(self, message: RecordedMessage) -> None:
        """Count a message, later than all before."""
        sent_ns = message.sent_ns
        if self.count:
            self.largest_gap_ns = max(self.largest_gap_ns, sent_ns - self.last_ns)
        else:
            self.first_ns = sent_ns
        self.last_ns = sent_ns
        self.has_wall_times &= message.published_ns is not None
        self.count += 1

    @property
    def rate_hz(self) -> float | None:
        """Messages a second of wall time; None if there are not two, or no times between them."""
        if not self.has_wall_times:
            return None
        span = (self.last_ns - self.first_ns) / NANOSECONDS_PER_SECOND
        return (self.count - 1) / span if span > 0.0 else None

    @property
    def largest_gap(self) -> float | None:
        """Longest wall time from a message to the next, s; None if there are not two."""
        if self.count < 2 or not self.has_wall_times:
            return None
        return self.largest_gap_ns / NANOSECONDS_PER_SECOND


@dataclass
class StateMessages:
    """Stamps and times of a topic of states, and its simulator's configuration."""

    stamps_ns: "array[int]" = field(default_factory=lambda: array("q"))
    published_ns: "array[int]" = field(default_factory=lambda: array("q"))
    has_wall_times: bool = True  # False: times of publishing are simulated log times
    configuration: str = ""  # JSON, the first that there was; empty if there was none
    has_topic: bool = False  # whether there is a topic of states

    def add(self, message: RecordedMessage) -> None:
        """Add a state's stamp, which is in the header, at the message's beginning."""
        raw = message.raw
        if len(raw) >= _HEADER_BYTES:
            order = "<" if raw[1] & 1 else ">"
            seconds, nanoseconds = struct.unpack_from(f"{order}iI", raw, 4)
            self.stamps_ns.append(seconds * NANOSECONDS_PER_SECOND + nanoseconds)
            self.published_ns.append(message.sent_ns)
            self.has_wall_times &= message.published_ns is not None

    def configure(self, message: RecordedMessage) -> None:
        """Keep a simulator's configuration, if it can be read."""
        with suppress(MessageError):
            self.configuration = self.configuration or decode_string(message.raw)


@dataclass(frozen=True)
class Contents:
    """A bag as it lies on the disk."""

    bag: Path
    files: dict[str, int]  # bytes of each
    storage: str
    compression: str
    version: int | None  # that of metadata.yaml
    ros_distro: str
    topics: tuple[TopicContents, ...]  # by name
    states: dict[str, StateMessages]  # by namespace
    forked_from: ForkedFrom | None = None

    @property
    def has_wall_times(self) -> bool:
        """Whether times are of the wall clock, and not simulated."""
        return all(topic.has_wall_times for topic in self.topics)

    @property
    def start_ns(self) -> int | None:
        """Wall time of the first message; None if not known."""
        found = [topic.first_ns for topic in self.topics if topic.count]
        return min(found, default=None) if self.has_wall_times else None

    @property
    def wall_time(self) -> float | None:
        """From the first message to the last, s of wall time; None if not known."""
        if not self.has_wall_times:
            return None
        last = max((topic.last_ns for topic in self.topics if topic.count), default=0)
        return (last - (self.start_ns or 0)) / NANOSECONDS_PER_SECOND


def read_contents(path: Path) -> Contents:
    """Read the contents of a run's bag, or of any bag or one file of a bag.

    Raises:
        RecordingError: there is no complete bag, or it is damaged.
    """
    bag = find_bag(path)
    found: dict[str, TopicContents] = {}
    states: dict[str, StateMessages] = {}
    readers: dict[str, Callable[[RecordedMessage], None] | None] = {}  # by topic
    for message in read_messages(bag):  # raises an error where the bag is none
        name = message.topic
        if name not in found:
            found[name] = TopicContents(name, message.type_name)
            readers[name] = _reader(name, message.type_name, states)
        found[name].add(message)
        reader = readers[name]
        if reader is not None:
            reader(message)
    metadata = _metadata(bag)
    for name, type_name in _listed_topics(metadata).items():
        found.setdefault(name, TopicContents(name, type_name))
    inside = sorted(bag.iterdir()) if bag.is_dir() else [bag]
    version = metadata.get("version")
    return Contents(
        bag=bag,
        files={file.name: file.stat().st_size for file in inside if file.is_file()},
        storage=_storage(metadata),
        compression=_compression(inside, metadata),
        version=version if isinstance(version, int) else None,
        ros_distro=str(metadata.get("ros_distro") or "unknown"),
        topics=tuple(found[name] for name in sorted(found)),
        states={name: of for name, of in sorted(states.items()) if of.has_topic},
        forked_from=_forked_from(metadata),
    )


def _reader(
    topic: str, type_name: str, states: dict[str, StateMessages]
) -> Callable[[RecordedMessage], None] | None:
    """The method that reads a topic's messages; None for a topic that is only counted."""
    whole = f"/{topic.lstrip('/')}"
    if type_name == _STATE_TYPE and whole.endswith(f"/{_STATES}"):
        of = states.setdefault(whole.removesuffix(_STATES).strip("/"), StateMessages())
        of.has_topic = True
        return of.add
    if type_name == _TEXT_TYPE and whole.endswith(f"/{_CONFIGURATION}"):
        namespace = whole.removesuffix(_CONFIGURATION).strip("/")
        return states.setdefault(namespace, StateMessages()).configure
    return None


def _metadata(bag: Path) -> dict[str, Any]:
    if bag.is_file():  # a file without the rest of its directory
        storages = {suffix: storage for storage, suffix in SUFFIXES.items()}
        return {"storage_identifier": storages.get(bag.suffix, "unknown")}
    try:
        content = load_metadata(bag)
    except (OSError, ValueError, KeyError, TypeError, RecordingError) as error:
        raise RecordingError(f"cannot read {bag / METADATA}") from error
    return content if isinstance(content, dict) else {}


def _storage(metadata: dict[str, Any]) -> str:
    """The storage that the metadata says, or else the suffix of its files."""
    named = metadata.get("storage_identifier") or storage_of(
        metadata.get("relative_file_paths") or ()
    )
    return str(named)


def _forked_from(metadata: dict[str, Any]) -> ForkedFrom | None:
    """Where a forked run comes from."""
    custom = metadata.get("custom_data")
    return read_forked_from(custom.get(KEY)) if isinstance(custom, dict) else None


def _listed_topics(metadata: dict[str, Any]) -> dict[str, str]:
    """Type by name of the topics that the metadata lists; some may have no messages."""
    try:
        listed = [entry["topic_metadata"] for entry in metadata["topics_with_message_count"]]
        return {str(topic["name"]): str(topic["type"]) for topic in listed}
    except (KeyError, TypeError):
        return {}


def _compression(files: list[Path], metadata: dict[str, Any]) -> str:
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
