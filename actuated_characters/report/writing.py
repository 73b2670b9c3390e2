"""Writes a report: a page, and its pictures beside it."""

import re
from pathlib import Path

from actuated_characters.bags.recording import find_bag, read_recordings
from actuated_characters.report.contents import Contents, read_contents
from actuated_characters.report.page import GENERATOR, Chapter, Section, Table, render_page
from actuated_characters.report.sections import NAMES, STILLS, CharacterReport
from actuated_characters.runs.run_directory import REPORT
from actuated_characters.whole_files import write_whole
from msgs_config.errors import RecordingError
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND

PAGE = "index.html"

_PICTURE = re.compile(rf"([0-9]+-[A-Za-z0-9_]*-)?({'|'.join(NAMES)})\.png")
_HEAD = 400  # characters of a page that are enough to see whose it is
_UNFIT = re.compile("[^A-Za-z0-9_]+")  # for the name of a file


def write_report(path: Path, output: Path | None = None, *, stills: int = STILLS) -> Path:
    """Report on a run's directory, or on a bag; returns the page.

    Args:
        path: The directory that a run, a recorder or `ros2 bag record` has left.
        output: Where page and pictures go; by default into the run's directory, or beside the bag.
            A report that is there is replaced.
        stills: How many pictures of each character.

    Raises:
        RecordingError: there is no whole recording, or the directory has other files in it, or
            cannot be written to.
        ActuatedCharactersError: a message is not what its topic should carry.
    """
    directory = output or default_directory(path)
    old = _old_files(directory)
    recordings = read_recordings(path)
    contents = read_contents(path)
    chapters = [Chapter("the bag", [_bag_section(contents)])]
    files: dict[str, bytes] = {}
    for number, recording in enumerate(recordings, start=1):
        several = len(recordings) > 1
        prefix = f"{number}-{_UNFIT.sub('_', recording.name)}-" if several else ""
        sections = CharacterReport(recording, prefix, stills).sections()
        title = recording.name or recording.character.name
        chapters.append(Chapter(title, sections))
        files |= {f"{i.name}.png": i.png for section in sections for i in section.illustrations}
    title = f"{', '.join(chapter.title for chapter in chapters[1:])}: {contents.bag}"
    files[PAGE] = render_page(title, chapters).encode("utf-8")
    _write(directory, old, files)
    return directory / PAGE


def default_directory(path: Path) -> Path:
    """Where the report on a run's directory, or on a bag, goes."""
    if find_bag(path) != path:
        return path / REPORT
    whole = path.absolute()
    return whole.with_name(f"{whole.name}-{REPORT}")


def _old_files(directory: Path) -> list[Path]:
    """The files of an earlier report.

    Raises:
        RecordingError: there is something else.
    """
    if not directory.exists():
        return []
    if not directory.is_dir():
        raise RecordingError(f"cannot write the report: {directory} is no directory")
    present = sorted(directory.iterdir())
    for file in present:
        own = _PICTURE.fullmatch(file.name) is not None or file.name == PAGE
        if not own or not file.is_file():
            raise RecordingError(f"{directory} holds other files than a report's: {file.name}")
    if present and not _is_own(directory / PAGE):
        raise RecordingError(f"{directory} holds other files than a report's: {present[0].name}")
    return present


def _is_own(page: Path) -> bool:
    try:
        with page.open(encoding="utf-8", errors="replace") as file:
            return GENERATOR in file.read(_HEAD)
    except OSError:
        return False


def _bag_section(contents: Contents) -> Section:
    facts = [
        ("bag", str(contents.bag)),
        ("files", ", ".join(f"{name} ({size} bytes)" for name, size in contents.files.items())),
        ("storage", f"{contents.storage}, compression {contents.compression}"),
        ("wall time", f"{contents.wall_time:.6g} s"),
    ]
    rows = [
        (
            topic.name,
            topic.type_name,
            str(topic.count),
            "-" if topic.rate_hz is None else f"{topic.rate_hz:.4g}",
            f"{topic.largest_gap_ns / NANOSECONDS_PER_SECOND:.4g}",
        )
        for topic in contents.topics
    ]
    columns = ("topic", "type", "messages", "per s", "largest gap (s)")
    return Section("contents", tables=[Table(facts), Table(rows, columns)])


def _write(directory: Path, old: list[Path], files: dict[str, bytes]) -> None:
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for file in old:
            file.unlink()
    except OSError as error:
        raise RecordingError(f"cannot write the report: {error}") from error
    for name, content in files.items():
        write_whole(directory / name, content)
