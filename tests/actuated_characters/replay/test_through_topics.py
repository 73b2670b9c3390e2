"""`replay --through-topics`: real nodes, and a bag in the place of one of them."""

import json
import os
import re
import shutil
import signal
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.context import Context
from rclpy.serialization import serialize_message
from trajectory_msgs.msg import JointTrajectory

from actuated_characters.bags.reader import RecordedMessage
from actuated_characters.bags.recording import find_bag, read_recording
from actuated_characters.cli import main
from actuated_characters.recorder.run_directory import SUMMARY, read_metrics
from actuated_characters.replay.command_comparison import CommandComparison, recorded_commands
from actuated_characters.replay.players.controller_parameters import (
    first_parameters,
    parameter_changes,
)
from actuated_characters.replay.players.simulator_outputs import REQUESTS, read_rare_messages
from actuated_characters.replay.through_topics import replay_commands, replay_states
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateDecoder
from msgs_config.messages.topics import CMD_VEL_STAMPED
from tests.support.physics import character
from tests.support.recorded_nodes import (
    EXAMPLE,
    TICKS,
    record_eventful,
    record_foreign,
    record_pair_in_process,
    record_realtime,
    recorded,
)
from tests.support.rewriting import rewrite, with_flipped_effort
from tests.support.ros import Processes, wait_until

pytestmark = pytest.mark.slow

_FAMILY = "ACTUATED_CHARACTERS_TEST"  # an environment variable that all of a replay's children have


@pytest.fixture(scope="module")
def folder(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    del domain  # the nodes inherit it
    return tmp_path_factory.mktemp("runs")


# Recordings


@pytest.fixture(scope="module")
def walk(folder: Path) -> Path:
    """A walk with assistance, by the command `run`."""
    options = ["--in-process", "--clip", "walk", "--duration", "0.5"]
    assert main(["run", *options, "--output", str(folder / "walk")]) == 0
    return folder / "walk"


@pytest.fixture(scope="module")
def eventful(folder: Path, context: Context) -> Path:
    return record_eventful(folder, context)


@pytest.fixture(scope="module")
def foreign(folder: Path) -> Path:
    return record_foreign(folder)


@pytest.fixture(scope="module")
def realtime(folder: Path, context: Context) -> Path:
    return record_realtime(folder, context)


@pytest.fixture(scope="module")
def pair(folder: Path) -> Path:
    return record_pair_in_process(folder)


def by_commands(path: Path, **options: Any) -> Any:
    return replay_commands(path, progress=lambda _: None, tell=print, **options)


def by_states(path: Path, **options: Any) -> CommandComparison:
    return replay_states(path, progress=lambda _: None, tell=print, **options)


# The bag in the controller's place


def test_a_walk_comes_again_when_the_bag_commands_a_simulator(
    walk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(walk), "--through-topics"]) == 0

    summary, _ = read_metrics(walk)
    output = capsys.readouterr().out
    assert "identical: 121 states of humanoid, 1 episode" in output
    assert f"state hash {summary['state_hash']};" in output


def test_delays_clipped_torques_pushes_pauses_and_a_reset_come_again(eventful: Path) -> None:
    recording = read_recording(eventful)
    limits = recording.character.effort_limits()
    reached = (recording.layout.norms(np.nan_to_num(recording.effort)) >= limits * (1 - 1e-9)).sum()
    pushed = [push for push in recording.applied_wrench if push is not None and push.links]
    assert reached > 10 and len(pushed) > 5 and len(recording.episode_rows) == 2

    told: list[int] = []

    result = replay_commands(eventful, progress=told.append, tell=print)

    summary, _ = read_metrics(eventful)
    assert result.difference is None
    assert result.remarks == []  # nothing was needed but the commands
    assert (result.states, result.episodes) == (TICKS + 1, 2)
    assert result.state_hashes == {"": summary["state_hash"]}
    assert told and told == sorted(told) and told[-1] <= TICKS + 1


@pytest.mark.nightly
def test_what_the_clock_decided_comes_again_from_the_efforts_applied(realtime: Path) -> None:
    recording = read_recording(realtime)
    assert np.abs(recording.effort).max() == 2.0  # its limit

    result = by_commands(realtime)

    assert result.difference is None and result.states == len(recording.stamps_ns)
    (note,) = result.remarks
    assert "efforts that were really applied" in note


def test_two_characters_of_one_world_come_again(pair: Path) -> None:
    result = by_commands(pair)

    assert result.difference is None and result.states == 41
    hashes = result.state_hashes
    assert set(hashes) == {"left", "right"} and hashes["left"] != hashes["right"]


