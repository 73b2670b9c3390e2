"""A new bag of what can still be read of a damaged one."""

import re
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from rosbags.interfaces import Connection, Qos
from rosbags.rosbag2.metadata import parse_qos
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from actuated_characters.bags.definitions import MessageDefinition
from actuated_characters.bags.limits import ZstdError, check_message, unpack_message
from actuated_characters.bags.metadata import METADATA
from actuated_characters.bags.recovery.salvage import Salvage, StoredMessage, StoredTopic
from actuated_characters.bags.storage import (
    MCAP,
    NONE,
    SQLITE3,
    SUFFIXES,
    ZSTD,
    ZSTD_MAGIC,
    BagFiles,
)
from actuated_characters.bags.writer import LATEST_NS
from msgs_config.errors import RecordingError

Progress = Callable[[str, float | None], None]
"""Told what is being done, and how much of it is done, 0 to 1; None where nobody knows."""

_UNKNOWN_HASH = "INVALID"  # as ROS 2 calls it
_REPORT_PERIOD = 1000  # messages
_MOST_NAMED = 3  # files in an error
_ZSTD_SUFFIX = ".zstd"


@dataclass
class Contents:
    """What a bag holds."""

    counts: Counter[str] = field(default_factory=Counter)  # messages of each topic
    last_log_time_ns: int = 0
    lost: list[str] = field(default_factory=list)  # what of each file could not be read

    def add(self, topic: str, log_time_ns: int) -> None:
        """Count a message."""
        self.counts[topic] += 1
        self.last_log_time_ns = max(self.last_log_time_ns, log_time_ns)


def rewrite(damaged: Path, new: Path, report: Progress) -> Contents:
    """Write all that can be read of a damaged bag into a new one.

    Args:
        damaged: The directory of the damaged bag, which is not changed.
        new: Where the new one goes.
        report: Told how far it is.

    Raises:
        RecordingError: there is nothing that can be read, or the new bag cannot be written.
    """
    files = [Salvage(file) for file in storage_files(damaged)]
    contents = Contents()
    messages = _salvaged(files, contents, report)
    first = next(messages, None)
    if first is None:
        lost = f" (unreadable: {'; '.join(contents.lost)})" if contents.lost else ""
        raise RecordingError(f"nothing to recover in {damaged}: no message reached the disk{lost}")
    is_compressed = any(file.is_compressed for file in files)
    bag = BagFiles(new, MCAP, ZSTD if is_compressed else NONE)
    connections: dict[tuple[str, str], Connection] = {}
    try:
        for topic, log_time_ns, raw in chain((first,), messages):
            bag.append(_connect(topic, bag, connections), raw, log_time_ns)
            contents.add(topic.name, log_time_ns)
        for topic in (topic for file in files for topic in file.topics):
            _connect(topic, bag, connections)  # without messages, but a reader may ask for it
    finally:
        bag.close()
    return contents


def _connect(
    topic: StoredTopic, bag: BagFiles, connections: dict[tuple[str, str], Connection]
) -> Connection:
    """The topic in the new bag, announced there if it was not yet."""
    key = (topic.name, topic.type_name)
    if key not in connections:
        type_hash = topic.type_hash or _hash_of(topic)
        definition = MessageDefinition(topic.type_name, topic.definition, type_hash)
        connections[key] = bag.add(topic.name, definition, _offered(topic))
    return connections[key]


def storage_files(bag: Path) -> list[Path]:
    """The files of a bag in the order in which they were written: `_2` comes before `_10`.

    Raises:
        RecordingError: there are none, or of several recordings, or of another storage.
    """
    present = set(bag.iterdir())
    files = sorted(
        (file for file in present if file.suffix == SUFFIXES[MCAP]),
        key=lambda file: ([int(number) for number in re.findall("[0-9]+", file.name)], file.name),
    )
    for file in present:
        if file.suffix == SUFFIXES[SQLITE3]:
            raise RecordingError(
                f"cannot recover {bag}: {file.name} is SQLite's, which keeps what was committed; "
                "give the file itself, or make the bag's metadata with 'ros2 bag reindex'"
            )
        if file.suffix == _ZSTD_SUFFIX and file.with_suffix("") not in present:
            raise RecordingError(
                f"cannot recover {bag}: {file.name} is compressed as a whole; 'zstd -d' unpacks it"
            )
    if not files:
        raise RecordingError(f"nothing to recover in {bag}: it has no {SUFFIXES[MCAP]} file")
    stems = {re.sub("_[0-9]+$", "", file.stem) for file in files}
    if len(stems) > 1 and not (bag / METADATA).is_file():
        names = ", ".join(file.name for file in files[:_MOST_NAMED])
        raise RecordingError(
            f"cannot recover {bag}: its files ({names}{', ...' * (len(files) > _MOST_NAMED)}) are "
            "not those of one recording, NAME_0, NAME_1 and so on; give each a directory of its own"
        )
    return files


def _salvaged(
    files: list[Salvage], contents: Contents, report: Progress
) -> Iterator[StoredMessage]:
    """The messages of all files, one after the other."""
    for number, file in enumerate(files):
        try:
            for count, message in enumerate(file.messages()):
                if count % _REPORT_PERIOD == 0:
                    report("recovering", (number + file.fraction) / len(files))
                try:
                    raw = _unpacked(file, message)
                except (ValueError, EOFError, ZstdError) as error:
                    file.lost[str(error)] += 1
                    continue
                yield message._replace(raw=raw)
        except RecordingError as error:  # another file may be sound
            contents.lost.append(str(error))
        if file.damage:
            contents.lost.append(f"{file.path.name}: {file.damage}")


def _unpacked(file: Salvage, message: StoredMessage) -> bytes:
    """A message as it was serialised. Raises ValueError, EOFError, ZstdError if it cannot be."""
    if not 0 <= message.log_time_ns <= LATEST_NS:
        raise ValueError("message of an impossible time")
    if not message.raw.startswith(ZSTD_MAGIC):
        return check_message(message.raw)
    file.is_compressed = True
    return unpack_message(message.raw)


def _hash_of(topic: StoredTopic) -> str:
    """The hash of a definition, where the file says none."""
    if not topic.definition.strip():
        return _UNKNOWN_HASH
    with suppress(Exception):  # of a definition that is not sound the parser raises anything
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(topic.definition, topic.type_name))
        return store.hash_rihs01(topic.type_name)
    return _UNKNOWN_HASH


def _offered(topic: StoredTopic) -> list[Qos]:
    with suppress(Exception):  # likewise: the messages matter more
        return parse_qos(topic.offered_qos)
    return []
