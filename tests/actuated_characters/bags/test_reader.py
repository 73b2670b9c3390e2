"""Recordings are read back by independent readers, with every field that rosbag2 reads."""

import json
from array import array
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Vector3, Wrench
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from actuated_characters.bags.definitions import read_definition
from actuated_characters.bags.reader import RecordedMessage, read_messages
from actuated_characters.bags.writer import BagWriter
from msgs_config.errors import RecordingError
from tests.support.limits import file_size_limit, unprivileged

QOS = QoSProfile(depth=5000)
LATCHED_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
FIRST_LOG_TIME_NS = 1_700_000_000_000_000_000
# It gives `char` a hash of its own, where ROS makes it uint8; all other types are right.
HASHED_WRONG_BY_ROSBAGS = ["std_msgs/msg/Char"]
CHUNK_SIZE = 2**20  # of rosbags, in bytes: one file has several as soon as it is larger


def sample_messages() -> dict[str, Any]:
    """One message a topic.

    Every float64[] has numbers in it: after an empty one `serialize_message` can leave garbage at
    the end, which what comes from a topic does not have.
    """
    joint_state = JointState(
        name=["right_knee", "chest_x"],
        position=array("d", [0.25, -1.5]),
        velocity=array("d", [3.0, 1e-300]),
        effort=array("d", [-150.0, 0.0]),
    )
    joint_state.header.stamp.sec = 7
    joint_state.header.stamp.nanosec = 4_166_666
    clock = Clock()
    clock.clock.nanosec = 8_333_333
    push = MultiDOFJointState(joint_names=["chest"], wrench=[Wrench(force=Vector3(x=240.0))])
    status = DiagnosticStatus(
        level=DiagnosticStatus.WARN,
        name="sim_node",
        values=[KeyValue(key="late commands", value="2")],
    )
    return {
        "/joint_states": joint_state,
        "/clock": clock,
        "/sim_node/configuration": String(data='{"character": "größer als 45 kg"}'),
        "/diagnostics": DiagnosticArray(status=[status]),
        "/external_wrench": push,
    }


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A closed recording of the sample messages, 1 ms apart."""
    path = tmp_path / "runs" / "walk.1"
    with BagWriter(path) as writer:
        for number, (topic, message) in enumerate(sample_messages().items()):
            writer.add_topic(topic, type(message), QOS)
            log_time_ns = FIRST_LOG_TIME_NS + number * 1_000_000
            writer.write(topic, serialize_message(message), log_time_ns)
    return path


def information(recording: Path) -> dict[str, Any]:
    metadata = yaml.safe_load((recording / "metadata.yaml").read_text())
    assert list(metadata) == ["rosbag2_bagfile_information"]
    return dict(metadata["rosbag2_bagfile_information"])


def topic_metadata(recording: Path) -> dict[str, dict[str, Any]]:
    topics = information(recording)["topics_with_message_count"]
    return {topic["topic_metadata"]["name"]: topic["topic_metadata"] for topic in topics}


def assert_sample_values(decoded: dict[str, Any]) -> None:
    """Compare what any reader made of the sample messages."""
    state = decoded["/joint_states"]
    assert (state.header.stamp.sec, state.header.stamp.nanosec) == (7, 4_166_666)
    assert list(state.name) == ["right_knee", "chest_x"]
    assert list(state.position) == [0.25, -1.5]
    assert list(state.velocity) == [3.0, 1e-300]
    assert list(state.effort) == [-150.0, 0.0]
    assert decoded["/clock"].clock.nanosec == 8_333_333
    assert decoded["/sim_node/configuration"].data == '{"character": "größer als 45 kg"}'
    (status,) = decoded["/diagnostics"].status
    assert (status.name, status.values[0].key, status.values[0].value) == (
        "sim_node",
        "late commands",
        "2",
    )
    push = decoded["/external_wrench"]
    assert list(push.joint_names) == ["chest"]
    assert push.wrench[0].force.x == 240.0
    assert len(push.transforms) == 0


# What other readers make of a recording


def test_an_independent_mcap_reader_decodes_every_message(recording: Path) -> None:
    decoded = {}
    with (recording / "walk.1.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, message, decoded_message in reader.iter_decoded_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
            assert message.log_time >= FIRST_LOG_TIME_NS
            decoded[channel.topic] = decoded_message
    assert_sample_values(decoded)


def test_rosbags_any_reader_decodes_every_message_and_confirms_the_type_hashes(
    recording: Path,
) -> None:
    with AnyReader([recording]) as reader:
        decoded = {
            connection.topic: reader.deserialize(raw, connection.msgtype)
            for connection, _, raw in reader.messages()
        }
    assert_sample_values(decoded)


def test_the_own_reader_gives_the_messages_of_ros(recording: Path) -> None:
    messages = list(read_messages(recording))

    assert {message.topic: message.decode() for message in messages} == sample_messages()
    assert messages[0].type_name == "sensor_msgs/msg/JointState"
    assert [message.log_time_ns - FIRST_LOG_TIME_NS for message in messages] == [
        number * 1_000_000 for number in range(5)
    ]


# The metadata


def test_the_metadata_has_every_field_of_rosbag2_version_9(recording: Path) -> None:
    found = information(recording)

    topics = found.pop("topics_with_message_count")
    assert found == {
        "version": 9,
        "storage_identifier": "mcap",
        "starting_time": {"nanoseconds_since_epoch": FIRST_LOG_TIME_NS},
        "duration": {"nanoseconds": 4_000_000},
        "message_count": 5,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": ["walk.1.mcap"],
        "files": [
            {
                "path": "walk.1.mcap",
                "starting_time": {"nanoseconds_since_epoch": FIRST_LOG_TIME_NS},
                "duration": {"nanoseconds": 4_000_000},
                "message_count": 5,
            }
        ],
        "custom_data": None,
        "ros_distro": "rosbags",
    }
    assert [topic["message_count"] for topic in topics] == [1] * 5
    for name, topic in topic_metadata(recording).items():
        message_type = type(sample_messages()[name])
        assert topic["type"] == read_definition(message_type).type_name
        assert topic["serialization_format"] == "cdr"
        assert set(topic) == {
            "name",
            "type",
            "serialization_format",
            "offered_qos_profiles",
            "type_description_hash",
        }


@pytest.mark.parametrize("qos", [QOS, LATCHED_QOS], ids=["volatile", "latched"])
def test_hash_and_qos_are_those_that_a_publisher_announces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, qos: QoSProfile
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/joint_states", JointState, qos)

    announced = announcement("/joint_states", JointState, qos)

    topic = topic_metadata(tmp_path / "bag")["/joint_states"]
    assert topic["type_description_hash"] == str(announced.topic_type_hash)
    (offered,) = topic["offered_qos_profiles"]
    seconds, nanoseconds = divmod(announced.qos_profile.deadline.nanoseconds, 10**9)
    infinite = {"sec": seconds, "nsec": nanoseconds}
    assert offered == {
        "history": "keep_last",
        "depth": qos.depth,
        "reliability": announced.qos_profile.reliability.name.lower(),
        "durability": announced.qos_profile.durability.name.lower(),
        "deadline": infinite,
        "lifespan": infinite,
        "liveliness": announced.qos_profile.liveliness.name.lower(),
        "liveliness_lease_duration": infinite,
        "avoid_ros_namespace_conventions": False,
    }


def announcement(topic: str, message_type: type, qos: QoSProfile) -> Any:
    """What discovery tells of a real publisher."""
    context = rclpy.Context()
    rclpy.init(context=context)
    try:
        node = rclpy.create_node("announcer", context=context)
        node.create_publisher(message_type, topic, qos)
        (endpoint,) = node.get_publishers_info_by_topic(topic)
        return endpoint
    finally:
        context.try_shutdown()


# Definitions


@pytest.mark.parametrize(
    "package",
    [
        "builtin_interfaces",
        "diagnostic_msgs",
        "geometry_msgs",
        "nav_msgs",
        "rosgraph_msgs",
        "sensor_msgs",
        "std_msgs",
        "trajectory_msgs",
        "visualization_msgs",
    ],
)
def test_the_definition_of_every_message_of_a_package_yields_its_type_hash(package: str) -> None:
    message_types = [
        value for value in vars(import_module(f"{package}.msg")).values() if isinstance(value, type)
    ]
    assert message_types
    for message_type in message_types:
        definition = read_definition(message_type)
        typestore = get_typestore(Stores.EMPTY)
        typestore.register(get_types_from_msg(definition.text, definition.type_name))
        confirmed = typestore.hash_rihs01(definition.type_name) == definition.type_hash
        assert confirmed == (definition.type_name not in HASHED_WRONG_BY_ROSBAGS)


def test_a_type_without_an_installed_definition_is_refused_by_name(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        with pytest.raises(RecordingError, match=r"message type std_srvs/srv/Trigger_Request: "):
            writer.add_topic("/trigger", Trigger.Request, QOS)
        with pytest.raises(RecordingError, match=r"message type int: share/int.json is not inst"):
            writer.add_topic("/number", int, QOS)

    assert list(read_messages(tmp_path / "bag")) == []


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A message package as colcon installs it: under a prefix of its own, others elsewhere."""
    prefix = tmp_path / "install" / "own_msgs"
    code = prefix / "lib" / "python3" / "site-packages"
    share = prefix / "share" / "own_msgs" / "msg"
    (code / "own_msgs").mkdir(parents=True)
    share.mkdir(parents=True)
    (share / "Sample.msg").write_text("std_msgs/String text")
    description = {
        "type_description_msg": {
            "referenced_type_descriptions": [{"type_name": "std_msgs/msg/String"}]
        },
        "type_hashes": [{"type_name": "own_msgs/msg/Sample", "hash_string": "RIHS01_0"}],
    }
    (share / "Sample.json").write_text(json.dumps(description))
    monkeypatch.syspath_prepend(code)
    return share