def test_one_bit_of_one_command_is_found_with_its_tick_and_joint(
    walk: Path, tmp_path: Path
) -> None:
    row, dof = 40, "right_knee"
    stamp_ns = int(read_recording(walk).stamps_ns[row])
    changed = with_flipped_effort(
        walk / "bag",
        tmp_path / "bag",
        topic="joint_torques",
        stamp_ns=stamp_ns,
        name=dof,
        bit=0,
    )

    result = by_commands(changed)

    assert result.difference is not None
    assert (result.difference.tick, result.difference.name) == (row + 2, dof)
    assert result.difference.quantity == "effort"
    assert 0.0 < abs(result.difference.apart) < 1e-12


def renamed(pair: Path, target: Path, change: Callable[[RecordedMessage], bytes | None]) -> Path:
    """A copy of two characters' run, below a namespace, with messages as they are changed."""
    shutil.copytree(pair, target, ignore=shutil.ignore_patterns("bag"))
    rewrite(
        pair / "bag",
        target / "bag",
        change,
        lambda topic: f"/lab{topic}" if topic.startswith(("/left/", "/right/")) else topic,
    )
    return target


def test_a_state_more_of_one_character_is_no_difference_from_its_summary(
    pair: Path, tmp_path: Path
) -> None:
    last_ns, decoder = read_recording(pair, "left").stamps_ns[-1], JointStateDecoder()

    def change(message: RecordedMessage) -> bytes | None:
        is_state = message.topic == "/left/joint_states"
        is_last = is_state and decoder.decode(message.raw).stamp_ns == last_ns
        return None if is_last else message.raw

    run = renamed(pair, tmp_path / "run", change)
    (run / "left" / SUMMARY).unlink()  # of all its states

    assert main(["replay", str(run)]) == 0


def test_the_summaries_are_found_below_any_namespace(
    pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = renamed(pair, tmp_path / "run", lambda message: message.raw)
    assert main(["replay", str(run)]) == 0
    summary = json.loads((run / "right" / SUMMARY).read_text())
    (run / "right" / SUMMARY).write_text(json.dumps({**summary, "state_hash": "another"}))

    assert main(["replay", str(run)]) == 1

    assert "in summary.json it is another" in capsys.readouterr().err


# The bag in the simulator's place


def test_the_bags_own_controller_answers_as_it_did(
    walk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(walk), "--through-topics", "simulator"]) == 0

    # the last state may have been answered then, or not
    output = capsys.readouterr().out
    assert re.fullmatch(r"identical: the commands that answer 12[01] states of humanoid\n", output)


def test_changed_gains_laws_and_trajectories_come_again(eventful: Path) -> None:
    recording = read_recording(eventful)
    changes = parameter_changes(recording)
    assert sum(map(len, changes.values())) == 5
    rare = read_rare_messages(eventful, recording)
    # Only a steered reference and a behaviour that reacts listen to these.
    unheard = {CMD_VEL_STAMPED.name, topics.BEHAVIOUR.of(topics.CONTROLLER_NODE).name}
    assert rare.requested == {topic.name for topic in REQUESTS} - unheard
    assert sum(map(len, rare.requests.values())) == 4

    comparison = by_states(eventful)

    assert comparison.identical, str(comparison.first)
    assert comparison.states >= TICKS - 1


def test_a_gain_that_is_not_changed_as_it_was_is_found_at_its_first_tick(eventful: Path) -> None:
    recording = read_recording(eventful)
    first = first_parameters(recording)["gains.chest.p"]
    (row,) = [
        row
        for row, each in parameter_changes(recording).items()
        if any(change.get("gains.chest.p") == 700.0 for change in each)
    ]

    comparison = by_states(eventful, settings={"gains.chest.p": first})

    assert comparison.first is not None and comparison.largest is not None
    assert comparison.first.tick == row + 2  # of the next state; the first row is that of tick 1
    largest = {joint.name: joint.largest for joint in comparison.joints}
    assert largest["chest"] > 0.1
    assert not comparison.within(0.5 * comparison.largest_difference)
    assert comparison.within(comparison.largest_difference)


@pytest.mark.nightly
def test_each_character_of_a_world_can_be_answered(pair: Path) -> None:
    comparison = by_states(pair, character="right")

    assert comparison.identical and comparison.states >= 40


@pytest.mark.nightly
def test_states_that_the_controller_never_saw_are_left_out(realtime: Path) -> None:
    recording = read_recording(realtime)
    answered = sum(map(bool, recording.commands))

    comparison = by_states(realtime)

    assert comparison.identical, str(comparison.first)
    assert comparison.states == answered > 1  # a busy machine answers few


