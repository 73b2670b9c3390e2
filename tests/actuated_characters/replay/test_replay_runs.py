"""What real nodes have done and a recorder has heard comes again, to the last bit."""

import json
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from actuated_characters.bags.reader import RecordedMessage
from actuated_characters.bags.recording import read_recording, read_recordings
from actuated_characters.cli import main
from actuated_characters.replay.replay import replay
from msgs_config.errors import RecordingError
from msgs_config.messages import topics
from msgs_config.versions import installed_versions
from tests.sim_node.interface.test_services import begin_steps, response_of
from tests.support.rewriting import rewrite, with_flipped_effort
from tests.support.ros import Process, Processes, SimulatorClient, tick_of

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

LOWEST, LARGEST = 0, 62  # bits


def run(directory: Path, *options: str) -> Path:
    """A run by the command line."""
    assert main(["run", *options, "--output", str(directory)]) == 0
    return directory


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A second of walking, with assistance."""
    directory = tmp_path_factory.mktemp("walk") / "run"
    return run(directory, "--in-process", "--clip", "walk", "--duration", "1")


def recorder(processes: Processes, **parameters: object) -> Process:
    """A recorder that listens."""
    return processes.node(topics.RECORDER_NODE, directory="recorded", **parameters)


def ended(process: Process, directory: Path) -> Path:
    """What a recorder has recorded, once it has ended."""
    process.send(signal.SIGINT)
    assert process.wait() == 0, process.stderr
    return directory / "recorded"


# What comes again


def test_a_walk_with_assistance_comes_again(walk: Path) -> None:
    result = replay(read_recordings(walk))

    assert result.difference is None and result.remarks == ()
    assert (result.states, result.episodes) == (241, 1)
    assert result.state_hashes[""] == json.loads((walk / "summary.json").read_text())["state_hash"]
    assert read_recording(walk).contacts  # were compared, too


def test_a_pushed_fall_comes_again(tmp_path: Path, own_handlers: None) -> None:
    push, limp = "--push=chest:400,50,0@0.2", "controller_node.root_assistance:=false"
    options = ("--clip", "walk", "--duration", "1.5", push, "--set", limp)
    directory = run(tmp_path / "run", "--in-process", *options)

    recording = read_recording(directory)
    result = replay([recording])

    pushed = [each for each in recording.applied_wrench if each is not None and each.links]
    assert len(pushed) == 24
    assert json.loads((directory / "summary.json").read_text())["fell"]
    assert result.difference is None and result.states == 361


@pytest.mark.parametrize(
    "given",
    [{}, {"command_delay_ticks": 3, "substeps": 2, "mass_factors": ["all:1.2", "chest:1.5"]}],
    ids=str,
)
def test_two_resets_a_pause_and_clipped_torques_come_again(
    processes: Processes, client: SimulatorClient, tmp_path: Path, given: dict[str, object]
) -> None:
    recording_process = recorder(processes)
    motion = {"initial_velocity": [0.5] * 34, "speed_limit": 1e6}
    order = {"republish_period": 0.05, "step_count": 5, "wait_for_subscribers": 2}
    simulator = processes.simulator("humanoid", **motion, **order, **given)
    rng = np.random.default_rng(5)
    state = client.first_state(listeners=2)
    state = drive_hard(client, state, 40, rng)
    for ticks in (60, 30):
        assert client.reset().success
        state = drive_hard(client, client.state(tick_of(state) + 1), ticks, rng)
    client.pause(True)
    call = begin_steps(client)
    state = drive_hard(client, state, 5, rng)
    assert response_of(client, call)[0]
    client.pause(False)
    state = drive_hard(client, state, 20, rng)
    simulator.send(signal.SIGINT)  # it ends when the recorder, too, has the last states
    assert simulator.wait() == 0
    bag = ended(recording_process, tmp_path)

    recording = read_recording(bag)
    result = replay([recording])

    assert recording.episode_rows.tolist() == [0, 41, 102]
    assert tick_of(state) == len(recording.stamps_ns) == 158
    hips = [recording.layout.joint(f"{side}_hip").entries for side in ("left", "right")]
    sizes = np.linalg.norm([recording.effort[:, hip] for hip in hips], axis=2)
    assert np.isclose(sizes, 200.0).sum() > 10  # were clipped
    assert result.difference is None and result.remarks == ()
    assert (result.states, result.episodes) == (158, 3)


def drive_hard(
    client: SimulatorClient, state: JointState, ticks: int, rng: np.random.Generator
) -> JointState:
    """Command every motor at random, the hips beyond their limit at times; the state after."""
    motors = [name for name in state.name if not name.startswith("root_")]
    sizes = np.array([150.0 if "hip" in name else 5.0 for name in motors])
    for _ in range(ticks):
        torques = (sizes * rng.uniform(-1.0, 1.0, len(motors))).tolist()
        state = client.advance(state, dict(zip(motors, torques, strict=True)))
    return state


def test_two_humanoids_in_one_world_come_again(processes: Processes, tmp_path: Path) -> None:
    names = ["right", "left"]
    recording_process = recorder(processes, characters=names)
    near = [0.3, 0.1, 0.0, 2.0]
    for name, place in (("right", [0.0] * 4), ("left", near)):
        processes.node(
            topics.CONTROLLER_NODE,
            namespace=name,
            root_assistance=False,
            placement=place,
            wait_for_subscribers=2,
        )
    simulator = processes.node(
        topics.SIM_NODE,
        wait_for_subscribers=2,
        characters=names,
        left__placement=near,
        max_ticks=120,
    )
    assert simulator.wait() == 0
    bag = ended(recording_process, tmp_path)

    recordings = read_recordings(bag)
    result = replay(recordings)

    assert [recording.name for recording in recordings] == names
    assert result.difference is None and result.remarks == ()
    assert result.states == 121
    assert len(set(result.state_hashes.values())) == 2
    with pytest.raises(RecordingError, match="lacks right, in whose world left was"):
        replay([recordings[1]])


def test_an_arm_in_real_time_comes_again(tmp_path: Path, own_handlers: None) -> None:
    arm = ("--character", "franka_panda", "--reference", "sine", "--duration", "1")
    directory = run(tmp_path / "run", *arm, "--set", "sim_node.mode:=realtime")

    result = replay(read_recordings(directory))

    assert result.difference is None and result.remarks == ()
    assert result.states == 241


# What was changed is found


@pytest.mark.parametrize("topic", ["joint_states", "joint_torques"])
def test_one_flipped_bit_of_one_torque_is_found_and_named(
    walk: Path, tmp_path: Path, topic: str
) -> None:
    recording = read_recording(walk)
    rng = np.random.default_rng(11)
    later = 0 if topic == "joint_states" else 1  # tick in which a command acts
    for number, bit in enumerate([LOWEST, LOWEST, LARGEST, *rng.integers(0, 64, 3).tolist()]):
        row = int(rng.integers(1, 240))
        name = str(rng.choice(recording.layout.dof_names))
        changed = with_flipped_effort(
            walk / "bag",
            tmp_path / f"bag_{number}",
            topic=topic,
            stamp_ns=int(recording.stamps_ns[row]),
            name=name,
            bit=bit,
        )

        difference = replay(read_recordings(changed)).difference

        assert difference is not None
        assert (difference.name, difference.tick) == (name, row + 1 + later), (bit, difference)
        assert difference.quantity == "effort"


# The command


def with_another_command(bag: Path, target: Path) -> Path:
    """Copy a bag with a bit in it flipped, so that a replay differs at tick 102."""
    stamp_ns = int(read_recording(bag).stamps_ns[100])
    return with_flipped_effort(
        bag, target, topic="joint_torques", stamp_ns=stamp_ns, name="right_knee", bit=1
    )


def error_of(process: Process) -> str:
    """The error that a command has ended with."""
    (line,) = [line for line in process.stderr.splitlines() if line.startswith("error")]
    return line


def test_the_command_says_so(walk: Path, processes: Processes, tmp_path: Path) -> None:
    changed = with_another_command(walk / "bag", tmp_path / "changed")
    good, bad = (processes.command("replay", str(bag)) for bag in (walk, changed))

    assert good.wait() == 0 and bad.wait() == 1
    state_hash = json.loads((walk / "summary.json").read_text())["state_hash"]
    assert f"identical: 241 states of humanoid, 1 episode, state hash {state_hash}" in good.stdout
    line = error_of(bad)
    assert "tick 102" in line and "effort of 'right_knee' was" in line
    assert "N m was commanded" in line
    assert "recorded with" not in line


def with_versions(bag: Path, target: Path, change: Callable[[dict[str, str]], object]) -> Path:
    """Copy a bag with other versions in the simulator's configuration: None for none at all."""

    def altered(message: RecordedMessage) -> bytes:
        if not message.topic.endswith("sim_node/configuration"):
            return message.raw
        content = json.loads(message.decode().data)
        content["versions"] = change(content["versions"])
        if content["versions"] is None:
            del content["versions"]
        return bytes(serialize_message(String(data=json.dumps(content))))

    return rewrite(bag, target, altered)


