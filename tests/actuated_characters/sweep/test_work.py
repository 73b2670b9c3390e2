"""The work of a sweep: what is asked of workers, what is kept, and what is computed twice."""

from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from actuated_characters.runs.planned.inputs import NO_INPUTS
from actuated_characters.sweep.grid import Row
from actuated_characters.sweep.journal import Journal
from actuated_characters.sweep.row import AskedRun, Outcome, RowTask
from actuated_characters.sweep.work import Answer, Job, check_rows, work
from msgs_config.errors import ConfigurationError, RunError

OUTCOMES = {number: Outcome({"ticks": number}, "It ran.", f"hash {number}") for number in range(9)}


def job(folder: Path, rows: int = 6, verified: float = 0.0) -> Job:
    made = [Row(n, (f"--x={n}",), {}) for n in range(1, rows + 1)]
    return Job(made, folder, "all", verified=verified)


class Here:
    """Workers `a` and `b` that answer in the reverse order, as `outcome` says."""

    def __init__(
        self, outcome: Callable[[RowTask, bool], Outcome | None] | None = None, most: int = 99
    ) -> None:
        self.outcome = outcome or (lambda task, is_repeat: OUTCOMES[task.number])
        self.asked: list[tuple[RowTask, str | None]] = []
        self._waiting: deque[tuple[RowTask, bool]] = deque()
        self._most = most

    def size(self) -> int:
        return 3

    def submit(self, task: RowTask) -> None:
        self.asked.append((task, None))
        self._waiting.append((task, False))

    def repeat(self, task: RowTask, address: str) -> None:
        self.asked.append((task, address))
        self._waiting.append((task, True))

    def wait(self) -> Answer:
        if not self._most:
            raise RunError("the scheduler is gone")
        self._most -= 1
        assert len(self._waiting) <= 3 + 1
        task, is_repeat = self._waiting.pop()
        name = "b" if is_repeat else "a"
        outcome = self.outcome(task, is_repeat)
        return Answer(task, is_repeat, outcome, name, f"tcp://{name}", "" if outcome else "it died")


def numbers(asked: Sequence[tuple[RowTask, str | None]]) -> list[int]:
    return sorted(task.number for task, _ in asked)


def test_all_rows_are_done_once(tmp_path: Path) -> None:
    workers, words = Here(), []
    with Journal(tmp_path, {}) as journal:
        report = work(job(tmp_path), workers, journal, lambda: words.append(len(journal.done)))

    assert report.undone == []
    assert {number: done.outcome for number, done in journal.done.items()} == {
        number: OUTCOMES[number] for number in range(1, 7)
    }
    assert numbers(workers.asked) == words == [1, 2, 3, 4, 5, 6]


def test_what_was_interrupted_goes_on_where_it_was(tmp_path: Path) -> None:
    with Journal(tmp_path, {}) as journal, pytest.raises(RunError):
        work(job(tmp_path), Here(most=4), journal)
    before = set(journal.done)
    workers = Here()

    with Journal(tmp_path, {}) as journal:
        work(job(tmp_path), workers, journal)

    assert len(before) == 4
    assert set(numbers(workers.asked)) == set(range(1, 7)) - before
    assert sorted(journal.done) == [1, 2, 3, 4, 5, 6]


def test_a_row_that_could_not_be_done_is_told_and_done_the_next_time(tmp_path: Path) -> None:
    def but_two(task: RowTask, is_repeat: bool) -> Outcome | None:
        return None if task.number == 2 else OUTCOMES[task.number]

    with Journal(tmp_path, {}) as journal:
        report = work(job(tmp_path), Here(but_two), journal)
        assert report.undone == ["row 2 could not be done: it died"]
        assert sorted(journal.done) == [1, 3, 4, 5, 6]
        workers = Here()
        work(job(tmp_path), workers, journal)

    assert numbers(workers.asked) == [2]