@pytest.mark.nightly
def test_a_controller_that_drives_less_is_told(walk: Path) -> None:
    comparison = by_states(walk, settings={"root_assistance": False})

    assert not comparison.identical and not comparison.within(1e9)
    assert comparison.lacking == tuple(
        f"root_{entry}" for entry in ("x", "y", "z", "rx", "ry", "rz")
    )


# A bag that begins in the middle of an episode


@pytest.fixture(scope="module")
def late(eventful: Path, folder: Path) -> Path:
    """The bag of a recorder that came later: the first whole episode is the second one."""
    decoder = JointStateDecoder()
    stamps = read_recording(eventful).stamps_ns

    def change(message: RecordedMessage) -> bytes | None:
        stamped = message.topic in ("/joint_states", "/joint_torques")
        is_early = stamped and decoder.decode(message.raw).stamp_ns < stamps[20]
        return None if is_early else message.raw

    return rewrite(eventful / "bag", folder / "late", change)


@pytest.mark.nightly
def test_the_second_episode_alone_comes_again(late: Path, eventful: Path) -> None:
    whole, recording = read_recording(eventful), read_recording(late)
    assert recording.stamps_ns[0] == whole.stamps_ns[whole.episode_rows[1]]

    result = by_commands(late)

    assert result.difference is None and result.remarks == []
    assert (result.states, result.episodes) == (len(recording.stamps_ns), 1)


@pytest.mark.nightly
def test_its_controller_begins_with_what_was_in_force_then(late: Path) -> None:
    recording = read_recording(late)
    assert first_parameters(recording)["law"] == "zero"
    assert first_parameters(recording)["gains.chest.p"] == 700.0

    comparison = by_states(late)

    assert comparison.identical, str(comparison.first)
    assert comparison.states >= len(recording.stamps_ns) - 1


# The command


