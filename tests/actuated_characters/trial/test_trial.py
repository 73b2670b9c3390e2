"""Trials of controllers as a user makes them: over topics, in processes, and once more."""

import json
import math
import os
import re
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import actuated_characters as ac
from actuated_characters.cli import main
from actuated_characters.trial.results import read_done
from msgs_config.messages.state import StampedState
from tests.support.programs import PROJECT
from tests.support.ros import Processes, wait_until
from tests.support.runs import Run

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

TICKS = 120
SET = """
goal: {at_end: {hinge: [0.9, 1.1]}} # rad
run: {duration: 0.5}
trials:
  starts:
    set: {sim_node.initial_position: [[0.5], [1.5]]}
  pushes:
    run: {push: ["rod:20,0,0@0.1", "rod:90,0,0@0.4"]}
"""
ONE = "run: {duration: 0.1}\n"
PD = f"command: ['{{python}}', {PROJECT}/examples/pd_controller.py]\nrun: {{character: pendulum}}\n"
LONG = 120.0  # s that a trial may take on a busy machine

# Answers the first states as pd_controller.py does, the third one otherwise.
ODD = """
import os, sys
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState

class Odd(Node):
    def __init__(self):
        super().__init__("odd")
        self.torques, self.count = self.create_publisher(JointState, "joint_torques", 10), 0
        self.create_subscription(JointState, "joint_states", self.on_state, 10)

    def on_state(self, state):
        self.count += 1
        {third}
        torque = JointState(name=["hinge"], effort=[0.0])
        torque.header.stamp = state.header.stamp
        self.torques.publish(torque)

rclpy.init()
rclpy.spin(Odd())
"""


@pytest.fixture(scope="module")
def together(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Processes]:
    """Starts processes for several tests."""
    del domain
    started = Processes(tmp_path_factory.mktemp("trials"))
    yield started
    started.end()


def files(folder: Path, controller: str = PD, trials: str = SET) -> tuple[str, ...]:
    """The words of a trial of a controller."""
    (folder / "mine.yaml").write_text(controller, "utf-8")
    (folder / "hard.yaml").write_text(trials, "utf-8")
    paths = ("--trials", str(folder / "hard.yaml"), "--output", str(folder / "result"))
    return ("trial", str(folder / "mine.yaml"), *paths, "--workers", "2")


