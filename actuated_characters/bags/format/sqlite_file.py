"""Reads the SQLite files of bags by log time: the tables of rosbag2 since Foxy."""

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

from actuated_characters.bags.format import limits
from actuated_characters.bags.format.storage import (
    LOG_TIME,
    MOST_OF_METADATA,
    SIMULATED,
    Beginning,
    FileStatistics,
    StoredMessage,
    StoredTopic,
)
from msgs_config.errors import RecordingError
from msgs_config.files import parse_yaml

_LONGEST_ROW = limits.MOST_OF_MESSAGE + 1024  # bytes


class SqliteFile:
    """A file of SQLite without a journal."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.topics: dict[int, StoredTopic] = {}
        """By number, those of the file: with messages or without."""

    def open_closed(self, stack: ExitStack) -> None:
        """Open the file until `stack` is closed; then `messages_by_time` can be read.

        Raises:
            ValueError, sqlite3.Error: it was not closed, is damaged, or is no bag's.
        """
        name = self._path.name
        for journal in (self._path.with_name(name + end) for end in ("-journal", "-wal")):
            if journal.is_file() and journal.stat().st_size > 0:
                raise ValueError(
                    "it was never closed, a journal lies beside it; "
                    f"'sqlite3 {name} .tables' makes it whole"
                )
        uri = f"{self._path.absolute().as_uri()}?immutable=1"
        self._tables = stack.enter_context(closing(sqlite3.connect(uri, uri=True)))
        self._tables.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LONGEST_ROW)
        rows = self._tables.execute("SELECT id, name, type, serialization_format FROM topics")
        simulated = self._has_simulated_log_time()
        self.topics = {
            number: StoredTopic(*topic)._replace(has_simulated_log_time=simulated)
            for number, *topic in rows
        }

    def _has_simulated_log_time(self) -> bool:
        """Whether the metadata in the file says so; older files have none."""
        try:
            (text,) = self._tables.execute("SELECT metadata FROM metadata").fetchone()
            content = parse_yaml("its metadata", str(text), RecordingError, most=MOST_OF_METADATA)
            return bool(content["custom_data"][LOG_TIME] == SIMULATED)
        except (sqlite3.OperationalError, RecordingError, KeyError, TypeError):
            return False

    def statistics(self) -> FileStatistics:
        """Count the messages without reading them. Raises sqlite3.Error: the file is damaged."""
        rows = self._tables.execute(
            "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages "
            "GROUP BY topic_id"
        ).fetchall()
        counts = {self.topics[number].name: count for number, count, _, _ in rows}
        first_ns = min((each for *_, each, _ in rows), default=0)
        return FileStatistics(counts, first_ns, max((each for *_, each in rows), default=0))

    def messages_by_time(
        self, names: Collection[str], beginning: Beginning | None = None
    ) -> Iterator[StoredMessage]:
        """Yield the messages on some topics by log time, also those before the beginning.

        Raises:
            ValueError, sqlite3.Error: the file is damaged, or a message is too large.
        """
        chosen = [number for number, topic in self.topics.items() if topic.name in names]
        try:
            for number, log_time_ns, place, raw in self._tables.execute(
                "SELECT topic_id, timestamp, id, CAST(data AS BLOB) FROM messages "
                f"WHERE topic_id IN ({', '.join('?' * len(chosen))}) ORDER BY timestamp, id",
                chosen,
            ):
                topic = self.topics[number]
                published_ns = None if topic.has_simulated_log_time else log_time_ns
                yield StoredMessage(log_time_ns, published_ns, (place, 0), topic, raw)
        except sqlite3.DataError as error:
            raise limits.LimitError(
                f"a message: larger than the limit of {limits.MOST_OF_MESSAGE >> 20} MiB"
            ) from error
