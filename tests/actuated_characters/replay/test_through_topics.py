"""`replay --through-topics`: real nodes, and a bag in the place of one of them."""

import json
import os
import re
import shutil
import signal
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rclpy.context import Context
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from actuated_characters.bags.reader import RecordedMessage, read_messages
from actuated_characters.bags.recording import (
    CommandArrays,
    ControllerSettings,
    Recording,
    read_recording,
)
from actuated_characters.bags.writer import BagWriter
from actuated_characters.cli import main
from actuated_characters.replay.command_comparison import (
    CommandComparison,
    compare_commands,
    merge_commands,
    recorded_commands,
)
from actuated_characters.replay.comparison import EFFORT, POSITION, VELOCITY, compare_world
from actuated_characters.replay.players.character_files import write_character
from actuated_characters.replay.players.controller_parameters import (
    first_parameters,
    parameter_changes,
)
from actuated_characters.replay.players.processes import PlayerReport
from actuated_characters.replay.players.simulator_inputs import make_inputs
from actuated_characters.replay.players.simulator_outputs import REQUESTS, read_rare_messages
from actuated_characters.replay.through_topics import replay_commands, replay_states
from actuated_characters.runs.run_directory import SUMMARY, read_figures
from msgs_config.arrays import FloatArray
from msgs_config.character.file import CHARACTERS_DIRECTORY, shipped_characters
from msgs_config.character.loading import load_character
from msgs_config.errors import RecordingError, RunError
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateDecoder, JointStateEncoder
from tests.support.physics import DATA, character
from tests.support.ros import Client, Processes, SimulatorClient, wait_until, wrench_message

pytestmark = pytest.mark.slow

RATE = 480  # Hz: delayed, the humanoid needs a fast one
TICKS = 160
DELAY = 2
CHEST_LIMIT = 3.0  # N m, of a ball joint: far less than the law asks for
EXAMPLE = Path(__file__).parents[3] / "examples" / "pd_controller.py"
_FAMILY = "ACTUATED_CHARACTERS_TEST"  # an environment variable that all of a replay's children have