SAMPLE_TYPE = type("Sample", (), {"__module__": "own_msgs.msg._sample"})


def test_a_definition_is_found_in_a_workspace_and_its_parts_elsewhere(workspace: Path) -> None:
    definition = read_definition(SAMPLE_TYPE)

    own, string = definition.text.split("\n" + "=" * 80 + "\n")
    assert own == "std_msgs/String text"
    assert string.startswith("MSG: std_msgs/String\n")
    assert string.endswith("string data\n")
    assert definition.type_hash == "RIHS01_0"


def test_a_missing_part_of_a_definition_is_named(workspace: Path) -> None:
    (workspace / "Sample.msg").unlink()
    with pytest.raises(RecordingError, match=r"share/own_msgs/msg/Sample\.msg is not installed"):
        read_definition(SAMPLE_TYPE)


# Writing


def test_an_existing_path_is_not_overwritten(recording: Path) -> None:
    before = (recording / "metadata.yaml").read_bytes()
    with pytest.raises(RecordingError, match=r"walk\.1 exists already; remove it"):
        BagWriter(recording)
    assert (recording / "metadata.yaml").read_bytes() == before


def test_a_directory_that_cannot_be_made_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match=r"^cannot create recording .*bag: Not a directory$"):
        BagWriter(tmp_path / "file" / "bag")


