"""What a bag holds: all topics of the contract, less what is excluded, and others by name."""

import json
import signal
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.parameter import Parameter as RosParameter
from rosbags.highlevel import AnyReader
from std_msgs.msg import Header

from actuated_characters.bags.reader import read_messages
from actuated_characters.recorder.node import RecorderNode
from actuated_characters.recorder.topic_reader import TopicReader
from actuated_characters.recorder.topics import RecordedTopic
from msgs_config.errors import ActuatedCharactersError
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.topic import LATCHED, STREAM, Quality, Topic
from sim_node.physics.wrenches import ExternalWrench
from tests.support.physics import character, simulation
from tests.support.ros import PATIENCE, Processes, SimulatorClient, tick_of, wrench_message

pytestmark = pytest.mark.slow

CLOCK = TickClock(240)
TICKS = 60
PUSHED_AT = 30
LINKS = [link.name for link in character("humanoid").links]

Messages = dict[str, dict[int, Any]]
"""By topic, the messages by tick."""


def record(
    processes: Processes, client: SimulatorClient, directory: Path, **parameters: object
) -> Messages:
    """A recorder beside a humanoid that falls and is pushed once; what the bag then holds."""
    recorder = processes.node(topics.RECORDER_NODE, directory=str(directory), **parameters)
    simulator = processes.simulator(
        "humanoid", max_ticks=TICKS, wait_for_subscribers=2, wrench_duration=3.0 / 240.0
    )
    state = client.first_state(listeners=2)
    client.wrenches.publish(
        wrench_message(
            CLOCK.stamp_ns(PUSHED_AT),
            [
                ("chest", [60.0, -40.0, 20.0, 1.0, 2.0, 3.0]),
                ("left_wrist", [0.0, 30.0] + [0.0] * 4),
            ],
            [[0.0, 0.1, 0.02], [0.0, 0.0, 0.05]],
        )
    )
    client.drive(state, TICKS, np.random.default_rng(4))
    assert client.wrenches.wait_for_all_acked(Duration(seconds=PATIENCE))
    assert simulator.wait() == 0
    recorder.send(signal.SIGINT)
    assert recorder.wait() == 0
    found: Messages = {}
    for message in read_messages(directory / "bag"):
        if message.type_name.startswith("sensor_msgs/"):
            decoded = message.decode()
            found.setdefault(message.topic, {})[tick_of(decoded)] = decoded
    return found


def vectors(wrench: Any) -> list[float]:
    return [getattr(part, axis) for part in (wrench.force, wrench.torque) for axis in "xyz"]


def pushes_of(message: Any) -> list[ExternalWrench]:
    """What a message on `applied_wrench` says, as pushes of one tick."""
    return [
        ExternalWrench(
            LINKS.index(name),
            np.array(vectors(wrench)),
            np.array([getattr(turn.translation, axis) for axis in "xyz"]),
            first_tick=1,
            ticks=1,
        )
        for name, wrench, turn in zip(
            message.joint_names, message.wrench, message.transforms, strict=True
        )
    ]


