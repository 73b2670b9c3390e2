"""The page of a trial: shares with their intervals, films of failures, and the table."""

from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from shlex import quote

from matplotlib.image import imsave

from actuated_characters.bags.recording import read_recording
from actuated_characters.render.movie import Movie, MovieSettings
from actuated_characters.render.stills import strip
from actuated_characters.report.page import (
    NOT_KNOWN,
    Film,
    Illustration,
    Section,
    Table,
    render_page,
)
from actuated_characters.sweep.grid import Cell, Row, parameter_name
from actuated_characters.sweep.journal import Done
from actuated_characters.sweep.row import row_directory
from actuated_characters.sweep.table import TABLE, Record
from actuated_characters.trial.results import FILMS
from actuated_characters.trial.trial_set import FIGURES, KIND, TrialSet
from actuated_characters.trial.wilson import wilson_interval
from msgs_config.errors import ActuatedCharactersError
from msgs_config.runtime.extras import hint
from msgs_config.versions import installed_versions
from msgs_config.whole_files import write_whole

PAGE = "index.html"
_FILM_SIZE = (640, 360)  # pixels
_STILLS = 6  # of a failure, where there are no films
_FIRST, _LAST = ("row", KIND), ("survived", "failed_at_s", "state_hash")
_WORDS = ("error", "verdict")  # why a row failed is in the first of these that is there


def survived(done: Done) -> bool:
    """Whether a row did what was asked."""
    return done.outcome.figures.get("survived") is True


def survival_table(trials: TrialSet, done: Mapping[int, Done]) -> Table:
    """How many rows of each kind survived, their share, and the interval that it lies in."""
    every = [
        (kind.name, [done[r.number] for r in kind.rows if r.number in done])
        for kind in trials.kinds
    ]
    if len(every) > 1:
        every.append(("all", [each for _, rows in every for each in rows]))
    rows = []
    for name, outcomes in every:
        count, total = sum(map(survived, outcomes)), len(outcomes)
        low, high = wilson_interval(count, total)
        share = f"{count / total:.0%}" if total else NOT_KNOWN
        errors = sum(bool(each.outcome.error) for each in outcomes)
        interval = f"{low:.0%} to {high:.0%}"
        rows.append((name, str(total), str(count), str(errors), share, interval))
    columns = ("kind", "rows", "survived", "errors", "share", "95 % interval")
    return Table(rows, columns)


def make_films(
    directory: Path,
    failures: Sequence[int],
    most: int,
    *,
    as_films: bool,
    progress: Callable[[int], object] = lambda done: None,
) -> dict[int, Film | Illustration]:
    """Films, or strips of pictures, of the first rows whose bags are kept; by the row's number.

    Raises:
        RecordingError: a film cannot be written.
    """
    made = dict[int, Film | Illustration]()
    if failures and as_films:
        (directory / FILMS).mkdir(exist_ok=True)
    for number in failures:
        if len(made) >= most:
            break
        try:
            recording = read_recording(row_directory(directory, number))
        except ActuatedCharactersError:  # it ended before there was anything to be seen
            continue
        if as_films:
            name = f"{FILMS}/{number:05d}.mp4"
            Movie([recording], MovieSettings(size=_FILM_SIZE)).save(directory / name)
            made[number] = Film(name, f"row {number}")
        else:
            content = BytesIO()
            imsave(content, strip(recording, _STILLS), format="png")
            made[number] = Illustration(f"{number:05d}", content.getvalue(), f"row {number}")
        progress(len(made))
    return made


def write_page(
    directory: Path,
    controller: str,
    trials: TrialSet,
    done: Mapping[int, Done],
    records: Sequence[Record],
    films: Mapping[int, Film | Illustration],
) -> Path:
    """Write the page, which needs nothing but the films beside it; returns its path.

    Raises:
        RecordingError: it cannot be written.
    """
    rows = {row.number: row for row in trials.rows}
    count = sum(map(survived, done.values()))
    low, high = wilson_interval(count, len(done))
    sections = [
        Section(
            "",
            verdict=f"{controller} survived {count} of {len(done)} trials of '{trials.name}'"
            + (f": {trials.about}." if trials.about else "."),
            tiles=[("95 % interval", f"{low:.0%} to {high:.0%}"), ("rows", str(len(rows)))],
            tables=[survival_table(trials, done)],
            remarks=[
                "The interval is Wilson's (1927): where the share may lie if there were "
                "more of the same kind. Whether a row survived was measured on the recorded states "
                "alone; one with an error did not survive."
            ],
        ),
        *_failures(rows, done, films),
        Section("rows", tables=[_rows_table(records)], remarks=[f"The same in full: {TABLE}"]),
        _again(directory, done),
    ]
    page = directory / PAGE
    write_whole(page, render_page(f"{controller}: {trials.name}", sections))
    return page


def _failures(
    rows: Mapping[int, Row], done: Mapping[int, Done], films: Mapping[int, Film | Illustration]
) -> list[Section]:
    """A section for each failure that there is a film or a picture of."""
    sections: list[Section] = []
    for number, film in films.items():
        outcome = done[number].outcome
        cells = ", ".join(f"{name} {_shown(cell)}" for name, cell in rows[number].cells.items())
        said = outcome.verdict or outcome.error
        sections.append(
            Section(
                f"row {number}: {cells}",
                illustrations=[film] if isinstance(film, Illustration) else [],
                films=[film] if isinstance(film, Film) else [],
                remarks=[said],
                chapter="" if sections else "failures",
            )
        )
    if sections and any(isinstance(film, Illustration) for film in films.values()):
        sections.append(Section("", remarks=[f"Films in place of pictures: {hint('video')}"]))
    return sections


def _rows_table(records: Sequence[Record]) -> Table:
    """The rows: what varies in each in a few words, its end, and the beginning of its hash."""
    own = (*_FIRST, *_LAST, *_WORDS, *FIGURES)
    rows = []
    for record in records:
        varies = {name: cell for name, cell in record.items() if name not in own}
        words = [f"{parameter_name(n)} {_shown(c)}" for n, c in varies.items() if c is not None]
        first, last = ([_cell(n, record[n]) for n in part] for part in (_FIRST, _LAST))
        why = "" if record["survived"] else next((str(record[w]) for w in _WORDS if record[w]), "")
        rows.append([*first, ", ".join(words) or NOT_KNOWN, *last, why or NOT_KNOWN])
    return Table(rows, (*_FIRST, "what varies", *_LAST, "why"))


def _cell(name: str, cell: Cell) -> str:
    return str(cell)[:8] if name == "state_hash" and cell else _shown(cell)


def _shown(cell: Cell) -> str:
    if cell is None:
        return NOT_KNOWN
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)


def _again(directory: Path, done: Mapping[int, Done]) -> Section:
    """How anybody repeats it, and what it was made with."""
    place = quote(directory.name)
    commands = [
        (f"actuated_characters verify {place}", "runs all rows again, and compares their hashes"),
        (f"actuated_characters verify {place} --row {min(done, default=1)}", "runs this one again"),
    ]
    kept = sorted(n for n in done if row_directory(directory, n).is_dir())
    if kept:
        bag = f"{place}/{row_directory(directory, kept[0]).relative_to(directory)}"
        commands.append((f"actuated_characters view {bag}", "shows the motion of a row"))
    hosts = sorted({each.by.partition(" (")[0] for each in done.values()})
    versions = [*installed_versions().items(), ("host", ", ".join(hosts))]
    return Section(
        "to repeat it",
        tables=[Table(commands, ("command", "what")), Table(versions, ("of", "version"))],
    )