def test_a_directory_without_permission_is_one_clear_error(tmp_path: Path) -> None:
    tmp_path.chmod(0o555)
    with (
        unprivileged(),
        pytest.raises(RecordingError, match=r"^cannot create recording .*bag: Permission denied$"),
    ):
        BagWriter(tmp_path / "bag")


def test_a_full_disk_is_a_clear_error_and_ends_the_recording(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag")
    writer.add_topic("/text", String, QOS)
    with file_size_limit(CHUNK_SIZE // 2):
        with pytest.raises(RecordingError, match=r"bag is incomplete, cannot write: File too lar"):
            writer.write("/text", bytes(CHUNK_SIZE), 1)
        with pytest.raises(RecordingError, match="closed"):
            writer.write("/text", b"", 2)
        writer.close()


def test_a_disk_that_is_full_at_the_end_is_a_clear_error(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag")
    writer.add_topic("/text", String, QOS)
    writer.write("/text", bytes(CHUNK_SIZE // 2), 1)
    with (
        file_size_limit(CHUNK_SIZE // 4),
        pytest.raises(RecordingError, match=r"bag is incomplete, cannot write: File too large"),
    ):
        writer.close()


def test_nothing_is_written_after_the_end_and_closing_again_does_nothing(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag")
    writer.add_topic("/text", String, QOS)
    writer.write("/text", b"1", 1)
    writer.close()
    metadata = information(tmp_path / "bag")

    writer.close()
    with pytest.raises(RecordingError, match="bag is closed"):
        writer.write("/text", b"2", 2)
    with pytest.raises(RecordingError, match="bag is closed"):
        writer.add_topic("/more", String, QOS)

    assert information(tmp_path / "bag") == metadata


def test_an_error_inside_the_block_still_leaves_a_complete_recording(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/text", String, QOS)
        writer.write("/text", b"1", 1)
        raise KeyboardInterrupt

    assert [message.raw for message in read_messages(tmp_path / "bag")] == [b"1"]


def test_a_topic_is_added_once_and_before_its_messages(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/text", String, QOS)
        with pytest.raises(RecordingError, match="has topic '/text' already"):
            writer.add_topic("/text", Clock, QOS)
        with pytest.raises(RecordingError, match=r"'/texts'; did you mean '/text'\? there"):
            writer.write("/texts", b"", 1)


@pytest.mark.parametrize("log_time_ns", [-1, 2**63])
def test_a_log_time_out_of_range_is_refused_and_harms_nothing(
    tmp_path: Path, log_time_ns: int
) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/text", String, QOS)
        with pytest.raises(RecordingError, match=f"log time {log_time_ns} ns is not within"):
            writer.write("/text", b"", log_time_ns)
        writer.write("/text", b"1", 2**63 - 1)

    assert [message.raw for message in read_messages(tmp_path / "bag")] == [b"1"]


# Reading


def test_only_the_chosen_topics_are_read(recording: Path) -> None:
    chosen = [message.topic for message in read_messages(recording, ["/diagnostics", "/clock"])]
    assert chosen == ["/clock", "/diagnostics"]
    assert list(read_messages(recording, [])) == []


def test_a_topic_that_was_not_recorded_is_an_error_that_names_those_that_were(
    recording: Path,
) -> None:
    with pytest.raises(RecordingError, match="unknown topic '/torques'; "):
        list(read_messages(recording, ["/torques"]))


def test_what_is_no_complete_recording_is_an_error_that_names_the_path(
    recording: Path, tmp_path: Path
) -> None:
    with pytest.raises(RecordingError, match=r"no complete recording at .*nowhere: "):
        list(read_messages(tmp_path / "nowhere"))
    with (recording / "walk.1.mcap").open("r+b") as file:
        file.truncate(1000)
    with pytest.raises(RecordingError, match=r"cannot read recording .*walk\.1"):
        list(read_messages(recording))
    (recording / "metadata.yaml").write_bytes(b"\xff")
    with pytest.raises(RecordingError, match=r"cannot read recording .*walk\.1"):
        list(read_messages(recording))
    (recording / "metadata.yaml").unlink()
    with pytest.raises(RecordingError, match=r"no complete recording at .*walk\.1: "):
        list(read_messages(recording))


def test_bytes_that_are_no_such_message_are_an_error_that_names_topic_and_time() -> None:
    message = RecordedMessage("/clock", 17, b"\x00\x01\x00\x00", "rosgraph_msgs/msg/Clock")
    with pytest.raises(RecordingError, match="'/clock' at 17 ns is no rosgraph_msgs/msg/Clock"):
        message.decode()


@pytest.mark.parametrize("type_name", ["nothing_msgs/msg/Clock", "rosgraph_msgs/msg/Nothing"])
def test_a_type_that_is_not_installed_is_named(type_name: str) -> None:
    with pytest.raises(RecordingError, match=f"message type {type_name} is not installed"):
        RecordedMessage("/clock", 17, b"", type_name).decode()


# Whatever is written comes back

log_times_ns = st.one_of(st.integers(0, 3), st.integers(0, 2**63 - 1))  # many of them equal
payloads = st.builds(  # large ones make several chunks
    lambda start, size: start + bytes(size), st.binary(), st.sampled_from([0, 0, CHUNK_SIZE // 2])
)


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(["/a", "/b", "/c"]), payloads, log_times_ns)))
def test_messages_come_back_by_time_and_those_of_equal_time_as_written(
    tmp_path_factory: pytest.TempPathFactory, written: list[tuple[str, bytes, int]]
) -> None:
    path = tmp_path_factory.mktemp("bags") / "bag"
    with BagWriter(path) as writer:
        for topic in ("/a", "/b", "/c"):
            writer.add_topic(topic, String, QOS)
        for message in written:
            writer.write(*message)

    read = [(message.topic, message.raw, message.log_time_ns) for message in read_messages(path)]

    assert read == sorted(written, key=lambda message: message[2])


doubles = st.lists(st.floats(allow_nan=False), min_size=1).map(lambda values: array("d", values))
stamps = st.tuples(st.integers(0, 2**31 - 1), st.integers(0, 10**9 - 1))


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]))),
    doubles,
    stamps,
)
def test_every_value_of_a_message_comes_back(
    tmp_path_factory: pytest.TempPathFactory,
    names: list[str],
    values: "array[float]",
    stamp: tuple[int, int],
) -> None:
    path = tmp_path_factory.mktemp("bags") / "bag"
    written = JointState(name=names, position=values, velocity=values, effort=values)
    written.header.stamp.sec, written.header.stamp.nanosec = stamp
    with BagWriter(path) as writer:
        writer.add_topic("/joint_states", JointState, QOS)
        writer.write("/joint_states", serialize_message(written), 1)

    (read,) = read_messages(path)

    assert read.decode() == written
