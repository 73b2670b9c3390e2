"""`fork`: real runs are repeated up to a tick, to the last bit, and go on as they are told."""

import json
import signal
from pathlib import Path

import numpy as np
import pytest
from rclpy.context import Context

from actuated_characters.bags.recording import Recording, read_recording, read_recordings
from actuated_characters.cli import main
from actuated_characters.replay.replay import replay
from actuated_characters.report.contents import read_contents
from msgs_config.messages import topics
from tests.support.recorded_nodes import (
    record_eventful,
    record_foreign,
    record_pair_in_process,
    record_realtime,
    weakened,
)
from tests.support.rewriting import with_flipped_effort
from tests.support.ros import Processes
from tests.support.runs import Run, summary_of
from tests.support.same_messages import assert_same_messages

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

RATE = 240  # Hz
PUSHES = ("--push", "chest:300,0,0@0.5", "--push", "right_knee:100,50,0@0.55")
THROW = ("--throw", "mass=3 speed=8 at=1 from=left target=chest")
QUICK_PLAN = ("--set", "controller_node.plan.samples:=8", "--set", "controller_node.plan.rounds:=1")
REACTIVE = ("--clip", "walk", "--behaviour", "reactive", "--duration", "2", *PUSHES, *THROW)


@pytest.fixture(scope="module")
def folder(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    del domain  # the nodes inherit it
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def reactive(folder: Path) -> Path:
    """A reactive walk that two pushes and a ball hit."""
    assert main(["run", "--in-process", *REACTIVE, "--output", str(folder / "reactive")]) == 0
    return folder / "reactive"


@pytest.fixture(scope="module")
def swings(folder: Path) -> Path:
    """A pendulum of a file that is there no more."""
    own = weakened(folder, "pendulum", "hinge", 2.0)
    given = ("--character", own, "--set", "sim_node.initial_position:=[0.5]", "--duration", "0.3")
    assert main(["run", "--in-process", *given, "--output", str(folder / "swings")]) == 0
    Path(own).unlink()
    return folder / "swings"


@pytest.fixture(scope="module")
def eventful(folder: Path, context: Context) -> Path:
    return record_eventful(folder, context)


def fork(run: Path, at: float, *options: str, name: str = "forked") -> Path:
    """A fork of a run by the command line."""
    directory = run.parent / name
    arguments = [str(run), "--at", f"{at!r}", *options]
    assert main(["fork", *arguments, "--output", str(directory), "--overwrite"]) == 0
    return directory


def hash_of(run: Path) -> str:
    return str(summary_of(run)["state_hash"])


def topics_of(run: Path) -> set[str]:
    return {topic.name for topic in read_contents(run).topics if topic.count}


def first_different(one: Recording, other: Recording) -> int | None:
    """The first row in which states differ by a bit, of those that both have."""
    rows = min(len(one.position), len(other.position))
    for row in range(rows):
        for a, b in ((one.position, other.position), (one.velocity, other.velocity)):
            if a[row].tobytes() != b[row].tobytes():
                return row
    return None


@pytest.mark.parametrize("count", [1, pytest.param(9, marks=pytest.mark.nightly)])
def test_forks_without_a_change_are_the_original(reactive: Path, count: int) -> None:
    rows = np.random.default_rng(count).integers(0, 2 * RATE, count).tolist()

    hashes = {hash_of(fork(reactive, row / RATE)) for row in rows}

    assert hashes == {hash_of(reactive)}


def test_a_pushed_fork_is_the_original_up_to_the_push_and_replays(reactive: Path) -> None:
    directory = fork(reactive, 0.8, "--push", "chest:-250,0,0@0.8", "--duration", "2.5")

    original, forked = read_recording(reactive), read_recording(directory)
    assert first_different(original, forked) == round(0.8 * RATE) + 1
    assert len(forked.effort) == round(2.5 * RATE)
    result = replay([forked])
    assert result.identical and result.state_hashes[""] == hash_of(directory)


def test_a_fork_through_topics_sends_the_same_messages(reactive: Path) -> None:
    new = ("--push", "chest:-250,0,0@0.8", "--set", "controller_node.gain_scale.p:=0.8")
    new = (*new, "--duration", "1.2")
    here, there = (
        fork(reactive, 0.8, *new, *options, name=f"forked{len(options)}")
        for options in ((), ("--through-topics",))
    )

    assert_same_messages(here / "bag", there / "bag")


def test_a_fork_says_where_it_comes_from(swings: Path, capsys: pytest.CaptureFixture[str]) -> None:
    directory = fork(swings, 0.1)
    origin = {"path": str(swings), "state_hash": hash_of(swings), "tick": 25, "time": 0.1}

    capsys.readouterr()
    assert main(["info", "--json", str(directory)]) == 0
    assert json.loads(capsys.readouterr().out)["forked_from"] == origin
    assert summary_of(directory)["forked_from"] == origin
    assert main(["info", str(directory)]) == 0
    assert "forked from" in capsys.readouterr().out


NIGHTLY = [pytest.param(at, marks=pytest.mark.nightly) for at in (1, 36, 69, 71)]


@pytest.mark.parametrize("at", [0, 11, 70, 101, *NIGHTLY])
def test_pushes_resets_pauses_and_what_a_controller_is_asked_come_again(
    eventful: Path, at: int
) -> None:
    directory = fork(eventful, at / 480)

    assert hash_of(directory) == hash_of(eventful)


@pytest.mark.parametrize(
    "options",
    [
        pytest.param(("--behaviour", "ragdoll"), marks=pytest.mark.nightly),
        ("--behaviour", "active_ragdoll", "--composed", "--sensor", "all"),
        pytest.param(
            ("--in-process", "--planner", "predictive", *QUICK_PLAN), marks=pytest.mark.nightly
        ),
        pytest.param(
            ("--set", "sim_node.real_time_factor:=4", "--compression", "zstd"),
            marks=pytest.mark.nightly,
        ),
        ("--in-process", "--exclude", "contacts", "--exclude", "odom", "--log-time", "simulated"),
    ],
    ids=" ".join,
)
def test_other_runs_come_again_and_go_on(folder: Path, options: tuple[str, ...]) -> None:
    original = folder / "original"
    limits = ("--clip", "walk", "--duration", "0.4", "--push", "chest:400,100,0@0.1")
    assert main(["run", *limits, *options, "--output", str(original), "--overwrite"]) == 0

    same = fork(original, 0.2)
    assert hash_of(same) == hash_of(original)
    assert topics_of(original) <= topics_of(same)  # sensors among them
    changed = fork(original, 0.2, "--push", "chest:0,200,0@0.2")

    assert first_different(read_recording(original), read_recording(changed)) == 49
    assert replay(read_recordings(changed)).identical


def test_a_parameter_counts_from_the_tick_on_and_a_fork_forks(reactive: Path) -> None:
    softer = ("--set", "controller_node.gain_scale.p:=2")
    late = ("--push", "chest:100,0,0@0.7", "--set", "sim_node.wrench_duration:=0.2")
    directory = fork(reactive, 0.6, *softer, *late, "--no-later-inputs")

    original, forked = read_recording(reactive), read_recording(directory)
    at = round(0.6 * RATE)
    assert first_different(original, forked) == at + 1
    (changed,) = forked.controller[1:]
    assert changed.after_stamp_ns == original.stamps_ns[at - 1]
    pushed = [bool(each and each.links) for each in forked.applied_wrench]
    begun = np.flatnonzero(np.diff(np.array([False, *pushed], dtype=int)) == 1)
    assert (begun / RATE).tolist() == [0.5, 0.7] and sum(pushed[begun[1] :]) == 48
    assert not any(forked.throws)
    again = fork(directory, 0.9, name="again")
    assert hash_of(again) == hash_of(directory)


@pytest.mark.nightly
def test_more_states_than_a_queue_holds_are_compared(folder: Path) -> None:
    original = folder / "long"
    given = ("--set", "sim_node.initial_position:=[0.5]", "--in-process")
    seconds = 1.1 * topics.JOINT_STATES.quality.depth / RATE
    options = ["--character", "pendulum", "--duration", f"{seconds:g}", *given]
    assert main(["run", *options, "--output", str(original)]) == 0

    assert hash_of(fork(original, seconds - 0.1, "--from-start")) == hash_of(original)


def test_files_that_are_gone_are_written_again_from_the_recording(swings: Path) -> None:
    assert hash_of(fork(swings, 0.1)) == hash_of(swings)


def test_a_state_that_is_another_ends_it_with_one_line(
    reactive: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    stamp_ns = int(read_recording(reactive).stamps_ns[100])
    of_arm = {"stamp_ns": stamp_ns, "name": "left_elbow", "bit": 40}
    bag = with_flipped_effort(reactive / "bag", tmp_path / "bag", topic="joint_states", **of_arm)

    assert main(["fork", str(bag), "--at", "1", "--output", str(tmp_path / "fork")]) == 1

    *_, line = capfd.readouterr().err.splitlines()
    assert line.startswith("error: fork: tick 101 (0.420833333 s): effort of 'left_elbow'")


def test_a_ball_that_would_fly_before_the_fork_is_refused(
    reactive: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    throw = "mass=1 speed=4 at=1.1 target=chest"

    assert main(["fork", str(reactive), "--at", "1", "--throw", throw]) == 1

    assert "s, before the fork at 1 s; let it begin later" in capfd.readouterr().err


def test_runs_that_cannot_be_repeated_are_refused(
    folder: Path, context: Context, capfd: pytest.CaptureFixture[str]
) -> None:
    reasons = {
        record_foreign(folder): "one that is not controller_node cannot be repeated",
        record_realtime(folder, context): "it ran in real time",
        record_pair_in_process(folder): "it has 2 characters, and a fork repeats a run of one",
    }
    for run, reason in reasons.items():
        assert main(["fork", str(run), "--at", "0.05"]) == 1
        (line,) = capfd.readouterr().err.splitlines()
        assert reason in line


def test_an_interrupt_leaves_a_whole_bag(processes: Processes, reactive: Path) -> None:
    output = str(reactive.parent / "interrupted")
    run = Run(
        processes, "fork", str(reactive), "--at", "1", "--duration", "1e6", "--output", output
    )
    run.wait_for_ticks(Path(output))

    run.process.send(signal.SIGINT)

    assert run.process.wait(20.0) == 130
    assert run.family == {}
    assert replay(read_recordings(Path(output))).identical
