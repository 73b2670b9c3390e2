"""A new bag of what can still be read of a damaged one."""

import re
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

from rosbags.interfaces import Connection, Qos
from rosbags.rosbag2.metadata import parse_qos
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from experiment.bags.definitions import MessageDefinition, read_definition
from experiment.bags.limits import MOST_OF_FILES, UNPACKING_FAILED, Allowance, unpack_file
from experiment.bags.metadata import METADATA
from experiment.bags.salvage import McapSalvage, Salvage, SqliteSalvage, StoredMessage, StoredTopic
from experiment.bags.storage import NONE, SQLITE3, SUFFIXES, ZSTD, BagFiles, reason
from experiment.bags.writer import LATEST_NS
from msgs_config.errors import RecordingError

Progress = Callable[[str, float | None], None]
"""Told what is being done, and how much of it is done, 0 to 1; None where nobody knows."""

_ZSTD_SUFFIX = ".zstd"
_JOURNALS = ("-journal", "-wal")  # of SQLite, beside its file: what is not, or not yet, in it
_UNKNOWN_HASH = "INVALID"  # as ROS 2 calls it
_REPORT_PERIOD = 1000  # messages
_MOST_NAMED = 3  # files in an error


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


def rewrite(damaged: Path, new: Path, scratch: Path, report: Progress) -> Contents:
    """Write all that can be read of a damaged bag into a new one, of the same storage.

    Args:
        damaged: The directory of the damaged bag, which is not changed.
        new: Where the new one goes.
        scratch: A directory for copies.
        report: Told how far it is.

    Raises:
        RecordingError: there is nothing that can be read, or the new bag cannot be written.
    """
    files = storage_files(damaged)
    contents = Contents()
    announced: list[StoredTopic] = []
    messages = _salvaged(files, scratch, contents, announced, report)
    first = next(messages, None)
    if first is None:
        lost = f" (unreadable: {'; '.join(contents.lost)})" if contents.lost else ""
        raise RecordingError(f"nothing to recover in {damaged}: no message reached the disk{lost}")
    bag = BagFiles(new, _storage_of(files[0]), ZSTD if first.was_compressed else NONE)
    connections: dict[tuple[str, str], Connection] = {}
    try:
        _keep(first, bag, connections, contents)
        for message in messages:
            _keep(message, bag, connections, contents)
        for topic in announced:  # without messages, but a reader may ask for it
            _connect(topic, bag, connections)
    finally:
        bag.close()
    return contents


def _keep(
    message: StoredMessage,
    bag: BagFiles,
    connections: dict[tuple[str, str], Connection],
    contents: Contents,
) -> None:
    connection = _connect(message.topic, bag, connections)
    bag.write(connection, message.raw, message.log_time_ns)
    contents.add(message.topic.name, message.log_time_ns)


def _connect(
    topic: StoredTopic, bag: BagFiles, connections: dict[tuple[str, str], Connection]
) -> Connection:
    """The topic in the new bag, announced there if it was not yet."""
    key = (topic.name, topic.type_name)
    if key not in connections:
        connections[key] = bag.add(topic.name, _definition(topic), _offered(topic))
    return connections[key]


def storage_files(bag: Path) -> list[Path]:
    """The files of a bag in the order in which they were written: `_2` comes before `_10`.

    Raises:
        RecordingError: there are none, or of different storages or recordings.
    """
    present = {file for file in bag.iterdir() if _storage_of(file)}
    copies = {file.with_name(file.name + _ZSTD_SUFFIX) for file in present}
    found = present - copies  # what was being compressed is there twice
    if not found:
        names = " or ".join(SUFFIXES.values())
        raise RecordingError(f"nothing to recover in {bag}: it has no {names} file")
    if len({_storage_of(file) for file in found}) > 1:
        raise RecordingError(f"cannot recover {bag}: it has files of different storages")
    files = sorted(
        found,
        key=lambda file: ([int(number) for number in re.findall("[0-9]+", file.name)], file.name),
    )
    if not (bag / METADATA).is_file():
        _check_names(bag, files)
    return files