def test_the_command_shows_what_another_gain_changes(
    walk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--through-topics", "simulator", "--set", "controller_node.gains.chest.p:=900"]

    assert main(["replay", str(walk), *options]) == 0

    output = capsys.readouterr().out
    assert "first difference: tick 1 " in output
    assert "largest difference: tick" in output and "right_shoulder" in output


WRONG_OPTIONS: dict[str, tuple[list[str], str]] = {
    "a setting of no use": (["--set", "controller_node.law:=pd"], "--through-topics simulator"),
    "no start of no use": (["--through-topics", "--no-start"], "--through-topics simulator"),
    "a setting of no node": (
        ["--through-topics", "simulator", "--set", "law:=pd"],
        "write it as controller_node.NAME:=VALUE",
    ),
    "another node's setting": (
        ["--through-topics", "simulator", "--set", "sim_node.rate:=3"],
        "unknown node 'sim_node'",
    ),
    "the recording's own": (
        ["--through-topics", "simulator", "--set", "controller_node.rate:=3"],
        "parameter 'rate' is set by the recording",
    ),
    "no such parameter": (
        ["--through-topics", "simulator", "--set", "controller_node.rte:=3"],
        "unknown parameter 'rte'",
    ),
    "no such character": (
        ["--through-topics", "simulator", "--character", "left"],
        "do not name 'left'",
    ),
}


@pytest.mark.parametrize("wrong", WRONG_OPTIONS)
def test_an_option_that_cannot_be_used_is_refused_in_a_line(
    walk: Path, wrong: str, capsys: pytest.CaptureFixture[str]
) -> None:
    options, expected = WRONG_OPTIONS[wrong]

    assert main(["replay", str(walk), *options]) == 1

    lines = [line for line in capsys.readouterr().err.splitlines() if line.strip()]
    (line,) = [line for line in lines if not line.startswith("waiting for ")]  # if it is slow
    assert line.startswith("error: ") and expected in line


@pytest.mark.parametrize("asked", [False, True])
def test_somebodys_own_controller_is_waited_for_and_compared(
    processes: Processes, foreign: Path, domain: int, tmp_path: Path, *, asked: bool
) -> None:
    """Requests of another controller in the bag are none to it: it need not hear them."""
    bag = with_a_request(foreign / "bag", tmp_path / "asked") if asked else foreign
    options = ["--through-topics", "simulator", "--no-start"]
    process = processes.command("replay", str(bag), *options)
    wait_until(lambda: "waiting for a controller" in process.stderr, "it says what it waits for")

    processes.python(str(EXAMPLE))

    assert process.wait() == 0
    assert f"ROS_DOMAIN_ID={domain}" in process.stdout
    assert "identical: the commands that answer" in process.stdout


@pytest.fixture(scope="module")
def balance(folder: Path) -> Path:
    """A run of a controller that has a memory, and listens to sensors."""
    sensors = [sensor.topic for sensor in character("humanoid").sensors]
    with recorded(folder / "balance", sensors=sensors) as together:
        simulator = together.simulator(
            "humanoid", rate=1000, max_ticks=1000, wait_for_subscribers=2
        )  # a busy recorder finds the commands of a foreign node only after hundreds of ticks
        controller = together.python(str(EXAMPLE.with_name("balance.py")))
        assert simulator.wait(120.0) == 0
        controller.end()
    return folder / "balance" / "run"


@pytest.mark.parametrize("unheard", [pytest.param(0, marks=pytest.mark.nightly), 40])
def test_a_controller_that_needs_sensors_is_played_their_readings(
    processes: Processes, balance: Path, tmp_path: Path, *, unheard: int
) -> None:
    """All of them, also those of the ticks whose commands the recorder came too late for."""
    bag = without_first_commands(find_bag(balance), tmp_path / "bag", unheard)
    options = ["--through-topics", "simulator", "--no-start"]
    process = processes.command("replay", str(bag), *options)
    processes.python(str(EXAMPLE.with_name("balance.py")))

    assert process.wait(120.0) == 0, process.stderr
    assert "identical: the commands that answer" in process.stdout


def without_first_commands(bag: Path, target: Path, ticks: int) -> Path:
    """A copy of a bag without the commands that answer its first states."""
    end_ns, decoder = int(read_recording(bag).stamps_ns[ticks]), JointStateDecoder()

    def change(message: RecordedMessage) -> bytes | None:
        is_early = (
            message.topic == "/joint_torques" and decoder.decode(message.raw).stamp_ns < end_ns
        )
        return None if is_early else message.raw

    return rewrite(bag, target, change)


TRAJECTORIES = topics.JOINT_TRAJECTORY.of(topics.CONTROLLER_NODE).name


def with_a_request(bag: Path, target: Path) -> Path:
    """A copy of a bag with a trajectory that somebody asked for, in place of the contacts."""
    requests = iter([serialize_message(JointTrajectory())])

    def change(message: RecordedMessage) -> bytes | None:
        return next(requests, None) if message.topic == "/contacts" else message.raw

    def rename(name: str) -> str:
        return f"/{TRAJECTORIES}" if name == "/contacts" else name

    rewrite(bag, target, change, rename)
    assert read_rare_messages(target, read_recording(target)).requested == {TRAJECTORIES}
    return target


def test_another_controller_is_found_at_its_first_answer(
    processes: Processes, foreign: Path
) -> None:
    options = ["--through-topics", "simulator", "--no-start"]
    process = processes.command("replay", str(foreign), *options)

    processes.python(str(EXAMPLE), "--ros-args", "-p", "target:=1.1")

    recording = read_recording(foreign)
    answered = ~np.isnan(recorded_commands(recording)).all(
        axis=1
    )  # the recorder may join a bit late
    time = recording.stamps_ns[np.argmax(answered)] / 1e9
    assert process.wait() == 1
    assert f"({time:.9f} s): command of 'hinge' is" in process.stderr
    assert "largest difference: tick" in process.stdout


def test_an_interrupt_ends_all_at_once(
    processes: Processes, foreign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mark = uuid.uuid4().hex
    monkeypatch.setenv(_FAMILY, mark)
    options = ["--through-topics", "simulator", "--no-start"]
    process = processes.command("replay", str(foreign), *options)
    wait_until(lambda: "waiting for a controller" in process.stderr, "it waits")
    assert len(living(mark)) == 2

    process.send(signal.SIGINT)

    assert process.wait(8.0) == 130
    assert living(mark) == {}


def test_a_simulator_that_dies_is_told(
    processes: Processes, walk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mark = uuid.uuid4().hex
    monkeypatch.setenv(_FAMILY, mark)
    process = processes.command("replay", str(walk), "--through-topics")

    def simulators() -> list[int]:
        return [pid for pid, line in living(mark).items() if "sim_node.main" in line]

    (simulator, *_) = wait_until(simulators, "its simulator")
    os.kill(simulator, signal.SIGKILL)

    assert process.wait() == 1
    assert "error: sim_node failed: killed by SIGKILL" in process.stderr
    assert living(mark) == {}


def living(mark: str) -> dict[int, str]:
    """Processes that were started with a mark in their environment, and what they run."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                if mark.encode() in (entry / "environ").read_bytes():
                    found[int(entry.name)] = (entry / "cmdline").read_text().replace("\0", " ")
            except OSError:  # it has ended, or is somebody else's
                continue
    return found