@pytest.fixture(scope="module")
def folder(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    del domain  # the nodes inherit it
    return tmp_path_factory.mktemp("runs")


@contextmanager
def recorded(directory: Path, **parameters: object) -> Iterator[Processes]:
    """Starts processes that are recorded into a directory until the end of the context."""
    directory.mkdir()
    processes = Processes(directory)
    try:
        recorder = processes.node(
            topics.RECORDER_NODE, directory=str(directory / "run"), **parameters
        )
        yield processes
        recorder.send(signal.SIGINT)
        assert recorder.wait() == 0, recorder.stderr
    finally:
        processes.end()


# Recordings


@pytest.fixture(scope="module")
def walk(folder: Path) -> Path:
    """A walk with assistance, by the command `run`."""
    options = ["--clip", "walk", "--duration", "0.5", "--output", str(folder / "walk")]
    assert main(["run", *options]) == 0
    return folder / "walk"


@pytest.fixture(scope="module")
def eventful(folder: Path, context: Context) -> Path:
    """Late and clipped commands, pushes, changed gains, pauses, a reset, trajectories."""
    content = yaml.safe_load((CHARACTERS_DIRECTORY / "humanoid.yaml").read_text())
    content["joints"]["chest"]["effort_limit"] = CHEST_LIMIT
    own = folder / "weak.yaml"
    own.write_text(yaml.safe_dump(content))
    client = SimulatorClient(context)
    trajectories = client.speak(topics.JOINT_TRAJECTORY.of(topics.CONTROLLER_NODE))
    strengths = client.speak(topics.STRENGTH.of(topics.CONTROLLER_NODE))
    node, simulator_node = topics.CONTROLLER_NODE, topics.SIM_NODE

    def push(link: str, *point: float) -> None:
        wrench = (80.0, -30.0, 10.0, 1.0, 2.0, 3.0)
        client.wrenches.publish(wrench_message(0, [(link, wrench)], [point] if point else []))
        assert client.wrenches.wait_for_all_acked()

    def change(**values: object) -> None:
        for name, value in values.items():
            assert client.set_parameter(node, name.replace("__", "."), value) == (True, "")

    def step(count: int) -> None:
        assert client.set_parameter(simulator_node, "step_count", count) == (True, "")
        steps = client.step()
        client.spin_until(steps.done, f"{count} steps")
        assert steps.result().success, steps.result().message

    with recorded(folder / "eventful") as processes:
        simulator = processes.simulator(
            str(own),
            commanded_joints=["root", *character("humanoid").layout.actuated_joint_names],
            rate=RATE,
            command_delay_ticks=DELAY,
            speed_limit=1e5,
            wrench_duration=0.02,
            max_ticks=TICKS,
            wait_for_subscribers=4,
        )
        processes.controller(str(own), rate=RATE, reference="clip", wait_for_subscribers=2)
        client.spin_until(
            lambda: trajectories.get_subscription_count() == 2, "who hears trajectories"
        )
        client.spin_until(lambda: strengths.get_subscription_count() == 2, "who hears strengths")
        assert client.pause(True).success
        client.listen(topics.JOINT_STATES)  # is the fourth, without whom nothing begins
        client.spin_until(lambda: client.states.messages, "the first state")
        step(10)
        push("chest", 0.01, 0.02, -0.03)
        push("right_knee")
        change(gains__chest__p=700.0)
        strengths.publish(a_strength("left_knee", 0.3))
        step(25)
        change(law="zero", gain_scale__p=0.8)
        trajectories.publish(a_step("left_elbow", 0.5))
        step(30)
        push("left_wrist")
        step(4)
        assert client.reset().success
        step(30)
        push("chest")
        trajectories.publish(a_step("right_elbow", 0.7))
        strengths.publish(a_strength("chest", 0.5))
        change(law="stable_pd", gains__chest__p=900.0)
        assert client.pause(False).success
        assert simulator.wait() == 0
    client.close()
    return folder / "eventful" / "run"


def a_step(dof: str, position: float) -> JointTrajectory:
    """To a position within a tenth of a second, from the next answered state on."""
    point = JointTrajectoryPoint(positions=[position])
    point.time_from_start.nanosec = 10**8
    return JointTrajectory(joint_names=[dof], points=[point])


def a_strength(joint: str, share: float) -> JointState:
    """Of a joint, from the next answered state on."""
    return JointState(name=[joint], effort=[share])


@pytest.fixture(scope="module")
def foreign(folder: Path) -> Path:
    """The pendulum under somebody's own controller."""
    with recorded(folder / "foreign") as processes:
        simulator = processes.simulator(max_ticks=60, wait_for_subscribers=2)
        all_heard = ("--ros-args", "-p", "wait_for_subscribers:=2")
        processes.python(str(EXAMPLE), *all_heard)
        assert simulator.wait() == 0
    return folder / "foreign" / "run"


@pytest.fixture(scope="module")
def realtime(folder: Path, context: Context) -> Path:
    """The pendulum by the wall clock, its commands clipped."""
    content = yaml.safe_load((CHARACTERS_DIRECTORY / "pendulum.yaml").read_text())
    content["urdf"] = str(CHARACTERS_DIRECTORY / content["urdf"])
    content["joints"]["hinge"]["effort_limit"] = 2.0
    own = folder / "weak_pendulum.yaml"
    own.write_text(yaml.safe_dump(content))
    client = Client(context)
    states = client.listen(topics.JOINT_STATES)
    with recorded(folder / "realtime") as processes:
        simulator = processes.simulator(
            str(own), mode="realtime", wait_for_subscribers=3, command_delay_ticks=1
        )
        processes.controller(str(own), wait_for_subscribers=2)

        def driven() -> bool:
            return sum(map(any, (message.effort for message in states.messages))) > 60

        client.spin_until(driven, "ticks with an effort")
        simulator.send(signal.SIGINT)
        assert simulator.wait() == 0
    client.close()
    return folder / "realtime" / "run"


@pytest.fixture(scope="module")
def pair(folder: Path) -> Path:
    """Two pendulums in one world."""
    names, places = ["left", "right"], {"left": [0.0] * 4, "right": [0.0, 2.0, 0.0, 0.5]}
    with recorded(folder / "pair", characters=names) as processes:
        simulator = processes.simulator(
            characters=names,
            right__placement=places["right"],
            right__initial_position=[0.3],
            max_ticks=40,
            wait_for_subscribers=2,
        )
        for name in names:
            own = {"character": "pendulum", "placement": places[name]}
            processes.node(topics.CONTROLLER_NODE, name, wait_for_subscribers=2, **own)
        assert simulator.wait() == 0
    return folder / "pair" / "run"


def by_commands(path: Path, **options: Any) -> Any:
    return replay_commands(path, progress=lambda _: None, tell=print, **options)


def by_states(path: Path, **options: Any) -> CommandComparison:
    return replay_states(path, progress=lambda _: None, tell=print, **options)


def rewritten(source: Path, target: Path, change: Callable[[str, bytes], bytes | None]) -> Path:
    """A copy of a run's bag, each message as `change(topic, raw)` gives it; without it if None."""
    with BagWriter(target) as bag:
        known = {}
        for message in read_messages(source / "bag"):
            if message.topic not in known:
                topic = next(t for t in all_topics() if f"/{t.name.lstrip('/')}" == message.topic)
                known[message.topic] = topic
                bag.add_topic(message.topic, topic.message_type, topic.qos)
            raw = change(message.topic, message.raw)
            if raw is not None:
                bag.write(message.topic, raw, message.log_time_ns)
    return target


def all_topics() -> list[topics.Topic]:
    plain = [value for value in vars(topics).values() if isinstance(value, topics.Topic)]
    nodes = (topics.SIM_NODE, topics.CONTROLLER_NODE)
    return plain + [topic.of(node) for topic in plain for node in nodes]


# The bag in the controller's place


def test_a_walk_comes_again_when_the_bag_commands_a_simulator(
    walk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(walk), "--through-topics"]) == 0

    summary, _ = read_figures(walk)
    said = capsys.readouterr().out
    assert "identical: 121 states of humanoid, 1 episode" in said
    assert f"state hash {summary['state_hash']};" in said


