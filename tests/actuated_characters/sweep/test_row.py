"""One row of a sweep: it is the run that `run --in-process` makes, and says what became of it."""

from pathlib import Path

import pytest

from actuated_characters.bags.recording import read_recordings
from actuated_characters.cli import main
from actuated_characters.commands.common.row_runs import asked_run
from actuated_characters.sweep.row import (
    FIGURES,
    Outcome,
    RowTask,
    compute,
    row_directory,
    with_one_thread,
)
from msgs_config.errors import RecordingError
from tests.support.runs import summary_of

SHORT = ("--duration=0.1",)
PENDULUM = ("--character=pendulum", *SHORT)
NOT_OF_THE_TABLE = {
    *("character", "state_hash"),  # columns of their own
    *("wall_time_s", "real_time_factor"),  # never the same twice
    *("rejected_pushes", "rejected_throws", "rejected_pins"),  # a run with any is an error
    *("lost_messages", "foreign_messages"),  # there are none in one process
}


def outcome_of(folder: Path, *arguments: str, bags: str = "none", number: int = 7) -> Outcome:
    scratch = folder / "scratch"
    scratch.mkdir(exist_ok=True)
    outcome = compute(RowTask(number, arguments, bags, folder), asked_run, scratch)
    assert list(scratch.iterdir()) == []
    return outcome


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        (*PENDULUM, "--push=rod:5,0,0@0.02", "--set=sim_node.gravity:=3.7"),
        ("--clip=walk", "--duration=0.2", "--set=sim_node.friction:=0.7"),
        (*SHORT, "--clip=walk", "--planner=predictive", "--set=controller_node.plan.samples:=8"),
        (*SHORT, "--throw=mass=1 speed=9 at=0.05 distance=0.3 target=chest"),
    ],
)
def test_a_row_has_the_figures_of_the_command_with_its_options(
    tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    assert main(["run", *arguments, "--in-process", "--output", str(tmp_path / "run")]) == 0
    summary = summary_of(tmp_path / "run")

    outcome = outcome_of(tmp_path, *arguments)

    assert outcome.error == ""
    assert outcome.state_hash == summary["state_hash"]
    assert dict(outcome.figures) == {name: summary[name] for name in FIGURES}
    assert set(summary) - set(FIGURES) == NOT_OF_THE_TABLE


def test_a_row_that_is_refused_is_a_line_and_keeps_no_bag(tmp_path: Path) -> None:
    outcome = outcome_of(tmp_path, *PENDULUM, "--push=arm:1,0,0@0", bags="all")

    assert outcome == Outcome({}, error=outcome.error, is_refused=True)
    assert outcome.error.startswith("push: unknown link 'arm'")
    assert not (tmp_path / "rows").exists()


def test_a_row_that_fails_in_its_run_says_so_alike_wherever_it_is(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    diverging = (*PENDULUM, "--push=rod:1e300,0,0@0.02")

    outcome = outcome_of(tmp_path, *diverging, bags="failures")

    assert outcome.has_failed
    assert "\n" not in outcome.error
    assert str(tmp_path) not in outcome.error
    assert outcome == outcome_of(tmp_path / "other", *diverging)
    assert (row_directory(tmp_path, 7) / "bag").is_dir()


def test_a_row_that_fails_after_the_fall_has_figures_as_well(tmp_path: Path) -> None:
    falling = ("--clip=walk", "--duration=3", "--set=controller_node.root_assistance:=false")
    last = outcome_of(tmp_path, *falling)

    outcome = outcome_of(tmp_path, *falling, "--push=chest:1e9,0,0@2.5")

    assert last.error == ""
    assert "diverged" in outcome.error
    for name in ("fell", "fell_at_s"):
        assert outcome.figures[name] == last.figures[name]
    assert outcome.figures["fell"] is True
    assert outcome.state_hash


@pytest.mark.parametrize(("bags", "is_kept"), [("none", False), ("failures", False), ("all", True)])
def test_the_bag_of_a_row_that_went_well_is_kept_if_all_are(
    tmp_path: Path, bags: str, is_kept: bool
) -> None:
    outcome = outcome_of(tmp_path, *PENDULUM, bags=bags)

    assert not outcome.has_failed
    assert row_directory(tmp_path, 7).is_dir() == is_kept
    if is_kept:
        times = read_recordings(row_directory(tmp_path, 7))[0].times
        assert len(times) - 1 == outcome.figures["ticks"]  # without the state before the first
        assert summary_of(row_directory(tmp_path, 7))["state_hash"] == outcome.state_hash


def test_a_row_that_is_done_again_replaces_its_bag(tmp_path: Path) -> None:
    first = outcome_of(tmp_path, *PENDULUM, bags="all")
    (row_directory(tmp_path, 7) / "of_the_first").touch()

    assert outcome_of(tmp_path, *PENDULUM, bags="all") == first

    assert [path.name for path in (tmp_path / "rows").iterdir()] == ["00007"]
    assert not (row_directory(tmp_path, 7) / "of_the_first").exists()


def test_results_that_a_worker_does_not_see_are_no_fault_of_the_row(tmp_path: Path) -> None:
    task = RowTask(1, PENDULUM, "all", tmp_path / "elsewhere")

    with pytest.raises(RecordingError, match="bags need a folder that all workers see"):
        compute(task, asked_run, tmp_path)


def test_the_planner_has_one_thread_unless_the_row_says_otherwise() -> None:
    own = (*PENDULUM, "--set=controller_node.plan.workers:=3")

    assert asked_run(PENDULUM).plan.controller["plan.workers"] == 0
    assert asked_run(with_one_thread(PENDULUM)).plan.controller["plan.workers"] == 1
    assert with_one_thread(own) == list(own)