@pytest.fixture(scope="module")
def result(together: Processes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of the example in Python."""
    folder = tmp_path_factory.mktemp("trial")
    Run(together, *files(folder), "--films", "1").finish()
    return folder / "result"


def simulated(start: float, force: float = 0.0, pushed_at: int = TICKS) -> str:
    """The hash of what the example's law does, in a simulation without any process or topic.

    The rod is pushed along x by a force in N from a tick on.
    """
    begin = StampedState(0, np.array([start]), np.zeros(1), None)
    with ac.Simulation(ac.load_character("pendulum"), begin) as simulation:
        for tick in range(TICKS):
            if tick == pushed_at:
                simulation.push("rod", (force, 0.0, 0.0))
            (q,), (v,) = simulation.state.position, simulation.state.velocity
            weight = 1.0 * 9.81 * 0.5 * math.sin(q)
            simulation.step(np.array([50.0 * (1.0 - q) - 5.0 * v + weight]))
        return simulation.state_hash


def test_each_row_has_the_states_of_the_controller_s_law_to_the_last_bit(result: Path) -> None:
    done = read_done(result)

    assert sorted(done) == [1, 2, 3, 4]
    assert [done[row].outcome.state_hash for row in sorted(done)] == [
        simulated(0.5),
        simulated(1.5),
        simulated(0.5, 20.0, 24),  # 0.1 s at 240 Hz
        simulated(0.5, 90.0, 96),
    ]


def test_a_row_is_judged_by_where_the_pendulum_is(result: Path) -> None:
    done = read_done(result)

    assert [done[row].outcome.figures["survived"] for row in (1, 2, 3, 4)] == [True] * 3 + [False]
    assert re.fullmatch(
        r"'hinge' ended at .*, which should be 0.9 to 1.1\.", done[4].outcome.verdict
    )


def test_the_page_has_shares_intervals_and_a_film_of_the_failure(result: Path) -> None:
    page = (result / "index.html").read_text("utf-8")

    assert "mine survived 3 of 4 trials of &#x27;hard&#x27;" in page
    assert "<td>pushes</td><td>2</td><td>1</td><td>0</td><td>50%</td><td>9% to 91%</td>" in page
    assert 'src="films/00004.mp4"' in page
    assert (result / "films" / "00004.mp4").stat().st_size > 1000
    assert not re.search(r"(src|href)=\"(?!films/|data:)", page)  # nothing from elsewhere
    assert [path.name for path in (result / "rows").iterdir()] == ["00004"]
    header, *rows = (result / "table.csv").read_text("utf-8").splitlines()
    assert header.startswith("row,kind,sim_node.initial_position,push,survived,failed_at_s,")
    assert len(rows) == 4


@pytest.mark.nightly
def test_all_rows_are_the_same_once_more(together: Processes, result: Path) -> None:
    again = Run(together, "verify", str(result), "--workers", "2").finish()

    assert "4 of 4 rows were run again, 0 differ" in again.process.stdout
    wait_until(lambda: not again.family, "the end of all its processes")


def test_a_row_that_is_not_the_same_is_named_with_both_hosts(
    together: Processes, result: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(result, copy)
    journal = (copy / "rows.jsonl").read_text("utf-8")
    state_hash = read_done(result)[2].outcome.state_hash
    by = json.dumps(read_done(result)[2].by)
    journal = journal.replace(state_hash, "0" * 64).replace(by, '"elsewhere (process 7)"')
    (copy / "rows.jsonl").write_text(journal, "utf-8")

    run = Run(together, "verify", str(copy), "--row", "2")

    assert run.process.wait(LONG) == 1
    assert "1 of 4 rows were run again, 1 differ" in run.process.stdout
    line = f"row 2 differs: state_hash is '{'0' * 64}' by elsewhere (process 7), '{state_hash}' by "
    assert line in run.error


def trial_of(processes: Processes, folder: Path, controller: str) -> tuple[Run, str]:
    """A trial of one row that fails: the run, and the error in its journal."""
    run = Run(processes, *files(folder, controller, ONE), "--films", "0").finish()
    return run, read_done(folder / "result")[1].outcome.error


def odd(folder: Path, third: str) -> str:
    (folder / "odd.py").write_text(ODD.replace("{third}", third), "utf-8")
    return "set: {sim_node.lockstep_timeout: 2.0}\nrun: {character: pendulum}\n"


def test_a_controller_that_ends_early_is_a_row_with_its_last_words(
    together: Processes, tmp_path: Path
) -> None:
    third = "if self.count == 3: sys.exit('my law is undefined here')"
    command = "command: \"sh -c 'sleep 1000 & {python} odd.py'\"\n"

    run, error = trial_of(together, tmp_path, odd(tmp_path, third) + command)

    assert error == "controller failed: my law is undefined here"
    assert f"error: {error}" in run.process.stderr
    wait_until(lambda: not run.family, "the end of the other process that it has started")
    assert "1 │        0 │      1" in run.process.stdout
    assert (tmp_path / "result" / "rows" / "00001" / "logs" / "controller.log").is_file()


@pytest.mark.nightly
def test_a_controller_that_never_answers_is_one_as_well(
    together: Processes, tmp_path: Path
) -> None:
    text = "command: sleep 1000\nstart_timeout: 6\nrun: {character: pendulum}\n"

    run, error = trial_of(together, tmp_path, text)

    assert error.startswith("no answer within 6 s; sim_node says: ")
    wait_until(lambda: not run.family, "the end of all its processes")


@pytest.mark.nightly
def test_of_an_answer_that_is_none_it_is_told_what_the_simulator_said(
    together: Processes, tmp_path: Path
) -> None:
    third = (
        "if self.count >= 3: return self.torques.publish(JointState(name=['tail'], effort=[1.0]))"
    )
    text = odd(
        tmp_path, third.replace("publish(JointState(", "publish(JointState(header=state.header, ")
    )

    _, error = trial_of(together, tmp_path, text + "command: ['{python}', odd.py]\n")

    assert error.startswith("sim_node failed: ")
    assert "'tail'" in error


@pytest.mark.nightly
def test_a_killed_trial_leaves_nothing_behind_and_goes_on(
    together: Processes, result: Path, tmp_path: Path
) -> None:
    words = files(tmp_path)
    journal = tmp_path / "result" / "rows.jsonl"
    run = Run(together, *words)
    wait_until(
        lambda: journal.is_file() and len(journal.read_text().splitlines()) > 1, "a row", LONG
    )
    kept = journal.read_bytes()

    os.kill(run.process.pid, signal.SIGKILL)

    wait_until(lambda: not run.family, "the end of all its processes", LONG)
    Run(together, *words, "--films", "0").finish()
    assert journal.read_bytes().startswith(kept)
    hashes = [
        [each.outcome.state_hash for _, each in sorted(read_done(folder).items())]
        for folder in (result, tmp_path / "result")
    ]
    assert hashes[0] == hashes[1]


def test_ctrl_c_keeps_what_is_done_and_leaves_nothing_behind(
    together: Processes, tmp_path: Path
) -> None:
    journal = tmp_path / "result" / "rows.jsonl"
    run = Run(together, *files(tmp_path))
    wait_until(
        lambda: journal.is_file() and len(journal.read_text().splitlines()) > 1, "a row", LONG
    )

    run.process.send(signal.SIGINT)

    assert run.process.wait(LONG) == 130
    assert "the same command goes on" in run.process.stderr
    wait_until(lambda: not run.family, "the end of all its processes", LONG)
    assert not (tmp_path / "result" / ".workers").exists()


def test_another_goal_is_another_trial(
    result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = files(tmp_path, trials=SET.replace("[0.9, 1.1]", "[0.8, 1.1]"))
    shutil.copytree(result, tmp_path / "result")

    assert main([*words, "--films", "0"]) == 1

    assert "rows.jsonl is of another file, or a file that it names has changed" in (
        capsys.readouterr().err
    )