def test_delays_clipped_torques_pushes_pauses_and_a_reset_come_again(eventful: Path) -> None:
    recording = read_recording(eventful)
    limits = recording.character.effort_limits()
    reached = (recording.layout.norms(np.nan_to_num(recording.effort)) >= limits * (1 - 1e-9)).sum()
    pushed = [push for push in recording.applied_wrench if push is not None and push.links]
    assert reached > 10 and len(pushed) > 5 and len(recording.episode_rows) == 2

    told: list[int] = []

    result = replay_commands(eventful, progress=told.append, tell=print)

    summary, _ = read_figures(eventful)
    assert result.difference is None
    assert result.notes == []  # nothing was needed but the commands
    assert (result.states, result.episodes) == (TICKS + 1, 2)
    assert result.state_hashes == {"": summary["state_hash"]}
    assert told and told == sorted(told) and told[-1] <= TICKS + 1


def test_what_the_clock_decided_comes_again_from_the_efforts_applied(realtime: Path) -> None:
    recording = read_recording(realtime)
    assert np.abs(recording.effort).max() == 2.0  # its limit

    result = by_commands(realtime)

    assert result.difference is None and result.states == len(recording.stamps_ns)
    (note,) = result.notes
    assert "efforts that were really applied" in note


def test_two_characters_of_one_world_come_again(pair: Path) -> None:
    result = by_commands(pair)

    assert result.difference is None and result.states == 41
    hashes = result.state_hashes
    assert set(hashes) == {"left", "right"} and hashes["left"] != hashes["right"]


def test_one_bit_of_one_command_is_found_with_its_tick_and_joint(
    walk: Path, tmp_path: Path
) -> None:
    recording = read_recording(walk)
    row, dof = 40, "right_knee"
    decoder = JointStateDecoder()

    def change(topic: str, raw: bytes) -> bytes:
        if topic != "/joint_torques":
            return raw
        sent = decoder.decode(raw)
        if sent.stamp_ns != recording.stamps_ns[row]:
            return raw
        sent.effort.view(np.int64)[sent.names.index(dof)] ^= 1
        return JointStateEncoder(sent.names).encode(sent.stamp_ns, effort=sent.effort)

    result = by_commands(rewritten(walk, tmp_path / "bag", change))

    assert result.difference is not None
    assert (result.difference.tick, result.difference.name) == (row + 2, dof)
    assert result.difference.quantity == "effort"
    assert 0.0 < abs(result.difference.apart) < 1e-12


