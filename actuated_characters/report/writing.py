"""Writes a report: a page, and its pictures beside it."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from shlex import quote

from actuated_characters.bags.recording import Recording, find_bag
from actuated_characters.bags.robots.reading import RobotRecording, RobotSource, read_any
from actuated_characters.recorder.run_directory import REPORT
from actuated_characters.report.page import GENERATOR, Section, Table, render_page
from actuated_characters.report.robot_sections import POSITIONS, RobotReport
from actuated_characters.report.sections import NAMES, STILLS, CharacterReport
from msgs_config.errors import RecordingError
from msgs_config.whole_files import write_whole

PAGE = "index.html"

_ANY = RobotSource()  # all characters of a run, or the robot that a bag names

_PICTURE = re.compile(rf"([0-9]+-[A-Za-z0-9_]*-)?({'|'.join((*NAMES, POSITIONS))})\.png")
_UNFIT = re.compile("[^A-Za-z0-9_]+")  # what the name of a file must not have

Progress = Callable[[int, int], None]
"""Is told the number of sections that are made, and that of all."""


def write_report(
    path: Path,
    output: Path | None = None,
    *,
    stills: int = STILLS,
    progress: Progress = lambda done, total: None,
    source: RobotSource = _ANY,
    told: Callable[[Sequence[Recording]], None] = lambda recordings: None,
) -> Path:
    """Report on a run's directory, or on a bag; returns the page.

    Args:
        path: The directory that a run, a recorder or `ros2 bag record` has left.
        output: Where page and pictures go; by default into the run's directory, or beside the bag.
            A report that is there is replaced once the new one is made.
        stills: Number of poses in the picture of each character.
        progress: Called after the bag is read, and after each section.
        source: Whose a bag of another robot is; of several characters the one.
        told: Called with what was read.

    Raises:
        RecordingError: there is no whole recording, or the directory has other files in it, or
            cannot be written to.
        ActuatedCharactersError: a message is not what its topic should carry.
    """
    directory = output or default_directory(path)
    _check_directory(directory)
    recordings = read_any(path, source)
    told(recordings)
    reports = _plan_reports(recordings, stills)
    done, total = 0, sum(len(report.makers) for report in reports)
    progress(done, total)
    sections, files = list[Section](), dict[str, bytes]()
    for report in reports:
        for make in report.makers:
            sections.append(make())
            files |= {f"{each.name}.png": each.png for each in sections[-1].illustrations}
            progress(done := done + 1, total)
    which = "".join(f" --{name} {quote(value)}" for name, value in vars(source).items() if value)
    run = quote(str(path))
    rest = [
        (f"actuated_characters view {run}{which}", "the motion, its reference, plots over time"),
        (f"actuated_characters info {run} --ticks", "topics, gains, times between messages"),
    ]
    sections.append(Section("the rest", tables=[Table(rest, ("command", "shows"))]))
    page = render_page(", ".join(report.title for report in reports), sections)
    _write(directory, {PAGE: page.encode("utf-8")} | files)
    return directory / PAGE


def _plan_reports(recordings: Sequence[Recording], stills: int) -> list[CharacterReport]:
    """The report of each character; of several, each is a chapter, and named in its files."""
    reports = []
    for number, recording in enumerate(recordings, start=1):
        name = recording.name if len(recordings) > 1 else ""
        prefix = f"{number}-{_UNFIT.sub('_', name)}-" if name else ""
        kind = RobotReport if isinstance(recording, RobotRecording) else CharacterReport
        reports.append(kind(recording, prefix, stills, chapter=name))
    return reports


def default_directory(path: Path) -> Path:
    """Where the report on a run's directory, or on a bag, goes."""
    if find_bag(path) != path:
        return path / REPORT
    whole = path.absolute()
    return whole.with_name(f"{whole.name}-{REPORT}")


def _check_directory(directory: Path) -> None:
    """Raise RecordingError unless a directory is new, empty, or an earlier report's."""
    if directory.exists() and not directory.is_dir():
        raise RecordingError(f"cannot write the report: {directory} is no directory")
    present = sorted(directory.iterdir()) if directory.exists() else []
    page = directory / PAGE
    is_report = page.is_file() and GENERATOR in page.read_text(encoding="utf-8", errors="replace")
    if present and not is_report:
        first = page if page in present else present[0]
        raise RecordingError(f"{directory} holds other files than a report's: {first.name}")


def _write(directory: Path, files: dict[str, bytes]) -> None:
    """Write the files, and remove old pictures; the page comes first: it marks the directory."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            write_whole(directory / name, content)
        for file in directory.iterdir():
            if file.name not in files and _PICTURE.fullmatch(file.name):
                file.unlink()
    except OSError as error:
        raise RecordingError(f"cannot write the report: {error}") from error
