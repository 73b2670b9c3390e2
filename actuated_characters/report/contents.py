"""What is in a bag, whoever has written it: files, topics, and when their messages came."""

import struct
from array import array
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from std_msgs.msg import String

from actuated_characters.bags.metadata import METADATA, load_metadata
from actuated_characters.bags.reader import RecordedMessage, read_messages
from actuated_characters.bags.recording import find_bag
from actuated_characters.bags.storage import SUFFIXES
from msgs_config.arrays import IntArray
from msgs_config.errors import MessageError, RecordingError
from msgs_config.messages import topics
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.joint_state import decode

_STATES = topics.JOINT_STATES.name
_CONFIGURATION = topics.CONFIGURATION.of(topics.SIM_NODE).name
_STATE_TYPE, _TEXT_TYPE = "sensor_msgs/msg/JointState", "std_msgs/msg/String"

_HEADER_BYTES = 12  # of a message up to the end of its stamp
_MCAP_MAGIC = b"\x89MCAP0\r\n"
_MCAP_RECORD = struct.Struct("<BQ")  # opcode and length
_MCAP_CHUNK, _MCAP_DATA_END = 0x06, 0x0F
_CHUNK_HEAD = 28  # bytes of a chunk before the name of its compression


@dataclass
class TopicContents:
    """The messages of one topic."""

    name: str
    type_name: str
    count: int = 0
    first_ns: int = 0  # log time
    last_ns: int = 0
    largest_gap_ns: int = 0  # between two messages that follow each other

    def add(self, log_time_ns: int) -> None:
        """Count a message, later than all before."""
        if self.count:
            self.largest_gap_ns = max(self.largest_gap_ns, log_time_ns - self.last_ns)
        else:
            self.first_ns = log_time_ns
        self.last_ns = log_time_ns
        self.count += 1

    @property
    def rate_hz(self) -> float | None:
        """Messages a second of wall time; None if there are not two, or all are of one time."""
        span = (self.last_ns - self.first_ns) / NANOSECONDS_PER_SECOND
        return (self.count - 1) / span if span > 0.0 else None


@dataclass
class StateMessages:
    """Stamps and log times of a topic of states, and what its simulator says of itself."""

    stamps_ns: "array[int]" = field(default_factory=lambda: array("q"))
    log_times_ns: "array[int]" = field(default_factory=lambda: array("q"))
    configuration: str = ""  # JSON, the first that there was; empty if there was none
    has_topic: bool = False  # whether there is a topic of states

    def add(self, message: RecordedMessage) -> None:
        """Take a state's stamp."""
        raw = message.raw
        if len(raw) >= _HEADER_BYTES:
            order = "<" if raw[1] & 1 else ">"  # the header comes first, and its stamp
            seconds, nanoseconds = struct.unpack_from(f"{order}iI", raw, 4)
            self.stamps_ns.append(seconds * NANOSECONDS_PER_SECOND + nanoseconds)
            self.log_times_ns.append(message.log_time_ns)

    def configure(self, message: RecordedMessage) -> None:
        """Take what a simulator says of itself, if it can be read."""
        with suppress(MessageError):
            self.configuration = self.configuration or decode(message.raw, String).data

    @property
    def stamps(self) -> IntArray:
        """The stamps as an array, ns."""
        return np.array(self.stamps_ns, dtype=np.intp)

    @property
    def log_times(self) -> IntArray:
        """The log times as an array, ns."""
        return np.array(self.log_times_ns, dtype=np.intp)


@dataclass(frozen=True)
class Contents:
    """A bag as it lies on the disk."""

    bag: Path
    files: dict[str, int]  # bytes of each
    storage: str
    compression: str
    version: int | None  # of metadata.yaml
    ros_distro: str
    topics: tuple[TopicContents, ...]  # by name
    states: dict[str, StateMessages]  # by namespace

    @property
    def start_ns(self) -> int | None:
        """Log time of the first message."""
        return min((topic.first_ns for topic in self.topics if topic.count), default=None)

    @property
    def wall_time(self) -> float:
        """From the first message to the last, s of wall time."""
        last = max((topic.last_ns for topic in self.topics if topic.count), default=0)
        return (last - (self.start_ns or 0)) / NANOSECONDS_PER_SECOND