def renamed(pair: Path, target: Path, keep: Callable[[RecordedMessage], bool]) -> Path:
    """A copy of two characters' run, below a namespace, with some of its messages."""
    shutil.copytree(pair, target, ignore=shutil.ignore_patterns("bag"))
    with BagWriter(target / "bag") as bag:
        known = set[str]()
        for message in filter(keep, read_messages(pair / "bag")):
            own = message.topic.startswith(("/left/", "/right/"))
            name = f"/lab{message.topic}" if own else message.topic
            if name not in known:
                known.add(name)
                last = name.rpartition("/")[2]
                topic = next(t for t in all_topics() if t.name.rpartition("/")[2] == last)
                bag.add_topic(name, topic.message_type, topic.qos)
            bag.write(name, message.raw, message.log_time_ns)
    return target


def test_a_state_more_of_one_character_is_no_difference_from_its_summary(
    pair: Path, tmp_path: Path
) -> None:
    last_ns, decoder = read_recording(pair, "left").stamps_ns[-1], JointStateDecoder()

    def keep(message: RecordedMessage) -> bool:
        is_state = message.topic == "/left/joint_states"
        return not (is_state and decoder.decode(message.raw).stamp_ns == last_ns)

    run = renamed(pair, tmp_path / "run", keep)
    (run / "left" / SUMMARY).unlink()  # of all its states

    assert main(["replay", str(run)]) == 0


