"""The journal of a sweep: a line for each row that is done, on the disk before the next one."""

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any

from actuated_characters.bags.directory_lock import DirectoryLock
from actuated_characters.runs.held_signals import signals_held
from actuated_characters.sweep.grid import Row
from actuated_characters.sweep.row import Outcome
from msgs_config.digests import sha256_of
from msgs_config.errors import RunError

JOURNAL = "rows.jsonl"
_FORMAT = 1


@dataclass(frozen=True)
class Done:
    """A row that is done."""

    number: int
    outcome: Outcome
    by: str  # the worker: its host and process


@dataclass(frozen=True)
class Verified:
    """A row that was computed once more."""

    number: int
    difference: str  # empty if there is none
    by: str


def fingerprint(rows: Iterable[Row], versions: Mapping[str, str], *also: object) -> dict[str, str]:
    """What a journal's results depend on: rows, the files that they name, versions, and more."""
    digest = hashlib.sha256()
    files: set[Path] = set()
    for row in rows:
        digest.update(json.dumps(row.arguments).encode())
        files |= {Path(each) for text in row.arguments if (each := text.rpartition("=")[2])}
    for file in sorted(file for file in files if is_file(file)):
        digest.update(f"{file} {sha256_of(file)}".encode())
    digest.update(" ".join(map(str, also)).encode())
    return {"rows": digest.hexdigest(), **versions}


class Journal:
    """What is done in a directory, which it holds against other sweeps until it is closed."""

    def __init__(self, directory: Path, made_of: Mapping[str, str], *, again: bool = False) -> None:
        """Open the journal of a directory, or begin one; `again` forgets what is done.

        Raises:
            RunError: it is of another sweep, another command writes it, or it cannot be written.
        """
        self.done: dict[int, Done] = {}
        self.verified: dict[int, Verified] = {}
        path = directory / JOURNAL
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self._lock = DirectoryLock(directory)
        except BlockingIOError as error:
            raise RunError(f"another command writes to {directory}; wait for its end") from error
        except OSError as error:
            raise RunError(f"cannot write to {directory}: {error.strerror or error}") from error
        try:
            self._open(path, made_of, again)
        except BaseException as error:
            self._lock.release()
            if isinstance(error, OSError):
                raise RunError(f"cannot write {path}: {error.strerror or error}") from error
            raise

    def _open(self, path: Path, made_of: Mapping[str, str], again: bool) -> None:
        self.has_forgotten = again and path.exists()
        lines = [] if again or not path.exists() else path.read_bytes().splitlines(keepends=True)
        if lines and not lines[-1].endswith(b"\n"):
            lines.pop()  # whoever wrote it was killed meanwhile
        head = {"sweep": _FORMAT, **made_of}
        if lines:
            self._read(path, lines, head)
        self._file: IO[bytes] = path.open("r+b" if lines else "wb")
        self._file.seek(sum(map(len, lines)))
        self._file.truncate()
        if not lines:
            self._append(head)

    def _read(self, path: Path, lines: Iterable[bytes], head: Mapping[str, object]) -> None:
        try:
            first, *records = map(json.loads, lines)
            if first != head:
                raise RunError(_mismatch(path, first, head))
            for record in records:
                self._take(record)
        except (ValueError, TypeError, KeyError) as error:
            raise RunError(f"{path}: no journal of runs; --again begins a new one") from error

    def _take(self, record: Mapping[str, Any]) -> None:
        if "verified" in record:
            verified = Verified(record["verified"], record["difference"], record["by"])
            self.verified[verified.number] = verified
            return
        done = Done(record["row"], Outcome(**record["outcome"]), record["by"])
        self.done[done.number] = done

    def add(self, done: Done) -> None:
        """Add a row that is done; it is on the disk when this returns.

        Raises:
            RunError: it cannot be written.
        """
        with signals_held():
            self._append({"row": done.number, "outcome": asdict(done.outcome), "by": done.by})
            self.done[done.number] = done

    def add_verified(self, verified: Verified) -> None:
        """Add a row that was computed once more, likewise."""
        record = {"verified": verified.number, "difference": verified.difference, "by": verified.by}
        with signals_held():
            self._append(record)
            self.verified[verified.number] = verified

    def _append(self, record: Mapping[str, object]) -> None:
        try:
            self._file.write(json.dumps(record).encode() + b"\n")
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            path = self._file.name
            raise RunError(f"cannot write {path}: {error.strerror or error}") from error

    def close(self) -> None:
        """Let others have the directory; closing again does nothing."""
        try:
            self._file.close()
        finally:
            self._lock.release()

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def _mismatch(path: Path, found: object, wanted: Mapping[str, object]) -> str:
    """A line that says in what a journal's head differs."""
    found = found if isinstance(found, dict) else {}
    others = [name for name in wanted if name != "rows" and found.get(name) != wanted[name]]
    if found.get("rows") == wanted["rows"] and others:
        changes = (f"{name} {found.get(name)} (now {wanted[name]})" for name in others)
        what = f"was made with {', '.join(changes)}"
    else:
        what = "is of another file, or a file that it names has changed"
    return f"{path} {what}; choose another --output, or --again, which deletes it"


def is_file(path: Path) -> bool:
    """Whether there is a file of that path, which may be any text."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # a text that is no path
        return False
