"""The rounds of a search: the same runs whoever makes them, and bags of those at the boundary."""

import random
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from actuated_characters.boundary.file import read_search
from actuated_characters.boundary.picture import PICTURE, draw
from actuated_characters.boundary.survey import Survey, is_over, show_ends, survey
from actuated_characters.boundary.table import boundary_records
from actuated_characters.sweep.grid import Cell
from actuated_characters.sweep.journal import Done, Journal
from actuated_characters.sweep.row import Outcome, RowTask
from actuated_characters.sweep.work import Answer
from msgs_config.errors import RunError

FILE = """
run: {push: "impulse={impulse} from={side} at=1 target=chest"}
values: {side: [0, 90, 180]}
search: {value: impulse, from: 0, to: 40, within: 1, steps: 4, around: side}
"""
EDGES = {0: 7, 90: 33, 180: 99}  # N s, by side
OPTIONS = {"push": True}


class Here:
    """Workers for which a character falls by the side's edge, answering in any order."""

    def __init__(self, seed: int, most: int = 999) -> None:
        self.tasks: list[RowTask] = []
        self.asked: list[RowTask] = []
        self._random, self._most = random.Random(seed), most

    def size(self) -> int:
        return 5

    def submit(self, task: RowTask) -> None:
        self.tasks.append(task)

    def repeat(self, task: RowTask, address: str) -> None:
        raise AssertionError("nobody asked for it")

    def wait(self) -> Answer:
        if not self._most:
            raise RunError("the scheduler is gone")
        self._most -= 1
        task = self.tasks.pop(self._random.randrange(len(self.tasks)))
        self.asked.append(task)
        found = re.fullmatch(
            r"--push=impulse=(\d+) from=(\d+) at=1 target=chest", task.arguments[0]
        )
        assert found is not None
        impulse, side = map(int, found.groups())
        outcome = self.outcome(impulse, side)
        if task.until_fall:
            outcome = replace(outcome, state_hash="")
        return Answer(task, False, outcome, "a", "tcp://a")

    def outcome(self, impulse: int, side: int) -> Outcome:
        figures: Mapping[str, Cell] = {"fell": impulse >= EDGES[side]}
        return Outcome(figures, "", f"{impulse} {side}")


def started(folder: Path) -> Survey:
    file = folder / "search.yaml"
    file.write_text(FILE)
    return Survey(read_search(file, OPTIONS, ("fell",)))


def searched(folder: Path, workers: Here, name: str) -> tuple[Survey, Mapping[int, Done]]:
    found = started(folder)
    with Journal(folder / name, {}) as journal:
        report = survey(found, folder / name, workers, journal)
        assert report.undone == []
        assert show_ends(found, folder / name, workers, journal).undone == []
        assert found.differences(journal.done) == []
        return found, dict(journal.done)


def test_each_points_boundary_is_found(tmp_path: Path) -> None:
    found, done = searched(tmp_path, Here(1), "results")

    records = boundary_records(found, done)
    assert [(each["side"], each["holds"], each["fails"]) for each in records] == [
        (0, 6, 7),
        (90, 32, 33),
        (180, 40, None),
    ]
    assert [each["state_hash"] for each in records] == ["7 0", "33 90", "40 180"]
    assert len(done) == len(found.all_rows()) <= found.most_rows()


def test_runs_are_the_same_in_whatever_order_they_are_answered(tmp_path: Path) -> None:
    first, _ = searched(tmp_path, Here(1), "first")
    second, _ = searched(tmp_path, Here(2), "second")

    assert first.rows == second.rows


def test_the_runs_at_the_boundary_are_made_once_more_whole_with_their_bags(tmp_path: Path) -> None:
    workers = Here(3)
    found, done = searched(tmp_path, workers, "results")

    tried, whole = workers.asked[: len(found.rows)], workers.asked[len(found.rows) :]
    numbers = sorted(task.number for task in whole)
    assert numbers == [each["row"] for each in boundary_records(found, done)]
    assert {(task.bags, task.until_fall) for task in tried} == {("none", True)}
    assert {(task.bags, task.until_fall) for task in whole} == {("all", False)}


def test_what_is_another_run_when_it_is_made_whole_is_told(tmp_path: Path) -> None:
    class Twice(Here):
        def wait(self) -> Answer:
            answer = super().wait()
            if answer.task.until_fall or "from=90" not in answer.task.arguments[0]:
                return answer
            return replace(answer, outcome=Outcome({"fell": False}, "", "other"))

    found = started(tmp_path)
    with Journal(tmp_path / "out", {}) as journal:
        survey(found, tmp_path, Twice(1), journal)
        show_ends(found, tmp_path, Twice(1), journal)
        (line,) = found.differences(journal.done)

    assert re.fullmatch(r"fell of row \d+ is False, of row \d+, the same run, True", line)


def test_a_whole_run_may_diverge_once_it_has_fallen(tmp_path: Path) -> None:
    class Diverging(Here):
        def wait(self) -> Answer:
            answer = super().wait()
            if answer.task.until_fall:
                return answer
            return replace(answer, outcome=replace(answer.outcome, error="it diverged"))

    found = started(tmp_path)
    with Journal(tmp_path / "out", {}) as journal:
        survey(found, tmp_path, Diverging(1), journal)
        show_ends(found, tmp_path, Diverging(1), journal)
        (line,) = found.differences(journal.done)

    assert line.startswith("error of row ")  # that of the point at which all runs hold