def test_the_summaries_are_found_below_any_namespace(
    pair: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = renamed(pair, tmp_path / "run", lambda message: True)
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
    said = capsys.readouterr().out
    assert re.fullmatch(r"identical: the commands that answer 12[01] states of humanoid\n", said)


def test_changed_gains_laws_and_trajectories_come_again(eventful: Path) -> None:
    recording = read_recording(eventful)
    changes = parameter_changes(recording)
    assert sum(map(len, changes.values())) == 5
    rare = read_rare_messages(eventful, recording)
    assert rare.requested == {topic.name for topic in REQUESTS}
    assert sum(map(len, rare.requests.values())) == 4

    findings = by_states(eventful)

    assert findings.identical, str(findings.first)
    assert findings.states >= TICKS - 1


def test_a_gain_that_is_not_changed_as_it_was_is_found_at_its_first_tick(eventful: Path) -> None:
    recording = read_recording(eventful)
    first = first_parameters(recording)["gains.chest.p"]
    (row,) = [
        row
        for row, each in parameter_changes(recording).items()
        if any(change.get("gains.chest.p") == 700.0 for change in each)
    ]

    findings = by_states(eventful, settings={"gains.chest.p": first})

    assert findings.first is not None and findings.largest is not None
    assert findings.first.tick == row + 2  # of the next state; the first row is that of tick 1
    largest = {joint.name: joint.largest for joint in findings.joints}
    assert largest["chest"] > 0.1
    assert not findings.within(0.5 * findings.largest_difference)
    assert findings.within(findings.largest_difference)


def test_each_character_of_a_world_can_be_answered(pair: Path) -> None:
    findings = by_states(pair, character="right")

    assert findings.identical and findings.states >= 40


def test_states_that_the_controller_never_saw_are_left_out(realtime: Path) -> None:
    recording = read_recording(realtime)
    answered = sum(map(bool, recording.commands))

    findings = by_states(realtime)

    assert findings.identical, str(findings.first)
    assert findings.states == answered > 10


def test_a_controller_that_drives_less_is_told(walk: Path) -> None:
    findings = by_states(walk, settings={"root_assistance": False})

    assert not findings.identical and not findings.within(1e9)
    assert findings.lacking == tuple(f"root_{entry}" for entry in ("x", "y", "z", "rx", "ry", "rz"))


def test_where_only_the_sign_of_zero_differs_the_largest_difference_is_that(walk: Path) -> None:
    recording = read_recording(walk)
    entry, rest = 7, recording.layout.dof_names[6:]  # nothing commands the root
    sent = [
        tuple(
            CommandArrays(rest, merge_commands(recording.layout, each)[6:], 0)
            for each in [commands]
        )
        for commands in recording.commands
    ]
    sent[5][0].efforts[entry - 6] = 0.0
    recording = replace(recording, commands=tuple(sent))
    received = recorded_commands(recording)
    received[5, entry] = -0.0

    findings = compare_commands(recording, received)

    assert not findings.identical and findings.within(0.0)
    assert findings.largest is not None and findings.largest == findings.first
    assert findings.largest.name == recording.layout.dof_names[entry]


# A bag that begins in the middle of an episode


@pytest.fixture(scope="module")
def late(eventful: Path, folder: Path) -> Path:
    """The bag of a recorder that came later: the first whole episode is the second one."""
    decoder = JointStateDecoder()
    stamps = read_recording(eventful).stamps_ns

    def change(topic: str, raw: bytes) -> bytes | None:
        stamped = topic in ("/joint_states", "/joint_torques")
        return None if stamped and decoder.decode(raw).stamp_ns < stamps[20] else raw

    return rewritten(eventful, folder / "late", change)


def test_the_second_episode_alone_comes_again(late: Path, eventful: Path) -> None:
    whole, recording = read_recording(eventful), read_recording(late)
    assert recording.stamps_ns[0] == whole.stamps_ns[whole.episode_rows[1]]

    result = by_commands(late)

    assert result.difference is None and result.notes == []
    assert (result.states, result.episodes) == (len(recording.stamps_ns), 1)


def test_its_controller_begins_with_what_was_in_force_then(late: Path) -> None:
    recording = read_recording(late)
    assert first_parameters(recording)["law"] == "zero"
    assert first_parameters(recording)["gains.chest.p"] == 700.0

    findings = by_states(late)

    assert findings.identical, str(findings.first)
    assert findings.states >= len(recording.stamps_ns) - 1


# The command


def test_the_command_shows_what_another_gain_changes(
    walk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--through-topics", "simulator", "--set", "controller_node.gains.chest.p:=900"]

    assert main(["replay", str(walk), *options]) == 0

    said = capsys.readouterr().out
    assert "first difference: tick 1 " in said
    assert "largest difference: tick" in said and "right_shoulder" in said


WRONG_OPTIONS: dict[str, tuple[list[str], str]] = {
    "a setting of no use": (["--set", "controller_node.law:=pd"], "--through-topics simulator"),
    "no start of no use": (["--through-topics", "--no-start"], "--through-topics simulator"),
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


def test_somebodys_own_controller_is_waited_for_and_compared(
    processes: Processes, foreign: Path, domain: int
) -> None:
    options = ["--through-topics", "simulator", "--no-start"]
    process = processes.command("replay", str(foreign), *options)
    wait_until(lambda: "waiting for a controller" in process.stderr, "it says what it waits for")

    processes.python(str(EXAMPLE))

    assert process.wait() == 0
    assert f"ROS_DOMAIN_ID={domain}" in process.stdout
    assert "identical: the commands that answer" in process.stdout


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


# Waiting


def test_what_is_waited_for_is_told_every_two_seconds_and_then_given_up(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = 100.0
    monkeypatch.setattr("actuated_characters.replay.players.processes.time.monotonic", lambda: now)
    report = PlayerReport()
    told = []
    for now in np.arange(100.0, 160.1, 0.5):  # the clock
        report.tell_wait(lambda: "an answer")
        told += [now] * bool(capsys.readouterr().out)

    assert told[0] <= 102.5 and told[-1] >= 157.5 and np.diff(told).max() <= 2.5
    now = 160.5
    with pytest.raises(RunError, match=r"^waited 60 s for an answer$"):
        report.tell_wait(lambda: "an answer")


# What is sent


def command(layout: Any, joints: list[str], value: float) -> CommandArrays:
    entries = np.flatnonzero(layout.mask(joints))
    names = tuple(layout.dof_names[entry] for entry in entries)
    return CommandArrays(names, np.full(len(names), value), 0)


def test_commands_are_sent_until_they_cover_the_tick(walk: Path) -> None:
    recording = read_recording(walk)
    joints = list(recording.parameters["commanded_joints"])
    legs, rest = joints[:4], joints[4:]
    sent = [command(recording.layout, part, 1.0) for part in (legs, legs, rest, legs)]
    unknown = CommandArrays(("nose",), np.ones(1), 0)
    not_finite = command(recording.layout, legs, np.nan)

    (inputs,) = make_inputs(
        [replace(recording, commands=((unknown, not_finite, *sent),) * len(recording.stamps_ns))]
    )

    assert not inputs.are_applied
    assert inputs.commands == ((sent[0], sent[2]),) * 120  # a repeated one is not needed


def test_after_a_conflict_the_commands_that_were_asked_for_anew_count(walk: Path) -> None:
    recording = read_recording(walk)
    joints = list(recording.parameters["commanded_joints"])
    legs, rest = joints[:4], joints[4:]
    sent = [
        command(recording.layout, legs, 1.0),
        command(recording.layout, legs, 2.0),  # somebody else's: it pauses
        command(recording.layout, rest, 3.0),
    ]

    (inputs,) = make_inputs(
        [replace(recording, commands=(tuple(sent),) * len(recording.stamps_ns))]
    )

    assert inputs.commands[0] == (sent[1], sent[2])


def test_one_tick_without_its_commands_lets_the_applied_efforts_decide(walk: Path) -> None:
    recording = read_recording(walk)
    lacking = (*recording.commands[:50], (), *recording.commands[51:])

    (inputs,) = make_inputs([replace(recording, commands=lacking)])

    assert inputs.are_applied
    for tick in (0, 50, 119):
        (sent,) = inputs.commands[tick]
        entries = recording.layout.indices(sent.names)
        assert sent.efforts.tobytes() == recording.effort[tick, entries].tobytes()


def test_pushes_that_nobody_knows_the_effect_of_are_an_error(walk: Path) -> None:
    recording = replace(read_recording(walk), pushes_sent=2, applied_wrench=())

    with pytest.raises(RecordingError, match="2 messages on 'external_wrench'"):
        make_inputs([recording])


def test_a_recording_without_commanded_joints_says_what_to_do(walk: Path) -> None:
    recording = read_recording(walk)
    limp = replace(recording, parameters={**recording.parameters, "commanded_joints": []})

    with pytest.raises(RecordingError, match="without --through-topics"):
        make_inputs([limp])


# What is compared


def test_any_bit_of_any_command_is_found(walk: Path) -> None:
    recording = read_recording(walk)
    rng = np.random.default_rng(5)
    said = np.array([merged_by_hand(recording, row) for row in range(120)])
    assert compare_commands(recording, said).identical
    for _ in range(20):
        row, entry, bit = int(rng.integers(120)), int(rng.integers(34)), int(rng.integers(52))
        changed = said.copy()
        changed.view(np.int64)[row, entry] ^= 1 << bit

        findings = compare_commands(recording, changed)

        assert findings.first is not None and findings.first == findings.largest
        name = recording.layout.dof_names[entry]
        assert (findings.first.tick, findings.first.name) == (row + 1, name)
        assert findings.first.found == changed[row, entry]
        assert findings.largest_difference == abs(changed[row, entry] - said[row, entry])


def merged_by_hand(recording: Recording, row: int) -> Any:
    (sent,) = recording.commands[row]
    effort = dict(zip(sent.names, sent.efforts, strict=True))
    return [effort[name] for name in recording.layout.dof_names]


def test_a_ball_joints_difference_is_the_length_of_a_vector(walk: Path) -> None:
    recording = read_recording(walk)
    said = np.array([merged_by_hand(recording, row) for row in range(10)])
    chest = recording.layout.joint("chest").entries
    said[4, chest] += [3.0, 4.0, 12.0]

    findings = compare_commands(recording, said)

    (found,) = [joint for joint in findings.joints if joint.name == "chest"]
    assert found.largest == pytest.approx(13.0) and found.mean == pytest.approx(1.3)
    assert [joint.largest for joint in findings.joints if joint.name != "chest"] == [0.0] * 13


def found_again(recording: Recording) -> dict[str, FloatArray]:
    first = np.full((1, recording.layout.size), np.nan)
    effort = np.concatenate((first, recording.effort))
    position, velocity = recording.position.copy(), recording.velocity.copy()
    return {EFFORT: effort, POSITION: position, VELOCITY: velocity}


def test_of_states_that_came_back_any_bit_is_found_at_its_tick(walk: Path) -> None:
    recording = read_recording(walk)
    rng = np.random.default_rng(6)
    for quantity in (POSITION, VELOCITY, EFFORT) * 5:
        found, row, entry = found_again(recording), int(rng.integers(1, 121)), int(rng.integers(34))
        found[quantity].view(np.int64)[row, entry] ^= 1 << int(rng.integers(52))
        found[VELOCITY][row + 1 :] += 1.0  # what it leads to comes later

        result = compare_world([recording], [found])

        assert result.difference is not None
        assert result.difference.quantity == quantity
        assert result.difference.tick == row + 1
        assert result.difference.name == recording.layout.dof_names[entry]


def test_within_a_tolerance_the_largest_differences_are_told(walk: Path) -> None:
    recording = read_recording(walk)
    found = found_again(recording)
    found[VELOCITY][60] += 1e-6
    found[EFFORT][30] += 1e-3  # what is applied may be another one, if the states are not

    assert compare_world([recording], [found], tolerance=1e-5).identical
    result = compare_world([recording], [found], tolerance=1e-7)

    assert result.difference is not None
    assert (result.difference.tick, result.difference.quantity) == (61, "velocity")
    expected = {"rad": 0.0, "m": 0.0, "rad/s": 1e-6, "m/s": 1e-6}
    assert result.largest == pytest.approx(expected, abs=1e-12)


def test_a_turn_by_more_than_pi_is_a_small_difference(walk: Path) -> None:
    """A rotation vector jumps at norm pi; rotations are compared as rotations."""
    recording = read_recording(walk)
    chest = recording.layout.joint("chest").entries
    position = recording.position.copy()
    position[:, chest] = [np.pi - 1e-6, 0.0, 0.0]
    turned = replace(recording, position=position)
    found = found_again(turned)
    found[POSITION][:, chest] = [-np.pi + 1e-6, 0.0, 0.0]

    assert compare_world([turned], [found], tolerance=3e-6).identical
    assert not compare_world([turned], [found], tolerance=1e-6).identical


# What a controller is given


def settings_of(**values: float | None) -> dict[str, Any]:
    return {"gains.a.p": 1.0, "effort_limit.a": None, **values}


def test_a_controllers_parameters_are_those_before_its_first_answer(walk: Path) -> None:
    recording = read_recording(walk)
    stamps = recording.stamps_ns.tolist()
    said = (
        ControllerSettings(settings_of(), None),
        ControllerSettings(settings_of(**{"gains.a.p": 2.0}), None),
        ControllerSettings(settings_of(**{"gains.a.p": 3.0}), stamps[5]),
        ControllerSettings(settings_of(**{"gains.a.p": 4.0, "effort_limit.a": 9.0}), stamps[5]),
        ControllerSettings(settings_of(**{"gains.a.p": 4.0, "effort_limit.a": None}), stamps[9]),
    )
    steered = replace(recording, controller=said)

    assert first_parameters(steered) == {"gains.a.p": 2.0, "effort_limit.a": np.inf}
    changes = parameter_changes(steered)
    assert changes == {
        5: [{"gains.a.p": 3.0}, {"gains.a.p": 4.0, "effort_limit.a": 9.0}],
        9: [{"effort_limit.a": np.inf}],
    }
    assert parameter_changes(steered, ["gains.a.p"])[5] == [{"effort_limit.a": 9.0}]


def test_a_controller_that_is_not_in_the_bag_cannot_be_started(walk: Path) -> None:
    with pytest.raises(RecordingError, match="use --no-start"):
        first_parameters(replace(read_recording(walk), controller=()))


# Characters as files


@pytest.mark.parametrize("name", [*shipped_characters(), str(DATA / "turned_frames_y_up.yaml")])
def test_a_character_that_is_written_is_the_same_when_it_is_read(name: str, tmp_path: Path) -> None:
    original = load_character(name)

    file = write_character(tmp_path / "new", original)

    again = load_character(str(file))
    assert again.name == original.name
    assert again.links == original.links
    assert again.gains == original.gains and again.clips == original.clips
    assert again.rest_position == original.rest_position and again.feet == original.feet
    loading = original.loading
    for field in ("scale", "fixed_base", "inertia_from_file", "self_collision"):
        assert getattr(again.loading, field) == getattr(loading, field)


def test_limits_are_lifted_and_nothing_else(tmp_path: Path) -> None:
    original = character("humanoid")

    again = load_character(str(write_character(tmp_path, original, lift_limits=True)))

    assert (again.effort_limits() >= 1e300).all()
    assert again.gains == original.gains and again.mass == original.mass
    assert again.rest_position == original.rest_position
