"""Files that are written whole or not at all: under another name until all of them is there."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from msgs_config.errors import RecordingError


def part_of(path: Path) -> Path:
    """The path of a file while it is written: beside its place, hidden."""
    return path.with_name(f".{path.name}.part")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """The path to write a file to, which is renamed to `path` at the end.

    After an error the former file is still there, and nothing of the new one.
    """
    part = part_of(path)
    try:
        yield part
        part.replace(path)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


@contextmanager
def writing(path: Path) -> Iterator[Path]:
    """Like `replacing`, with an error of the file system in one line.

    Raises:
        RecordingError: the file cannot be written; says which and why.
    """
    try:
        with replacing(path) as part:
            yield part
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror or error}") from error


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file, a text as UTF-8. Raises RecordingError as `writing` does."""
    with writing(path) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)
