"""The work of a sweep: rows to workers, outcomes to the journal, and a share of them once more."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Protocol

from actuated_characters.sweep.draws import is_chosen
from actuated_characters.sweep.grid import Row, cell_text
from actuated_characters.sweep.journal import Done, Journal, Verified
from actuated_characters.sweep.row import Ask, Outcome, RowTask
from msgs_config.errors import ActuatedCharactersError, ConfigurationError


@dataclass(frozen=True)
class Answer:
    """What a worker says of a row."""

    task: RowTask
    is_repeat: bool
    outcome: Outcome | None  # None: the row could not be done
    by: str = ""  # the worker: its host and process
    address: str = ""  # of the worker
    failure: str = ""  # why it could not be done


class Workers(Protocol):
    """Who computes rows."""

    def size(self) -> int:
        """How many rows should be with them at once, so that none of them waits."""
        ...

    def submit(self, task: RowTask) -> None:
        """Have a row computed."""
        ...

    def repeat(self, task: RowTask, address: str) -> None:
        """Have a row computed once more by another worker than that one, if there is another."""
        ...

    def wait(self) -> Answer:
        """The next answer, whichever row it is of.

        Raises:
            RunError: no more answers will come, or a worker cannot be used.
        """
        ...


@dataclass(frozen=True)
class Job:
    """Rows, and what is asked of them."""

    rows: Sequence[Row]
    directory: Path  # absolute
    bags: str = "none"  # which are kept: `none`, `failures` or `all`
    seed: int = 0  # of which rows are computed twice
    verified: float = 0.0  # share of the rows that are computed twice
    until_fall: bool = False  # whether each ends when its character fell

    def task(self, row: Row, *, is_repeat: bool = False) -> RowTask:
        """What a worker is told of a row."""
        arguments = tuple(map(_with_whole_path, row.arguments))
        bags = "none" if is_repeat else self.bags
        return RowTask(row.number, arguments, bags, self.directory, self.until_fall)

    def to_verify(self) -> frozenset[int]:
        """Numbers of the rows that are computed twice: at least one, if any share is asked for."""
        if self.verified <= 0.0:
            return frozenset()
        numbers = [row.number for row in self.rows]
        chosen = {n for n in numbers if is_chosen(self.seed, n, self.verified)}
        return frozenset(chosen or numbers[:1])


@dataclass
class Report:
    """What became of the work."""

    undone: list[str] = field(default_factory=list)  # a line for each row that could not be done


def check_rows(path: Path, ask: Ask, rows: Iterable[Row]) -> list[str]:
    """Plan rows, so that what is wrong with them is said before anything runs.

    Returns the sentences that the user should read, each once.

    Raises:
        ConfigurationError: a row cannot be; names the file, the row and what is wrong.
    """
    warnings: dict[str, None] = {}
    for row in rows:
        try:
            warnings |= dict.fromkeys(ask(row.arguments).warnings)
        except ActuatedCharactersError as error:
            raise ConfigurationError(f"{path}: {describe_row(row)}: {error}") from error
    return list(warnings)


def describe_row(row: Row) -> str:
    """A row in a few words, such as `row 3 (clip walk, sim_node.friction 0.8)`."""
    cells = ", ".join(f"{name} {cell_text(cell)}" for name, cell in row.cells.items())
    return f"row {row.number} ({cells})" if cells else f"row {row.number}"


def work(
    job: Job,
    workers: Workers,
    journal: Journal,
    progress: Callable[[], object] = lambda: None,
) -> Report:
    """Have all rows done that the journal has not; `progress` is called after each.

    Raises:
        RunError: no more answers will come, or the journal cannot be written.
    """
    report, to_verify = Report(), job.to_verify()
    by_number = {row.number: row for row in job.rows}
    tasks = _tasks(job, journal, to_verify)
    asked = 0
    is_over = False
    while True:
        room = 0 if is_over else workers.size() - asked
        for _ in range(room):
            given = next(tasks, None)
            if given is None:
                is_over = True
                break
            task, is_repeat = given
            workers.repeat(task, "") if is_repeat else workers.submit(task)
            asked += 1
        if not asked:
            return report
        answer = workers.wait()
        asked -= 1
        number = answer.task.number
        if answer.outcome is None:
            report.undone.append(f"row {number} could not be done: {answer.failure}")
        elif answer.is_repeat:
            journal.add_verified(
                compared(journal.done[number], Done(number, answer.outcome, answer.by))
            )
        else:
            journal.add(Done(number, answer.outcome, answer.by))
            if number in to_verify:
                workers.repeat(job.task(by_number[number], is_repeat=True), answer.address)
                asked += 1
        progress()


def is_done(job: Job, journal: Journal) -> bool:
    """Whether there is nothing left to do."""
    return next(_tasks(job, journal, job.to_verify()), None) is None


def _tasks(job: Job, journal: Journal, to_verify: frozenset[int]) -> Iterator[tuple[RowTask, bool]]:
    """What is left to do, each with whether it is done already and to be done once more."""
    for row in job.rows:
        if row.number not in journal.done:
            yield job.task(row), False
        elif row.number in to_verify - journal.verified.keys():
            yield job.task(row, is_repeat=True), True


def compared(done: Done, again: Done) -> Verified:
    """Whether a row's second outcome is its first one; names the first thing that is not."""
    first, second = _flat(done.outcome), _flat(again.outcome)
    names = [name for name in first | second if first.get(name) != second.get(name)]
    if not names:
        return Verified(done.number, "", again.by)
    # the hash says it best: figures are rounded, and an error may come with none at all
    name = "state_hash" if "state_hash" in names else names[0]
    difference = f"{name} is {first.get(name)!r} by {done.by}, {second.get(name)!r} by {again.by}"
    return Verified(done.number, difference, again.by)


def _flat(outcome: Outcome) -> dict[str, str]:
    fields = asdict(outcome)
    figures = fields.pop("figures")
    return {name: cell_text(cell) for name, cell in (fields | figures).items()}


def _with_whole_path(argument: str) -> str:
    """An argument whose file, if it names one, is found wherever it is read."""
    option, _, text = argument.partition("=")
    if option == "--set" or not Path(text).suffix:
        return argument
    try:
        return f"{option}={Path(text).absolute()}" if Path(text).is_file() else argument
    except (OSError, ValueError):  # a text that is no path
        return argument
