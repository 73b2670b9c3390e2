"""Takes of a timeline: recorded runs of its states, each kept with the take that it came from.

They are folders beside the file: of `dance.yaml` in `dance.takes`, named by their numbers. Each has
a run's results, the timeline as it was then (`timeline.yaml`), and `take.json`.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from controller_node.references.timeline.file import timeline_path
from msgs_config import files
from msgs_config.errors import MotionError, RecordingError, one_of
from msgs_config.whole_files import write_whole

TIMELINE, ABOUT = "timeline.yaml", "take.json"
_SUFFIX = ".takes"


@dataclass(frozen=True)
class Take:
    """A take that is there."""

    directory: Path
    parent: str  # its name; empty: it was simulated from the beginning
    begin: float  # s since the first state, where its recording begins
    since: float  # s, from which on it may differ from its parent
    until: float  # s, its end
    title: str = ""

    @property
    def name(self) -> str:
        """Its number."""
        return self.directory.name

    @property
    def timeline(self) -> Path:
        """The timeline that it is of."""
        return self.directory / TIMELINE

    def write(self) -> None:
        """Write what is known of it. Raises RecordingError as `write_whole`."""
        content = asdict(self)
        del content["directory"]
        write_whole(self.directory / ABOUT, json.dumps(content, indent=1))


class Takes:
    """The takes of a timeline, in a folder."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def all(self) -> list[Take]:
        """Those that are complete, the oldest first."""
        folders = self.directory.iterdir() if self.directory.is_dir() else ()
        found = [folder for folder in folders if folder.name.isdecimal()]
        takes = [_read(folder) for folder in sorted(found, key=lambda folder: int(folder.name))]
        return [take for take in takes if take is not None]

    def find(self, name: str) -> Take:
        """A take by its number. Raises MotionError if there is none."""
        takes = {take.name: take for take in self.all()}
        if name not in takes:
            raise MotionError(f"{self.directory}: {one_of('take', name, list(takes))}")
        return takes[name]

    def line(self, take: Take) -> list[Take]:
        """A take and those that it came from, the first one first."""
        line, known = [take], {each.name: each for each in self.all()}
        while (parent := known.get(line[0].parent)) is not None and parent not in line:
            line.insert(0, parent)
        return line

    def free_directory(self) -> Path:
        """A folder for the next take, which is made."""
        number = 1
        while True:
            folder = self.directory / str(number)
            try:
                folder.mkdir(parents=True)
            except FileExistsError:
                number += 1
            except OSError as error:
                raise RecordingError(f"{folder}: {error.strerror}") from error
            else:
                return folder


def takes_of(name: str) -> Takes:
    """The takes beside a timeline's file; those of a shipped one are in the working directory.

    Raises:
        MotionError: there is no shipped timeline of that name, or the file is of another kind.
    """
    file = timeline_path(name)
    return Takes((file if str(file) == name else Path(name)).with_suffix(_SUFFIX))


def _read(folder: Path) -> Take | None:
    """The take in a folder; None of one that is not complete."""
    try:
        content: Mapping[str, Any] = json.loads((folder / ABOUT).read_text("utf-8"))
        numbers = {name: float(content[name]) for name in ("begin", "since", "until")}
        return Take(folder, str(content["parent"]), title=str(content["title"]), **numbers)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_copy(timeline: Path, directory: Path) -> Path:
    """Write a timeline's text into a folder; clips beside its file are named by their paths.

    Raises:
        RecordingError: it cannot be written.
        MotionError: the file cannot be read.
    """
    text = files.read_text(timeline, MotionError)
    content = files.parse_yaml_mapping(timeline, text, MotionError)
    moved = False
    for entry in content.get("clips") or ():
        beside = timeline.parent.absolute() / str(entry["clip"])
        if beside.is_file() and str(beside) != entry["clip"]:
            entry["clip"], moved = str(beside), True
    copy = directory / TIMELINE
    write_whole(copy, files.dump_yaml(content) if moved else text)
    return copy
