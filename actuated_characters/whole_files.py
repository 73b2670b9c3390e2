"""Files that are written whole or not at all: under another name until all of them is there."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from msgs_config.errors import RecordingError


def part_of(path: Path) -> Path:
    """Where a file is as long as it is not whole: beside its place, hidden."""
    return path.with_name(f".{path.name}.part")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A name to write a file under, which gets its own name at the end.

    After an error what was there before is still there, and nothing of the new file.
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
    """Like `replacing`, and what the file system objects to is one line.

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
