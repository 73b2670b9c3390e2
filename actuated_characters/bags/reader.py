"""Reads recordings: rosbag2 directories of serialised messages, without ROS' rosbag2."""

import heapq
import tempfile
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from actuated_characters.bags.format import limits, metadata, storage
from actuated_characters.bags.format.definitions import find_message_type
from actuated_characters.bags.format.mcap_file import McapFile
from actuated_characters.bags.format.sqlite_file import SqliteFile
from actuated_characters.bags.format.storage import Beginning
from msgs_config.errors import RecordingError, one_of
from msgs_config.file_kinds import refuse_other_kind

_ALL = Beginning()


class RecordedMessage(NamedTuple):
    """A message of a recording, serialised as it was received."""

    topic: str
    log_time_ns: int
    raw: bytes
    type_name: str  # such as "sensor_msgs/msg/JointState"
    published_ns: int | None = None  # wall time; None where nothing says it

    @property
    def sent_ns(self) -> int:
        """Time of publishing, ns; the log time, maybe a simulated one, where nothing says it."""
        return self.log_time_ns if self.published_ns is None else self.published_ns

    def decode(self) -> Any:
        """The message as an object of its ROS class.

        Raises:
            RecordingError: The class is not installed, or the bytes are no such message.
        """
        from rclpy.serialization import deserialize_message

        try:
            return deserialize_message(self.raw, find_message_type(self.type_name))
        except RuntimeError as error:
            raise RecordingError(
                f"message on '{self.topic}' at {self.log_time_ns} ns is no {self.type_name}"
            ) from error


def read_messages(
    path: Path,
    topics: Collection[str] | None = None,
    *,
    first_ns: int = 0,
    whole: Collection[str] = (),
) -> Iterator[RecordedMessage]:
    """Yield the messages of a recording, or those of `topics` only.

    They come in the order of their log times; those of equal time in that of their publishing, and
    then as they were written.

    Args:
        path: A rosbag2 directory, or a single .mcap or .db3 file that is complete.
        topics: Names as they are in the recording.
        first_ns: Log time from which on they are read.
        whole: Names of topics that are read from the start nevertheless.

    Raises:
        RecordingError: There is no complete recording at `path`, or it has none of a topic's name.
    """
    with open_bag(path) as bag:
        for message in bag.messages(topics, Beginning(first_ns, frozenset(whole))):
            if message.log_time_ns >= first_ns or message.topic in whole:
                yield message


def read_topics(path: Path) -> dict[str, str]:
    """The type of each topic of a recording by its name, such as `sensor_msgs/msg/JointState`.

    Raises:
        RecordingError: there is no complete recording at `path`.
    """
    with open_bag(path) as bag:
        return bag.types


@contextmanager
def open_bag(path: Path) -> "Iterator[OpenBag]":
    """Open a recording, to read of it what is wanted; any error in there gets its name.

    Raises:
        RecordingError: There is no complete recording at `path`, or it is damaged in what is read.
    """
    with _reading(path) as stack:
        read = metadata.BagMetadata((path,), (), "", {})
        if not path.is_file():
            read = metadata.read_metadata(path)
        files = [_open(path, file, read.compression_mode, stack) for file in read.files]
        yield OpenBag(path, read, files)


