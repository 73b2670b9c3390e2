"""The window feedback that is shipped: the walk at 480 Hz, a tick late, pushed, over topics."""

from pathlib import Path

import pytest
from ros import Processes
from test_run import Run, summary_of

from controller_node.references.corrected_file import read_reconstruction
from experiment.cli import main
from experiment.samcon.gains_file import read_gains
from experiment.samcon.problem import Problem
from experiment.samcon.reconstruction import duration_of
from experiment.samcon.settings import preset
from experiment.samcon.trials import headings
from experiment.samcon.window_trials import WindowRun, WindowTrials

pytestmark = pytest.mark.slow

FAST = preset("humanoid", "walk", 480, samples=1, kept=1, lookahead=0)
LATE = {"rate": 480, "command_delay_ticks": 1}


def test_it_holds_walks_that_are_pushed_where_that_of_balance_alone_does_not() -> None:
    gains = read_gains("walk@480")
    cycles = 5
    settings = FAST.dividing(duration_of("humanoid", "walk", 1), gains.windows)
    problem = Problem.of(
        "humanoid", "walk", duration_of("humanoid", "walk", cycles), settings, LATE
    )
    trials = WindowTrials(problem, settings, cycles)
    runs = [WindowRun(heading, (1,), push=5.0) for heading in headings(2)]

    held = [one.windows for one in trials.tried((gains, run) for run in runs)]
    without = [one.windows for one in trials.tried((trials.nothing(), run) for run in runs)]

    assert held == [60, 60]
    assert max(without) < 60


def test_a_run_over_topics_with_it_is_that_in_one_process_pushed_or_not(
    tmp_path: Path, processes: Processes
) -> None:
    walk = tmp_path / "walk.json"
    given = ["--rate", "480", "--delay-ticks", "1", "--samples", "1", "--kept", "1"]
    assert main(["reconstruct", *given, "--workers", "1", "--output", str(walk)]) == 0
    found = read_reconstruction(walk)["figures"]

    def state_hash(name: str, *more: str) -> str:
        output = tmp_path / name
        Run(processes, "run", "--clip", str(walk), "--output", str(output), *more).finish()
        summary = summary_of(output)
        assert summary["fell"] is False
        return str(summary["state_hash"])

    push = ["--push", "root:0,50,0@0.5"]
    assert state_hash("topics") == found["state_hash"]
    assert state_hash("pushed", *push) == state_hash("alone", *push, "--in-process")