def read_contents(path: Path) -> Contents:
    """Look through the bag in a run's directory, or a bag or a file of one, of anybody.

    Raises:
        RecordingError: there is no complete bag, or it is damaged.
    """
    bag = find_bag(path)
    found: dict[str, TopicContents] = {}
    states: dict[str, StateMessages] = {}
    looks: dict[str, Callable[[RecordedMessage], None] | None] = {}  # by topic
    for message in read_messages(bag):  # the first thing that finds a bag to be none
        name = message.topic
        if name not in found:
            found[name] = TopicContents(name, message.type_name)
            looks[name] = _look(name, message.type_name, states)
        found[name].add(message.log_time_ns)
        look = looks[name]
        if look is not None:
            look(message)
    metadata = _metadata(bag)
    for name, type_name in _announced(metadata).items():
        found.setdefault(name, TopicContents(name, type_name))
    inside = sorted(bag.iterdir()) if bag.is_dir() else [bag]
    files = {file.name: file.stat().st_size for file in inside if file.is_file()}
    version = metadata.get("version")
    return Contents(
        bag=bag,
        files=files,
        storage=str(metadata.get("storage_identifier", "unknown")),
        compression=_compression(bag, metadata),
        version=version if isinstance(version, int) else None,
        ros_distro=str(metadata.get("ros_distro") or "unknown"),
        topics=tuple(found[name] for name in sorted(found)),
        states={name: of for name, of in sorted(states.items()) if of.has_topic},
    )


def _look(
    topic: str, type_name: str, states: dict[str, StateMessages]
) -> Callable[[RecordedMessage], None] | None:
    """What is to be done with the messages of a topic, beside counting them."""
    namespace = _before(topic, _STATES) if type_name == _STATE_TYPE else None
    if namespace is not None:
        of = states.setdefault(namespace, StateMessages())
        of.has_topic = True
        return of.add
    namespace = _before(topic, _CONFIGURATION) if type_name == _TEXT_TYPE else None
    if namespace is not None:
        return states.setdefault(namespace, StateMessages()).configure
    return None


def _before(topic: str, name: str) -> str | None:
    """The namespace of a topic, without slashes around it, if it is of this name in one."""
    whole = f"/{topic.lstrip('/')}"
    return whole.removesuffix(f"/{name}").strip("/") if whole.endswith(f"/{name}") else None


def _metadata(bag: Path) -> dict[str, Any]:
    if bag.is_file():  # without the rest of its directory
        storages = {suffix: storage for storage, suffix in SUFFIXES.items()}
        return {"storage_identifier": storages.get(bag.suffix, "unknown")}
    try:
        content = load_metadata(bag)
    except (OSError, ValueError, KeyError, TypeError, RecordingError) as error:
        raise RecordingError(f"cannot read {bag / METADATA}") from error
    return content if isinstance(content, dict) else {}


def _announced(metadata: dict[str, Any]) -> dict[str, str]:
    """Type by name of the topics that the metadata lists; some may have no messages."""
    try:
        listed = [entry["topic_metadata"] for entry in metadata["topics_with_message_count"]]
        return {str(topic["name"]): str(topic["type"]) for topic in listed}
    except (KeyError, TypeError):
        return {}


def _compression(bag: Path, metadata: dict[str, Any]) -> str:
    """What the bag is compressed by: whole files, single messages, or MCAP's chunks."""
    form, mode = metadata.get("compression_format"), metadata.get("compression_mode")
    if form:
        return f"{form} ({str(mode).lower()})"
    files = [bag] if bag.is_file() else sorted(bag.glob("*.mcap"))
    kinds = set(map(_chunk_compression, files))
    named = [f"{kind} (chunks)" for kind in sorted(kinds) if kind]
    return ", ".join(named) or "none"


def _chunk_compression(file: Path) -> str:
    """Name of the compression of an MCAP file's first chunk; empty for none.

    Source: the MCAP format specification, sections "Records" and "Chunk".
    """
    with file.open("rb") as stream:
        if stream.read(len(_MCAP_MAGIC)) != _MCAP_MAGIC:
            return ""
        while len(head := stream.read(_MCAP_RECORD.size)) == _MCAP_RECORD.size:
            opcode, length = _MCAP_RECORD.unpack(head)
            if opcode == _MCAP_CHUNK:
                begin = stream.read(_CHUNK_HEAD + 4 + 32)
                (size,) = struct.unpack_from("<I", begin, _CHUNK_HEAD)
                return begin[_CHUNK_HEAD + 4 :][:size].decode("ascii", "replace")
            if opcode == _MCAP_DATA_END:
                return ""
            stream.seek(length, 1)
    return ""