def test_runs_that_fail_by_a_figure_are_whole(tmp_path: Path) -> None:
    class Measuring(Here):
        def outcome(self, impulse: int, side: int) -> Outcome:
            return Outcome({"root_error_max_m": impulse / 100}, "", f"{impulse} {side}")

    file = tmp_path / "search.yaml"
    file.write_text(FILE.replace("around: side}", "fails: {root_error_max_m: 0.2}}"))
    found, workers = Survey(read_search(file, OPTIONS, ("root_error_max_m",))), Measuring(1)
    with Journal(tmp_path / "out", {}) as journal:
        survey(found, tmp_path / "out", workers, journal)
        records = boundary_records(found, journal.done)

    assert [(each["holds"], each["fails"]) for each in records] == [(20, 21)] * 3
    assert not any(task.until_fall for task in workers.asked)


@pytest.mark.parametrize("most", [3, 14, 22])
def test_an_interrupted_search_goes_on_where_it_was(tmp_path: Path, most: int) -> None:
    whole, _ = searched(tmp_path, Here(1), "whole")
    with Journal(tmp_path / "cut", {}) as journal, pytest.raises(RunError):
        assert not is_over(started(tmp_path), tmp_path, journal)
        cut, workers = started(tmp_path), Here(4, most)
        survey(cut, tmp_path / "cut", workers, journal)
        show_ends(cut, tmp_path / "cut", workers, journal)
    workers = Here(5)

    again, _ = searched(tmp_path, workers, "cut")

    assert again.rows == whole.rows
    with Journal(tmp_path / "cut", {}) as journal:
        assert is_over(started(tmp_path), tmp_path, journal)
    assert len(workers.asked) == len(whole.rows) + len(whole.points) - most


def test_a_point_whose_run_cannot_be_is_told_and_the_others_are_found(tmp_path: Path) -> None:
    class Refusing(Here):
        def outcome(self, impulse: int, side: int) -> Outcome:
            refused = side == 90 and impulse == 20
            return (
                Outcome({}, error="no", is_refused=True)
                if refused
                else super().outcome(impulse, side)
            )

    found, done = searched(tmp_path, Refusing(6), "results")

    assert [bool(point.error) for point in found.points] == [False, True, False]
    assert re.fullmatch(r"row \d+: no", found.points[1].error)
    assert boundary_records(found, done)[0]["fails"] == 7


def test_a_run_without_the_figure_is_an_error_of_its_point(tmp_path: Path) -> None:
    class Fixed(Here):
        def outcome(self, impulse: int, side: int) -> Outcome:
            return Outcome({"fell": None}, "", "hash")

    found, _ = searched(tmp_path, Fixed(6), "results")

    assert found.points[0].error == "row 1: it has no figure 'fell'"
    assert len(found.rows) == len(found.points) * 5  # the even values alone


def test_bags_are_kept_if_asked_for_alone(tmp_path: Path) -> None:
    (tmp_path / "search.yaml").write_text(FILE + "bags: none\n")
    found = Survey(read_search(tmp_path / "search.yaml", OPTIONS, ("fell",)))
    workers = Here(1)
    with Journal(tmp_path / "out", {}) as journal:
        survey(found, tmp_path / "out", workers, journal)
        show_ends(found, tmp_path / "out", workers, journal)
        assert is_over(found, tmp_path / "out", journal)

    assert {task.bags for task in workers.asked} == {"none"}


def test_a_run_that_diverges_has_failed(tmp_path: Path) -> None:
    class Diverging(Here):
        def outcome(self, impulse: int, side: int) -> Outcome:
            outcome = super().outcome(impulse, side)
            return Outcome({}, error="it diverged") if outcome.figures["fell"] else outcome

    found, done = searched(tmp_path, Diverging(6), "results")

    assert [each["fails"] for each in boundary_records(found, done)] == [7, 33, None]


def test_a_row_that_nobody_could_do_ends_the_search_until_the_next_time(tmp_path: Path) -> None:
    class Dying(Here):
        def wait(self) -> Answer:
            answer = super().wait()
            if answer.task.number != 4:
                return answer
            return Answer(answer.task, False, None, failure="each worker that was at it died")

    with Journal(tmp_path / "results", {}) as journal:
        report = survey(started(tmp_path), tmp_path / "results", Dying(7), journal)
    assert report.undone == ["row 4 could not be done: each worker that was at it died"]

    assert (
        searched(tmp_path, Here(8), "results")[0].rows == searched(tmp_path, Here(1), "a")[0].rows
    )


def test_the_picture_is_drawn_of_what_varies_alone(tmp_path: Path) -> None:
    found, _ = searched(tmp_path, Here(1), "results")

    assert draw(found, tmp_path / PICTURE)
    assert (tmp_path / PICTURE).read_bytes().startswith(b"\x89PNG")
    found.points = found.points[:1]
    assert not draw(found, tmp_path / "other.png")
    assert not (tmp_path / "other.png").exists()