def _check_names(bag: Path, files: list[Path]) -> None:
    """Refuse files that no recorder has given one name: NAME_0, NAME_1 and so on.

    Raises:
        RecordingError: they are of several recordings.
    """
    stems = [file.name.removesuffix(_ZSTD_SUFFIX).rpartition(".")[0] for file in files]
    if len(stems) > 1 and len({re.sub("_[0-9]+$", "", stem) for stem in stems}) > 1:
        names = ", ".join(file.name for file in files[:_MOST_NAMED])
        raise RecordingError(
            f"cannot recover {bag}: its files ({names}{', ...' * (len(files) > _MOST_NAMED)}) are "
            "not those of one recording, NAME_0, NAME_1 and so on; give each a directory of its own"
        )


def _storage_of(file: Path) -> str:
    """`mcap` or `sqlite3`; empty for a file of another kind."""
    suffix = Path(file.name.removesuffix(_ZSTD_SUFFIX)).suffix
    return next((storage for storage, its in SUFFIXES.items() if its == suffix), "")


def _salvaged(
    files: list[Path],
    scratch: Path,
    contents: Contents,
    announced: list[StoredTopic],
    report: Progress,
) -> Iterator[StoredMessage]:
    """The messages of all files, one after the other; what was announced is added."""
    disk = Allowance("its files", MOST_OF_FILES)
    for number, file in enumerate(files):
        salvage = _open(file, scratch, contents, disk)
        try:
            for count, message in enumerate(salvage.messages()):
                if count % _REPORT_PERIOD == 0:
                    report("recovering", (number + salvage.fraction) / len(files))
                if 0 <= message.log_time_ns <= LATEST_NS:
                    yield message
                else:
                    contents.lost.append(f"{file.name}: a message of an impossible time")
        except RecordingError as error:  # another file may be sound
            contents.lost.append(str(error))
        announced += salvage.topics
        if salvage.damage:
            contents.lost.append(f"{file.name}: {salvage.damage}")


def _open(file: Path, scratch: Path, contents: Contents, disk: Allowance) -> Salvage:
    """A storage file; a copy of it, where reading would change it."""
    if file.suffix == _ZSTD_SUFFIX:
        file = _decompressed(file, scratch, contents, disk)
    elif _storage_of(file) == SQLITE3:
        for journal in (file.with_name(file.name + end) for end in _JOURNALS):
            if journal.is_file():
                shutil.copy(journal, scratch / journal.name)
        file = Path(shutil.copy(file, scratch / file.name))
    return SqliteSalvage(file) if _storage_of(file) == SQLITE3 else McapSalvage(file)


def _decompressed(file: Path, scratch: Path, contents: Contents, disk: Allowance) -> Path:
    """A copy of a file that was compressed as a whole, as far as it goes."""
    copy = scratch / file.stem
    try:
        unpack_file(file, copy, disk)
    except UNPACKING_FAILED as error:
        contents.lost.append(f"{file.name}: {reason(error)}")
    return copy


def _definition(topic: StoredTopic) -> MessageDefinition:
    """A topic's definition as the file has it; what it lacks, from the package if that agrees."""
    known = MessageDefinition(topic.type_name, topic.definition, topic.type_hash)
    if known.type_hash and known.text:
        return known
    try:
        *module, name = topic.type_name.split("/")
        installed = read_definition(getattr(import_module(".".join(module)), name))
    except (ImportError, AttributeError, ValueError, RecordingError):
        installed = None
    if installed is not None and known.text.strip() in ("", installed.text.strip()):
        return installed
    return known._replace(type_hash=known.type_hash or _hash_of(topic))


def _hash_of(topic: StoredTopic) -> str:
    """The hash of a definition that is not installed here."""
    try:
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(topic.definition, topic.type_name))
        return store.hash_rihs01(topic.type_name)
    except Exception:  # of a definition that is not sound the parser raises anything
        return _UNKNOWN_HASH


def _offered(topic: StoredTopic) -> list[Qos]:
    try:
        return parse_qos(topic.offered_qos)
    except Exception:  # likewise: the messages matter more
        return []
