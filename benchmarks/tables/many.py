"""Many runs on some processes, and what became of them as the rows of a table."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np

from actuated_characters.cluster import local_cluster, results_in_order
from benchmarks.tables.case import Case, Fact
from benchmarks.tables.seen import Seen, see

Measure: TypeAlias = Callable[[Seen], Mapping[str, Fact]]
Result: TypeAlias = tuple[Case, Mapping[str, Fact]]


@dataclass(frozen=True)
class Options:
    """What is asked of a table."""

    runs: int | None = None  # runs of each row; None: as many as the pages tell of
    first_seed: int = 1
    seconds: float | None = None  # length of each run, s; None: that of the pages
    machine: str = ""
    folder: Path = Path()  # takes the files of the runs

    def seeds(self, usual: int) -> range:
        """The seeds of a row."""
        return range(self.first_seed, self.first_seed + (self.runs or usual))


@dataclass(frozen=True)
class RunTable:
    """Cases by kind, and what is measured of each."""

    title: str
    kinds: Sequence[str]
    cases: Callable[[str, Options], Iterable[Case]]
    measure: Measure
    takes_files: bool = False  # whether files may be kinds
    asked_for: Sequence[str] = ()  # kinds that are made where they are named alone


def attempt(case: Case, measure: Measure) -> Mapping[str, Fact]:
    """What is measured of a case."""
    return {**case.facts, **measure(see(case))}


def results(
    cases: Sequence[Case], measure: Measure, processes: int, scratch: Path
) -> Iterator[Result]:
    """What becomes of cases, in their order, on some processes.

    Raises:
        ActuatedCharactersError: a name or a value of a case is wrong, or the processes died.
    """
    with local_cluster(processes, scratch) as client:
        found = results_in_order(client, partial(attempt, measure=measure), cases)
        yield from zip(cases, found, strict=True)


def rows(done: Sequence[Result]) -> Iterator[tuple[str, ...]]:
    """The heading of the table, and a line for each row of the cases."""
    columns = list(dict.fromkeys(name for _, facts in done for name in facts))
    yield ("", *columns)
    for row in dict.fromkeys(case.row for case, _ in done):
        found = [facts for case, facts in done if case.row == row]
        yield (row, *(cell([facts.get(name) for facts in found]) for name in columns))


def cell(values: Sequence[Fact]) -> str:
    """Values of several runs in a few words; None is left out."""
    known = [value for value in values if value is not None]
    if known and all(isinstance(value, bool) for value in known):
        return f"{sum(map(bool, known))} of {len(known)}"
    numbers = [value for value in known if isinstance(value, int | float)]
    if not numbers:
        return " ".join(str(value) for value in known)
    span = f" ({min(numbers):.3g} to {max(numbers):.3g})" if len(numbers) > 1 else ""
    return f"{np.median(numbers):.3g}{span}"
