"""Writes a new bag of all messages that can still be read of a damaged one."""

import re
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import TypeAlias

from rosbags.interfaces import Qos
from rosbags.rosbag2.metadata import parse_qos
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from actuated_characters.bags.format import limits, storage
from actuated_characters.bags.format.definitions import MessageDefinition
from actuated_characters.bags.format.mcap_file import McapFile
from actuated_characters.bags.format.metadata import METADATA
from actuated_characters.bags.format.storage import CDR, SUFFIXES, StoredMessage, StoredTopic
from actuated_characters.bags.writer import BagWriter
from msgs_config.errors import RecordingError

Progress: TypeAlias = Callable[[str, float | None], None]
"""Gets the stage of a recovery, and the fraction of it that is done, 0 to 1; None if unknown."""

_UNKNOWN_HASH = "INVALID"  # what ROS 2 has for a hash that is not known
_REPORT_PERIOD = 1000  # messages between two reports
_MOST_NAMED = 3  # files that an error names


@dataclass
class RecoveredContents:
    """The messages of a bag, counted."""

    counts: Counter[str] = field(default_factory=Counter)  # messages of each topic
    last_log_time_ns: int = 0
    unreadable: list[str] = field(default_factory=list)  # what could not be read of each file

    def add(self, topic: str, log_time_ns: int) -> None:
        """Count a message."""
        self.counts[topic] += 1
        self.last_log_time_ns = max(self.last_log_time_ns, log_time_ns)


def rewrite(damaged: Path, new: Path, progress: Progress) -> RecoveredContents:
    """Write all that can be read of a damaged bag into a new one.

    Args:
        damaged: The directory of the damaged bag, which is not changed.
        new: Where the new one goes.
        progress: See `Progress`.

    Raises:
        RecordingError: there is nothing that can be read, or the new bag cannot be written.
    """
    files = [McapFile(file) for file in storage_files(damaged)]
    contents = RecoveredContents()
    messages = _salvage(files, contents, progress)
    first = next(messages, None)
    if first is None:
        parts = f" (unreadable: {'; '.join(contents.unreadable)})" if contents.unreadable else ""
        raise RecordingError(f"nothing to recover in {damaged}: no message reached the disk{parts}")
    is_compressed = any(file.is_compressed for file in files)
    simulated = first.topic.has_simulated_log_time
    with BagWriter(
        new,
        compression=storage.ZSTD if is_compressed else storage.NONE,
        log_time=storage.SIMULATED if simulated else storage.WALL,
    ) as bag:
        announced = set[str]()
        for message in chain((first,), messages):
            log_time_ns, published_ns, _, topic, raw, number = message
            _announce(topic, bag, announced)
            bag.write(topic.name, raw, log_time_ns, published_ns, number or None)
            contents.add(topic.name, log_time_ns)
        for topic in (topic for file in files for topic in file.topics.values()):
            if topic.serialization == CDR:
                # A reader may ask for a topic that has no messages.
                _announce(topic, bag, announced)
    return contents


def storage_files(bag: Path) -> list[Path]:
    """Return the files of a bag in the order in which they were written: `_2` before `_10`.

    Raises:
        RecordingError: there are none, or of several recordings, or of another storage.
    """
    present = set(bag.iterdir())
    files = sorted(
        (file for file in present if file.suffix == SUFFIXES[storage.MCAP]),
        key=lambda file: ([int(number) for number in re.findall("[0-9]+", file.name)], file.name),
    )
    for file in present:
        if file.suffix == SUFFIXES[storage.SQLITE3]:
            raise RecordingError(
                f"cannot recover {bag}: {file.name} is SQLite's, which keeps what was committed; "
                "give the file itself, or make the bag's metadata with 'ros2 bag reindex'"
            )
        if file.suffix == storage.ZSTD_SUFFIX and file.with_suffix("") not in present:
            raise RecordingError(
                f"cannot recover {bag}: {file.name} is compressed as a whole; 'zstd -d' unpacks it"
            )
    if not files:
        raise RecordingError(
            f"nothing to recover in {bag}: it has no {SUFFIXES[storage.MCAP]} file"
        )
    stems = {re.sub("_[0-9]+$", "", file.stem) for file in files}
    if len(stems) > 1 and not (bag / METADATA).is_file():
        names = ", ".join(file.name for file in files[:_MOST_NAMED])
        raise RecordingError(
            f"cannot recover {bag}: its files ({names}{', ...' * (len(files) > _MOST_NAMED)}) are "
            "not those of one recording, NAME_0, NAME_1 and so on; give each its own directory"
        )
    return files


def _salvage(
    files: list[McapFile], contents: RecoveredContents, progress: Progress
) -> Iterator[StoredMessage]:
    """Yield the messages of all files, unpacked, one after the other."""
    types: dict[str, str] = {}
    for number, file in enumerate(files):
        try:
            for count, message in enumerate(file.messages()):
                if count % _REPORT_PERIOD == 0:
                    progress("recovering", (number + file.fraction) / len(files))
                packed = message.raw.startswith(storage.ZSTD_MAGIC)
                file.is_compressed |= packed
                try:
                    _check(message, types)
                    raw = limits.unpack_message(message.raw, packed=packed)
                except limits.DAMAGED as error:
                    file.unreadable[str(error)] += 1
                else:
                    yield message._replace(raw=raw)
        except RecordingError as error:  # another file may be sound
            contents.unreadable.append(str(error))
        if file.damage:
            contents.unreadable.append(f"{file.path.name}: {file.damage}")


def _check(message: StoredMessage, types: dict[str, str]) -> None:
    """Raise ValueError for a message that a bag cannot hold; `types` has its topics so far."""
    topic = message.topic
    if topic.serialization != CDR:
        raise ValueError(f"message on '{topic.name}' as {topic.serialization}, not as {CDR}")
    if types.setdefault(topic.name, topic.type_name) != topic.type_name:
        raise ValueError(f"message on '{topic.name}' of another type, {topic.type_name}")
    if max(message.log_time_ns, message.published_ns or 0) > storage.LATEST_NS:
        raise ValueError("message of an impossible time")


def _announce(topic: StoredTopic, bag: BagWriter, announced: set[str]) -> None:
    """Announce a topic in the new bag if it was not yet."""
    if topic.name not in announced:
        announced.add(topic.name)
        type_hash = topic.type_hash or _compute_hash(topic)
        definition = MessageDefinition(topic.type_name, topic.definition, type_hash)
        bag.announce(topic.name, definition, _parse_offered(topic))


def _compute_hash(topic: StoredTopic) -> str:
    """The hash of a definition, where the file says none."""
    if topic.definition.strip():
        with suppress(Exception):  # the parser raises anything for a definition that is not sound
            store = get_typestore(Stores.EMPTY)
            store.register(get_types_from_msg(topic.definition, topic.type_name))
            return store.hash_rihs01(topic.type_name)
    return _UNKNOWN_HASH


def _parse_offered(topic: StoredTopic) -> list[Qos]:
    with suppress(Exception):  # the parser raises anything here, too; the messages matter more
        return parse_qos(topic.offered_qos)
    return []