def test_other_versions_are_named_beside_the_first_tick_that_differs(
    walk: Path, processes: Processes, tmp_path: Path
) -> None:
    others = {"numpy": "1.0.0", "actuated_characters": "0.1.0"}
    same = with_versions(walk / "bag", tmp_path / "same", lambda now: {**now, **others})
    bad = with_another_command(same, tmp_path / "bad")

    both = (("replay", str(bad)), ("info", "--json", str(bad)))
    commands = [processes.command(*words) for words in both]
    good = processes.command("replay", str(same))

    assert [*(command.wait() for command in commands), good.wait()] == [1, 0, 0]
    line = error_of(commands[0])
    present = installed_versions()
    assert "tick 102" in line
    assert line.endswith(
        f"; recorded with actuated_characters 0.1.0 (now {present['actuated_characters']}), "
        f"numpy 1.0.0 (now {present['numpy']})"
    )
    (character,) = json.loads(commands[1].stdout)["characters"]
    assert character["versions"] == {**present, **others}
    assert "identical" in good.stdout and "recorded with" not in good.stdout + good.stderr


def test_a_bag_that_says_no_versions_is_read(walk: Path, tmp_path: Path) -> None:
    (recording,) = read_recordings(with_versions(walk / "bag", tmp_path / "old", lambda now: None))

    assert recording.versions == {}
    assert replay([recording]).difference is None
