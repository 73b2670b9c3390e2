"""The files of a new rosbag2 directory: rosbags' writer, with a flush and with clear errors."""

import shutil
import sqlite3
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from rosbags.interfaces import Connection, Qos
from rosbags.rosbag2 import (
    CompressionFormat,
    CompressionMode,
    StoragePlugin,
    Writer,
    WriterError,
)
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer

from actuated_characters.bags.definitions import MessageDefinition
from actuated_characters.bags.directory_lock import DirectoryLock
from msgs_config.errors import ConfigurationError, RecordingError, one_of

MCAP, SQLITE3 = "mcap", "sqlite3"
NONE, ZSTD = "none", "zstd"
STORAGES, COMPRESSIONS = (MCAP, SQLITE3), (NONE, ZSTD)
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"  # no message begins so: CDR begins with a zero
SUFFIXES = {MCAP: ".mcap", SQLITE3: ".db3"}

_PLUGINS = {MCAP: StoragePlugin.MCAP, SQLITE3: StoragePlugin.SQLITE3}
_MODES = {MCAP: CompressionMode.STORAGE, SQLITE3: CompressionMode.MESSAGE}
_REFUSED = (OSError, sqlite3.Error)  # what a disk that is full or gone makes of a write


class BagFiles:
    """Writes a rosbag2 directory of version 9, of topics as they are told: nothing is checked.

    Compressed are the chunks of MCAP, and each message of SQLite: what rosbag2 can do with each.
    """

    def __init__(self, path: Path, storage: str, compression: str) -> None:
        """Create the directory `path`, and its parents; nothing stays of it where that fails.

        Raises:
            ConfigurationError: there is no such storage or compression.
            RecordingError: `path` exists already or cannot be created.
        """
        if storage not in STORAGES:
            raise ConfigurationError(one_of("storage", storage, list(STORAGES)))
        if compression not in COMPRESSIONS:
            raise ConfigurationError(one_of("compression", compression, list(COMPRESSIONS)))
        check_sqlite_path(path, storage)
        self.path = path
        self.is_open = False
        try:
            self._writer = Writer(path, version=9, storage_plugin=_PLUGINS[storage])
            if compression == ZSTD:
                self._writer.set_compression(_MODES[storage], CompressionFormat.ZSTD)
            self._open()
        except WriterError as error:
            raise RecordingError(
                f"recording {path} exists already; remove it or choose another directory"
            ) from error
        except _REFUSED as error:
            raise RecordingError(f"cannot create recording {path}: {reason(error)}") from error
        self.is_open = True

    def _open(self) -> None:
        try:
            self._writer.open()
            self._claim = DirectoryLock(self.path)  # so that nobody recovers it meanwhile
        except _REFUSED:
            with suppress(*_REFUSED):
                self._writer.abort()
            shutil.rmtree(self.path, ignore_errors=True)  # it was not there before
            raise
        storage = self._writer.storage
        if isinstance(storage, Sqlite3Writer):
            # A process that is killed loses nothing by it, and a commit does not wait for the disk.
            storage.conn.execute("PRAGMA synchronous=OFF")

    def add(self, topic: str, definition: MessageDefinition, offered: Sequence[Qos]) -> Connection:
        """Announce a topic with what its publishers offer; its handle for `append`.

        Raises:
            RecordingError: the recording is closed, has the topic already, or the disk is full.
        """
        self.check_open()
        try:
            return self._writer.add_connection(
                topic,
                definition.type_name,
                msgdef=definition.text,
                rihs01=definition.type_hash,
                offered_qos_profiles=offered,
            )
        except WriterError as error:
            raise RecordingError(f"recording {self.path} has topic '{topic}' already") from error
        except _REFUSED as error:
            raise self._abandoned(error) from error

    def append(self, connection: Connection, raw: bytes, log_time_ns: int) -> None:
        """Append a message.

        Raises:
            RecordingError: the recording is closed, or the disk refuses the data, which closes it.
        """
        self.check_open()
        try:
            self._writer.write(connection, log_time_ns, raw)
        except _REFUSED as error:
            raise self._abandoned(error) from error

    def flush(self) -> None:
        """Hand all that was written to the operating system.

        What was flushed outlives this process, however that ends: `actuated_characters recover`
        makes a recording of MCAP's, and SQLite's file can be read alone. Without it a killed
        recorder loses up to the last MiB of MCAP, and all of SQLite.

        Raises:
            RecordingError: the recording is closed, or the disk refuses the data, which closes it.
        """
        self.check_open()
        try:
            self._flush()
        except _REFUSED as error:
            raise self._abandoned(error) from error

    def _flush(self) -> None:
        """rosbags has no public way to do it: this is the one place that knows its insides."""
        storage = self._writer.storage
        if isinstance(storage, McapWriter):
            if storage.chunk.msgs:  # an empty chunk would be a record for nothing
                storage.close_chunk()
            storage.bio.flush()
        elif isinstance(storage, Sqlite3Writer):
            storage.conn.commit()

    def close(self) -> None:
        """Complete the recording: the rest of the messages, the index and the metadata.

        Closing again does nothing.

        Raises:
            RecordingError: the disk refuses the data.
        """
        if not self.is_open:
            return
        self.is_open = False
        try:
            self._writer.close()
        except _REFUSED as error:
            raise self._abandoned(error) from error
        finally:
            self._claim.release()

    def check_open(self) -> None:
        """Raises RecordingError once the recording is closed."""
        if not self.is_open:
            raise RecordingError(f"recording {self.path} is closed")

    def _abandoned(self, cause: Exception) -> RecordingError:
        """Give up the file, whose end is undefined now; it has no index and no metadata."""
        self.is_open = False
        with suppress(*_REFUSED):  # it flushes once more, to the same full disk
            self._writer.abort()
        self._claim.release()
        return RecordingError(f"recording {self.path} is incomplete, cannot write: {reason(cause)}")


def check_sqlite_path(path: Path, storage: str) -> None:
    """Refuse what SQLite would take for a part of a URI, and then use another file.

    Raises:
        RecordingError: there is such a character in the path of a recording of this storage.
    """
    found = next((character for character in "?#%" if character in str(path)), None)
    if storage == SQLITE3 and found is not None:
        raise RecordingError(f"recording {path}: storage sqlite3 allows no '{found}' in its path")


def reason(error: Exception) -> str:
    """What an error of others says, in one line."""
    text = (error.strerror if isinstance(error, OSError) else None) or str(error)
    return " ".join(text.split()) or type(error).__name__
