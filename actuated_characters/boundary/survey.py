"""The rounds of a search: in each, the runs that follow from what has become of those before.

So the numbers of the runs depend on outcomes alone, not on the order in which workers answer, and
a search that was interrupted finds its runs in the journal again.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from actuated_characters.boundary.bisection import (
    Boundary,
    Value,
    find_boundary,
    most_tries,
    values_to_try,
)
from actuated_characters.boundary.file import FELL, Search
from actuated_characters.sweep.grid import Cell, Row
from actuated_characters.sweep.journal import Done, Journal
from actuated_characters.sweep.work import Job, Report, Workers, is_done, work


@dataclass
class Point:
    """What is known of a point of the grid."""

    number: int  # from 1 on
    cells: Mapping[str, Cell]
    rows: dict[Value, Row] = field(default_factory=dict)  # those that were run, by value
    tried: dict[Value, bool] = field(default_factory=dict)
    error: str = ""  # why one of its runs says nothing, after which there are no more

    def end(self, boundary: Boundary) -> Row:
        """The run that shows where the way ends: the first that fails, or else the last one."""
        value = list(self.rows)[-1] if boundary.fails is None else boundary.fails
        return self.rows[value]


class Survey:
    """A search on its way: which runs are next, and what is known of each point."""

    def __init__(self, search: Search) -> None:
        self.search = search
        self.points = [Point(number, cells) for number, cells in search.points()]
        self.rows: list[Row] = []
        self._pending: list[Row] = []  # of the round that is not over

    def advance(self, done: Mapping[int, Done]) -> list[Row]:
        """The runs that are next, some of which are not done; none when there are no more."""
        while all(row.number in done for row in self._pending):
            for point in self.points:
                self._learn(point, done)
            self._pending = self._next_round()
            if not self._pending:
                break
        return self._pending

    def _next_round(self) -> list[Row]:
        before = len(self.rows)
        for point in self.points:
            for value in [] if point.error else values_to_try(self.search.way, point.tried):
                row = self.search.row(point.number, value, len(self.rows) + 1)
                point.rows[value] = row
                self.rows.append(row)
        return self.rows[before:]

    def most_rows(self) -> int:
        """How many runs there will be at most."""
        return len(self.points) * (most_tries(self.search.way) + 1)

    def boundary(self, point: Point) -> Boundary:
        """What is known of a point's boundary."""
        return find_boundary(self.search.way, point.tried)

    def shown(self) -> dict[int, tuple[Row, Row]]:
        """By point: the run at the end of its way, and the same that is made whole, as a new row.

        These are known when there are no more rounds.
        """
        known = [point for point in self.points if point.tried and not point.error]
        ends = [point.end(self.boundary(point)) for point in known]
        numbers = range(len(self.rows) + 1, len(self.rows) + 1 + len(ends))
        return {
            point.number: (end, replace(end, number=number))
            for point, end, number in zip(known, ends, numbers, strict=True)
        }

    def all_rows(self) -> list[Row]:
        """Those that were tried, and those that were made whole."""
        return [*self.rows, *(row for _, row in self.shown().values())]

    def differences(self, done: Mapping[int, Done]) -> list[str]:
        """A line for each run that became something else when it was made once more."""
        pairs = [(end, row) for end, row in self.shown().values() if row.number in done]
        ends_at_falls = self.search.figure == FELL
        lines = [
            _difference(done[end.number], done[row.number], ends_at_fall=ends_at_falls)
            for end, row in pairs
        ]
        return list(filter(None, lines))

    def _learn(self, point: Point, done: Mapping[int, Done]) -> None:
        for value, row in point.rows.items():
            outcome = done[row.number].outcome
            failed = self.search.has_failed(outcome)
            if failed is None:
                why = outcome.error or f"it has no figure '{self.search.figure}'"
                point.error = point.error or f"row {row.number}: {why}"
            point.tried[value] = failed is True


def survey(
    found: Survey,
    directory: Path,
    workers: Workers,
    journal: Journal,
    progress: Callable[[], object] = lambda: None,
) -> Report:
    """Have all runs of a search done.

    Raises:
        RunError: no more answers will come, or the journal cannot be written.
    """
    while rows := found.advance(journal.done):
        job = Job(rows, directory, until_fall=found.search.figure == FELL)
        report = work(job, workers, journal, progress)
        if report.undone:
            return report  # the numbers of all later runs depend on it
    return Report()


def show_ends(
    found: Survey,
    directory: Path,
    workers: Workers,
    journal: Journal,
    progress: Callable[[], object] = lambda: None,
) -> Report:
    """Have those at the boundaries made once more, whole and with bags if these are asked for.

    Raises:
        RunError: as `survey`, or a bag cannot be written.
    """
    return work(_whole(found, directory), workers, journal, progress)


def is_over(found: Survey, directory: Path, journal: Journal) -> bool:
    """Whether there is nothing left to do."""
    return not found.advance(journal.done) and is_done(_whole(found, directory), journal)


def _whole(found: Survey, directory: Path) -> Job:
    return Job([row for _, row in found.shown().values()], directory, found.search.bags)


def _difference(tried: Done, whole: Done, *, ends_at_fall: bool) -> str:
    """The first thing that one of two runs says otherwise than the other; empty: nothing.

    Where the one ended with the fall, the other one may fail after it.
    """
    first, second = tried.outcome, whole.outcome
    both = [(name, first.figures.get(name), second.figures.get(name)) for name in first.figures]
    if not (ends_at_fall and first.figures.get(FELL) is True):
        both.append(("error", first.error or None, second.error or None))
    said = (
        f"{name} of row {whole.number} is {other}, of row {tried.number}, the same run, {one}"
        for name, one, other in both
        if one != other
    )
    return next(said, "")