class OpenBag:
    """A recording whose files are open."""

    def __init__(
        self, path: Path, read: metadata.BagMetadata, files: Sequence[McapFile | SqliteFile]
    ) -> None:
        self.metadata = read
        topics = [topic for file in files for topic in file.topics.values()]
        self.types = {topic.name: topic.type_name for topic in topics}
        """The type of each topic, such as `sensor_msgs/msg/JointState`."""
        self.has_simulated_log_times = any(topic.has_simulated_log_time for topic in topics)
        self._path, self._is_file, self._files = path, path.is_file(), files

    def statistics(self) -> storage.FileStatistics:
        """Those of all files; messages are read only where a file has no statistics."""
        found = [each for each in (file.statistics() for file in self._files) if each.counts]
        return storage.FileStatistics(
            sum((Counter(each.counts) for each in found), Counter()),
            min((each.first_ns for each in found), default=0),
            max((each.last_ns for each in found), default=0),
        )

    def messages(
        self, topics: Collection[str] | None = None, beginning: Beginning = _ALL
    ) -> Iterator[RecordedMessage]:
        """Yield messages as `read_messages` does; one such reading at a time.

        Some of those before the beginning may be among them.
        """
        recorded = self.types.keys() | set(self.metadata.topics)
        names = recorded if topics is None else set(topics)
        if unknown := sorted(names - recorded):
            raise RecordingError(one_of("topic", unknown[0], sorted(recorded)))
        places = self.metadata.files
        streams = [
            _read(self._path, place, file, names, beginning)
            for place, file in zip(places, self._files, strict=True)
        ]
        for message in heapq.merge(*streams, key=lambda each: each.log_time_ns):
            yield self._unpacked(message)

    def _unpacked(self, message: storage.StoredMessage) -> RecordedMessage:
        log_time_ns, published_ns, _, topic, stored, _ = message
        packed = self.metadata.compression_mode == metadata.MESSAGE
        if self._is_file:  # no metadata says whether messages are compressed
            packed = stored.startswith(storage.ZSTD_MAGIC)
        try:
            raw = limits.unpack_message(stored, packed=packed)
        except limits.LimitError as error:
            raise ValueError(f"on '{topic.name}' {error}") from error
        return RecordedMessage(topic.name, log_time_ns, raw, topic.type_name, published_ns)


@contextmanager
def _reading(path: Path) -> Iterator[ExitStack]:
    """Close what is opened, and give the errors of libraries the recording's name."""
    with ExitStack() as stack:
        try:
            yield stack
        except RecordingError:
            raise
        except Exception as error:  # the libraries raise anything for a damaged file
            text = f"cannot read recording {path}: {storage.reason(error)}"
            if path.is_dir():  # nothing can be recovered of a file alone
                text += metadata.recover_hint(path, "keeps what is whole of it")
            raise RecordingError(text) from error


def _open(path: Path, file: Path, compression_mode: str, stack: ExitStack) -> McapFile | SqliteFile:
    """Open a file of a recording, decompressed if need be."""
    with _naming(path, file):
        if not file.is_file():
            raise RecordingError(f"cannot read recording {path}: its file {file.name} is missing")
        refuse_other_kind(file, "a file of a bag", storage.FILE_SUFFIXES, RecordingError)
        if compression_mode == metadata.FILE and file.suffix == storage.ZSTD_SUFFIX:
            copy = Path(stack.enter_context(tempfile.TemporaryDirectory())) / file.stem
            limits.unpack_file(file, copy)
            file = copy
        opened: McapFile | SqliteFile
        if file.suffix == storage.SUFFIXES[storage.MCAP]:
            opened = McapFile(file)
        elif file.suffix == storage.SUFFIXES[storage.SQLITE3]:
            opened = SqliteFile(file)
        else:
            raise RecordingError(
                f"cannot read recording {path}: {file.name} is no .mcap or .db3 file"
            )
        opened.open_closed(stack)
    for topic in opened.topics.values():
        if topic.serialization != storage.CDR:
            raise RecordingError(
                f"cannot read recording {path}: '{topic.name}' is serialised as "
                f"{topic.serialization}, not as {storage.CDR}"
            )
    return opened


def _read(
    path: Path,
    place: Path,
    file: McapFile | SqliteFile,
    names: Collection[str],
    beginning: Beginning,
) -> Iterator[storage.StoredMessage]:
    with _naming(path, place):
        yield from file.messages_by_time(names, beginning)


@contextmanager
def _naming(path: Path, file: Path) -> Iterator[None]:
    """Let errors begin with the name of the file, unless it is all of the recording."""
    try:
        yield
    except RecordingError:
        raise
    except Exception as error:
        name = "" if path == file else f"{file.name}: "
        raise ValueError(f"{name}{storage.reason(error)}") from error
