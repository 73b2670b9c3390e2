"""The rounds of a search: in each, the runs that follow from what has become of those before.

So the numbers of the runs depend on outcomes alone, not on the order in which workers answer, and
a search that was interrupted finds its runs in the journal again.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from actuated_characters.boundary.bisection import (
    Boundary,
    Value,
    find_boundary,
    most_tries,
    values_to_try,
)
from actuated_characters.boundary.file import Search
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
        return len(self.points) * most_tries(self.search.way)

    def boundary(self, point: Point) -> Boundary:
        """What is known of a point's boundary."""
        return find_boundary(self.search.way, point.tried)

    def ends(self) -> list[Row]:
        """The run at the end of each point's way, whose bag is kept."""
        return [
            point.end(self.boundary(point))
            for point in self.points
            if point.tried and not point.error
        ]

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
        report = work(Job(rows, directory), workers, journal, progress)
        if report.undone:
            return report  # the numbers of all later runs depend on it
    return Report()


def keep_ends(found: Survey, directory: Path, workers: Workers, journal: Journal) -> Report:
    """Have those at the boundaries done once more, and their bags kept, if the search asks for it.

    Raises:
        RunError: as `survey`, or a bag cannot be written.
    """
    return work(_to_keep(found, directory), workers, journal)


def is_over(found: Survey, directory: Path, journal: Journal) -> bool:
    """Whether there is nothing left to do."""
    return not found.advance(journal.done) and is_done(_to_keep(found, directory), journal)


def _to_keep(found: Survey, directory: Path) -> Job:
    rows = found.ends() if found.search.bags == "all" else []
    return Job(rows, directory, bags="all", verified=1.0, keeps_repeats=True)