def test_verified_rows_are_computed_by_another_worker_without_their_bags(tmp_path: Path) -> None:
    workers = Here()
    with Journal(tmp_path, {}) as journal:
        work(job(tmp_path, verified=1.0), workers, journal)

    repeats = [(task, address) for task, address in workers.asked if address is not None]
    assert numbers(repeats) == [1, 2, 3, 4, 5, 6]
    assert {address for _, address in repeats} == {"tcp://a"}
    assert {task.bags for task, _ in repeats} == {"none"}
    assert {each.difference for each in journal.verified.values()} == {""}


def test_a_difference_names_the_row_both_workers_and_both_hashes(tmp_path: Path) -> None:
    def other(task: RowTask, is_repeat: bool) -> Outcome:
        if is_repeat and task.number == 4:
            return Outcome({"ticks": 5}, "It ran.", "hash 5")
        return OUTCOMES[task.number]

    with Journal(tmp_path, {}) as journal:
        work(job(tmp_path, verified=1.0), Here(other), journal)

    different = {n: each.difference for n, each in journal.verified.items() if each.difference}
    assert different == {4: "state_hash is 'hash 4' by a, 'hash 5' by b"}


def test_a_figure_that_differs_is_a_difference_also_in_its_sign_alone(tmp_path: Path) -> None:
    def zero(task: RowTask, is_repeat: bool) -> Outcome:
        return Outcome({"error_m": -0.0 if is_repeat else 0.0}, "It ran.", "hash")

    with Journal(tmp_path, {}) as journal:
        work(job(tmp_path, rows=1, verified=1.0), Here(zero), journal)

    assert journal.verified[1].difference == "error_m is '0.0' by a, '-0.0' by b"


def test_rows_that_are_done_can_be_verified_later(tmp_path: Path) -> None:
    with Journal(tmp_path, {}) as journal:
        work(job(tmp_path), Here(), journal)
        workers = Here()
        work(job(tmp_path, verified=1.0), workers, journal)

    assert {address for _, address in workers.asked} == {""}
    assert sorted(journal.verified) == [1, 2, 3, 4, 5, 6]


def test_a_share_is_at_least_one_row(tmp_path: Path) -> None:
    assert job(tmp_path, verified=1e-9).to_verify() == {1}
    assert job(tmp_path, verified=0.0).to_verify() == frozenset()
    assert 300 < len(job(tmp_path, rows=1000, verified=0.4).to_verify()) < 500


def test_files_are_given_with_their_whole_paths(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.json").write_text("")
    (tmp_path / "walk").write_text("a file that happens to be there")
    row = Row(1, ("--clip=a.json", "--timeline=b.yaml", "--keyframes=walk"), {})

    task = Job([row], tmp_path).task(row)

    assert task.arguments == (f"--clip={tmp_path}/a.json", "--timeline=b.yaml", "--keyframes=walk")


def test_a_row_that_cannot_be_planned_is_named(tmp_path: Path) -> None:
    def refuse(arguments: Sequence[str]) -> None:
        raise ConfigurationError("unknown clip 'wlak'")

    row = Row(3, (), {"clip": "wlak", "sim_node.friction": 0.8})
    with pytest.raises(ConfigurationError) as raised:
        check_rows(tmp_path / "a.yaml", refuse, [row])  # type: ignore[arg-type]

    wanted = "a.yaml: row 3 (clip wlak, sim_node.friction 0.8): unknown clip 'wlak'"
    assert str(raised.value) == f"{tmp_path}/{wanted}"


def test_what_the_user_should_read_of_rows_is_said_once(tmp_path: Path) -> None:
    plan: Any = None

    def warn(arguments: Sequence[str]) -> AskedRun:
        return AskedRun(plan, NO_INPUTS, {}, ["of all", *arguments])

    rows = [Row(1, ("of one",), {}), Row(2, ("of the other",), {})]

    assert check_rows(tmp_path, warn, rows) == ["of all", "of one", "of the other"]