def test_a_bag_holds_all_that_repeats_a_run_with_pushes_and_its_contacts(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    bag = record(processes, client, tmp_path / "run")

    assert list(bag["/external_wrench"]) == [PUSHED_AT]
    assert list(bag["/applied_wrench"]) == list(range(1, TICKS + 2))
    assert list(bag["/contacts"]) == list(range(1, TICKS + 2))
    pushed = [tick for tick, m in bag["/applied_wrench"].items() if m.joint_names]
    assert pushed == [PUSHED_AT + 1, PUSHED_AT + 2, PUSHED_AT + 3]
    with simulation("humanoid") as again:
        again.watches_contacts = True
        for tick in range(1, TICKS + 1):
            state = again.advance(
                effort_at(bag["/joint_torques"], tick),
                *pushes_of(bag["/applied_wrench"][tick + 1]),
            )
            assert list(bag["/joint_states"][tick + 1].position) == state.position.tolist()
            assert list(bag["/joint_states"][tick + 1].velocity) == state.velocity.tolist()
            contacts, message = again.simulated.contacts, bag["/contacts"][tick + 1]
            assert contacts is not None
            rows = np.flatnonzero(contacts.touching).tolist()
            assert list(message.joint_names) == [LINKS[row] for row in rows]
            recorded = [vectors(wrench) for wrench in message.wrench]
            assert recorded == contacts.wrenches[rows].tolist()


def effort_at(torques: Mapping[int, Any], tick: int) -> Any:
    """The effort (n,) that answered a tick's state."""
    layout, message = character("humanoid").layout, torques[tick]
    given = dict(zip(message.name, message.effort, strict=True))
    return np.array([given.get(name, 0.0) for name in layout.dof_names])


def test_what_is_excluded_is_not_recorded(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    bag = record(processes, client, tmp_path / "run", exclude=["contacts", "/applied_wrench"])

    assert "/contacts" not in bag
    assert "/applied_wrench" not in bag
    assert list(bag["/external_wrench"]) == [PUSHED_AT]


# A whole run, and what other readers make of its bag


@pytest.fixture(scope="module")
def fall(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The bag of a run of the command line: a humanoid that lands on the ground."""
    del domain
    folder = tmp_path_factory.mktemp("fall")
    started = Processes(folder)
    higher = ("--set", "sim_node.placement:=[0.0, 0.0, 0.05, 0.0]")
    run = started.command("run", "--duration", "0.5", *higher, "--output", "run")
    try:
        assert run.wait(120.0) == 0, run.stderr
        yield folder / "run" / "bag"
    finally:
        started.end()


def contract() -> set[str]:
    """Every topic of the table, as it is named in a bag of one character without sensors."""
    names = {"/sim_node/configuration", "/sim_node/keyframe"}
    for topic in topics.TABLE:
        alone = topic.name.partition("/")[0] in ("imu", "force", "contact_wrenches")
        alone |= "ros2_control_bridge" in topic.way  # which is not there
        if not alone and not topic.name.startswith("/tf"):  # whose type is not among the wheels
            names.add("/" + topic.of(topics.CONTROLLER_NODE).name.lstrip("/"))
    return names


def test_a_run_records_every_topic_of_the_contract(fall: Path) -> None:
    content = yaml.safe_load((fall / "metadata.yaml").read_text())
    listed = content["rosbag2_bagfile_information"]["topics_with_message_count"]

    whole = {name for name in contract() if not name.endswith("_throttle")}  # those have a part
    assert {topic["topic_metadata"]["name"] for topic in listed} == whole


def test_every_tick_of_every_stream_is_recorded(fall: Path) -> None:
    ticks: dict[str, list[int]] = {}
    counts = Counter[str]()
    for message in read_messages(fall):
        counts[message.topic] += 1
        found = ticks.setdefault(message.topic, [])
        decoded = message.decode()
        stamped = getattr(decoded, "markers", [decoded])[0]
        if message.topic == "/clock":
            found.append(round(stamp_ns_of_clock(decoded) * 240 / 1e9))
        elif hasattr(stamped, "header") and message.topic != "/diagnostics":
            found.append(tick_of(stamped))

    by_tick = {topic: list(dict.fromkeys(found)) for topic, found in ticks.items()}
    states = list(range(1, 122))
    for topic in ("clock", "joint_states", "contacts", "applied_wrench", "odom"):
        assert by_tick[f"/{topic}"] == states
    for topic in ("joint_torques", "controller_node/reference", "controller_node/net_wrench"):
        assert by_tick[f"/{topic}"][:120] == states[:120]
    assert by_tick["/visualization"] == [1, *range(8, 122, 8)]  # 30 Hz
    for topic in ("episode", "sim_node/configuration", "controller_node/configuration"):
        assert counts[f"/{topic}"] == 1
    assert counts["/diagnostics"] >= 2


def stamp_ns_of_clock(message: Any) -> int:
    return int(message.clock.sec) * 10**9 + int(message.clock.nanosec)


def test_other_readers_decode_every_message(fall: Path) -> None:
    own = Counter(message.topic for message in read_messages(fall))

    by_mcap = Counter[str]()
    with (fall / "bag.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, decoded in reader.iter_decoded_messages():
            assert decoded is not None
            by_mcap[channel.topic] += 1
    by_rosbags = Counter[str]()
    with AnyReader([fall]) as any_reader:
        for connection, _, raw in any_reader.messages():
            any_reader.deserialize(raw, connection.msgtype)
            by_rosbags[connection.topic] += 1

    assert by_mcap == by_rosbags == own


# By name


def test_topics_by_name_are_recorded_as_their_publishers_offer_them(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    # Arrange: one is there before the recorder, others come later, one never
    volatile, latched = Quality(10, is_reliable=False), Quality(1, is_latched=True)
    early = Topic("early", "std_msgs/msg/Header", LATCHED)
    before = client.speak(early)
    before.publish(Header(frame_id="before"))
    names = ["early", "/far/sensor", "latched", "never", "/joint_states"]
    recorder = processes.node(topics.RECORDER_NODE, directory="run", topics=names)
    client.spin_until(before.get_subscription_count, "a recorder")

    # Act
    sensor = client.speak(Topic("/far/sensor", "std_msgs/msg/Header", volatile))
    late = client.speak(Topic("latched", "std_msgs/msg/Header", latched))
    late.publish(Header(frame_id="kept for who comes later"))
    client.spin_until(lambda: sensor.get_subscription_count(), "a recorder of what came later")
    client.spin_until(lambda: late.get_subscription_count(), "a recorder of what is latched")
    for number in range(5):
        sensor.publish(Header(frame_id=str(number)))
    bag = tmp_path / "run" / "bag"
    client.spin_until(lambda: b"kept for who" in (bag / "bag.mcap").read_bytes(), "a flush")
    recorder.send(signal.SIGINT)

    # Assert
    assert recorder.wait() == 1  # the figures need a simulator
    assert "'/never' had no publisher" in recorder.stderr
    found: dict[str, list[str]] = {}
    for message in read_messages(bag):
        found.setdefault(message.topic, []).append(message.decode().frame_id)
    assert found == {
        "/early": ["before"],
        "/latched": ["kept for who comes later"],
        "/far/sensor": ["0", "1", "2", "3", "4"],
    }
    content = yaml.safe_load((bag / "metadata.yaml").read_text())
    offered = {
        topic["topic_metadata"]["name"]: topic["topic_metadata"]["offered_qos_profiles"]
        for topic in content["rosbag2_bagfile_information"]["topics_with_message_count"]
    }
    assert offered["/far/sensor"][0]["reliability"] == "best_effort"
    assert offered["/latched"][0]["durability"] == "transient_local"


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({"topics": ["two words"]}, ["'topics'", "'two words'", "must not contain"]),
        ({"characters": ["7up"]}, ["'characters'", "'7up'", "must not start"]),
        ({"characters": ["left", "left"]}, ["'characters'", "'left' twice"]),
        ({"exclude": ["contcts"]}, ["'exclude'", "did you mean 'contacts'"]),
        ({"exclude": ["joint_states"]}, ["'exclude'", "'joint_states'"]),
        ({"sensors": ["pelvis_imu"]}, ["'sensors'", "'pelvis_imu'", "imu/NAME or force/NAME"]),
        ({"compression": "lz4"}, ["'compression'", "'lz4'", "none, zstd"]),
        ({"compression": "zip"}, ["'compression'", "'zip'", "none, zstd"]),
        ({"log_time": "sim"}, ["'log_time'", "'sim'", "wall, simulated"]),
    ],
    ids=str,
)
def test_a_wrong_parameter_is_one_clear_line_and_leaves_nothing_behind(
    context: Context, tmp_path: Path, parameters: dict[str, Any], expected: list[str]
) -> None:
    given = [RosParameter(name, value=value) for name, value in parameters.items()]
    given.append(RosParameter("directory", value=str(tmp_path / "run")))

    with pytest.raises(ActuatedCharactersError) as caught:
        RecorderNode(context=context, parameter_overrides=given)

    assert all(part in str(caught.value) for part in expected)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "run").exists()


# Several characters


def test_one_recorder_records_several_characters_with_figures_of_each(
    processes: Processes, tmp_path: Path
) -> None:
    names = ["left", "right"]
    recorder = processes.node(topics.RECORDER_NODE, directory="run", characters=names)
    for name in names:
        processes.node(topics.CONTROLLER_NODE, name, character="pendulum", wait_for_subscribers=2)
    simulator = processes.simulator(
        characters=names, max_ticks=TICKS, wait_for_subscribers=2, left__initial_position=[0.3]
    )

    assert simulator.wait() == 0
    recorder.send(signal.SIGINT)
    assert recorder.wait() == 0

    ticks: dict[str, list[int]] = {}
    for message in read_messages(tmp_path / "run" / "bag"):
        if message.type_name == "sensor_msgs/msg/JointState":
            ticks.setdefault(message.topic, []).append(tick_of(message.decode()))
    metrics = {
        name: json.loads((tmp_path / "run" / name / "summary.json").read_text()) for name in names
    }
    for name in names:
        states = list(dict.fromkeys(ticks[f"/{name}/joint_states"]))
        assert states == list(range(1, TICKS + 2))
        answered = list(dict.fromkeys(ticks[f"/{name}/controller_node/reference"]))
        assert answered[:TICKS] == states[:TICKS]
        assert metrics[name]["ticks"] == TICKS
        assert metrics[name]["rejected_commands"] == 0
        assert metrics[name]["lost_messages"] == {}
        assert (tmp_path / "run" / name / "measurements.csv").exists()
    assert metrics["left"]["state_hash"] != metrics["right"]["state_hash"]


def test_a_topic_gives_no_more_at_a_time_than_is_asked_for(client: SimulatorClient) -> None:
    # who publishes faster than a recorder takes would otherwise never let it flush, or end
    topic = Topic("flood", "std_msgs/msg/Header", STREAM)
    publisher = client.speak(topic)
    inbox = TopicReader(client.node, RecordedTopic(topic, "/flood", "flood", None))
    client.spin_until(publisher.get_subscription_count, "a recorder's inbox")
    for _ in range(12):
        publisher.publish(Header())
    assert publisher.wait_for_all_acked(Duration(seconds=30))

    assert [len(list(inbox.take(5))) for _ in range(4)] == [5, 5, 2, 0]


def test_publishers_that_are_gone_before_their_messages_are_taken_have_lost_nothing(
    client: SimulatorClient,
) -> None:
    # a recorder on a busy machine takes the last diagnostics of nodes that have ended
    topic = Topic("flood", "std_msgs/msg/Header", STREAM)
    inbox = TopicReader(client.node, RecordedTopic(topic, "/flood", "flood", None))
    publishers = [client.speak(topic) for _ in range(3)]
    client.spin_until(
        lambda: all(each.get_subscription_count() for each in publishers), "a recorder's inbox"
    )
    for number in [0, 1, 0, 1, 2, 0, 1]:
        publishers[number].publish(Header())
    for each in publishers:
        assert each.wait_for_all_acked(Duration(seconds=30))
        assert client.node.destroy_publisher(each)
    client.spin_until(lambda: not client.node.count_publishers("/flood"), "their end")

    assert len(list(inbox.take(100))) == 7
    assert inbox.lost_messages == 0
