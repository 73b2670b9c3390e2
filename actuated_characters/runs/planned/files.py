"""The files by which planned pushes and throws reach the node that sends them."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

from msgs_config.errors import CommandError, RecordingError
from msgs_config.whole_files import write_whole

T = TypeVar("T")


@dataclass(frozen=True)
class Planned:
    """An input that begins with the tick of a stamp."""

    stamp_ns: int


def write_planned(file: Path, planned: Sequence[Planned]) -> None:
    """Write planned inputs as JSON, the first one first; raises RecordingError as `write_whole`."""
    in_order = sorted(planned, key=lambda each: each.stamp_ns)
    write_whole(file, json.dumps([asdict(each) for each in in_order], indent=1))


def read_planned(file: Path, what: str, make: Callable[[Mapping[str, Any]], T]) -> list[T]:
    """Read what `write_planned` wrote; `make` builds an object of its fields.

    Raises:
        RecordingError: the file does not exist, or holds no `what`.
    """
    try:
        return [make(each) for each in json.loads(file.read_text("utf-8"))]
    except (OSError, ValueError, TypeError, KeyError, CommandError) as error:
        raise RecordingError(f"{file} holds no {what}: {error}") from error
