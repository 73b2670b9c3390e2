"""Recordings that are written: independent readers read them back whole."""

import os
from array import array
from collections.abc import Callable
from contextlib import suppress
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
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import String

from actuated_characters.bags.format.definitions import read_definition
from actuated_characters.bags.reader import read_messages
from actuated_characters.bags.writer import BagWriter
from msgs_config.bus.endpoint_types import type_name
from msgs_config.errors import ConfigurationError, RecordingError
from tests.support.foreign_bags import TextMessage
from tests.support.limits import file_size_limit, unprivileged

QOS = QoSProfile(depth=5000)
LATCHED_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
FIRST_LOG_TIME_NS = 1_700_000_000_000_000_000
CHUNK_SIZE = 2**20  # of rosbags, in bytes: one file has several as soon as it is larger
EACH_KIND = pytest.mark.parametrize("compression", ["none", "zstd"])
HELLO = TextMessage("/text", 0, "hello").cdr


def sample_messages() -> dict[str, Any]:
    """One message a topic.

    Every float64[] has numbers in it: after an empty one `serialize_message` can leave garbage at
    the end, which messages from a topic do not have.
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


def write_samples(path: Path, **options: str) -> Path:
    """A closed recording of the sample messages, 1 ms apart."""
    with BagWriter(path, **options) as writer:
        for number, (topic, message) in enumerate(sample_messages().items()):
            writer.add_topic(topic, type_name(type(message)), QOS)
            log_time_ns = FIRST_LOG_TIME_NS + number * 1_000_000
            writer.write(topic, serialize_message(message), log_time_ns)
    return path


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return write_samples(tmp_path / "runs" / "walk.1")


def write(path: Path, count: int, **options: str) -> BagWriter:
    """A recording of `count` messages that is still open."""
    writer = BagWriter(path, **options)
    writer.add_topic("/text", "std_msgs/msg/String", QOS)
    for number in range(count):
        writer.write("/text", HELLO, number)
    return writer


def information(recording: Path) -> dict[str, Any]:
    metadata = yaml.safe_load((recording / "metadata.yaml").read_text())
    assert list(metadata) == ["rosbag2_bagfile_information"]
    return dict(metadata["rosbag2_bagfile_information"])


def topic_metadata(recording: Path) -> dict[str, dict[str, Any]]:
    topics = information(recording)["topics_with_message_count"]
    return {topic["topic_metadata"]["name"]: topic["topic_metadata"] for topic in topics}


def assert_sample_values(decoded: dict[str, Any]) -> None:
    """Compare the sample messages as any reader decodes them."""
    state = decoded["/joint_states"]
    assert (state.header.stamp.sec, state.header.stamp.nanosec) == (7, 4_166_666)
    assert list(state.name) == ["right_knee", "chest_x"]
    assert list(state.position) == [0.25, -1.5]
    assert list(state.velocity) == [3.0, 1e-300]
    assert list(state.effort) == [-150.0, 0.0]
    assert decoded["/clock"].clock.nanosec == 8_333_333
    assert decoded["/sim_node/configuration"].data == '{"character": "größer als 45 kg"}'
    (status,) = decoded["/diagnostics"].status
    assert (status.name, status.values[0].key) == ("sim_node", "late commands")
    assert status.values[0].value == "2"
    push = decoded["/external_wrench"]
    assert list(push.joint_names) == ["chest"]
    assert push.wrench[0].force.x == 240.0
    assert len(push.transforms) == 0


# What readers make of a recording


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


@EACH_KIND
def test_rosbags_and_the_own_reader_decode_every_message_of_every_kind(
    tmp_path: Path, compression: str
) -> None:
    bag = write_samples(tmp_path / "bag", compression=compression)

    with AnyReader([bag]) as reader:  # it confirms the type hashes, too
        by_rosbags = {
            connection.topic: reader.deserialize(raw, connection.msgtype)
            for connection, _, raw in reader.messages()
        }
    own = list(read_messages(bag))

    assert_sample_values(by_rosbags)
    assert {message.topic: message.decode() for message in own} == sample_messages()
    assert own[0].type_name == "sensor_msgs/msg/JointState"
    times = [message.log_time_ns - FIRST_LOG_TIME_NS for message in own]
    assert times == [number * 1_000_000 for number in range(5)]
    found = information(bag)
    assert found["version"] == 9
    assert found["storage_identifier"] == "mcap"
    assert found["compression_mode"] == found["compression_format"] == ""  # the chunks say it
    assert found["relative_file_paths"] == ["bag.mcap"]


def test_compressed_chunks_are_zstd_to_an_independent_reader(tmp_path: Path) -> None:
    write(tmp_path / "bag", 10, compression="zstd").close()

    with (tmp_path / "bag" / "bag.mcap").open("rb") as file:
        records = list(StreamReader(file, emit_chunks=True).records)
        file.seek(0)
        raw = [message.data for _, _, message in make_reader(file).iter_messages()]

    assert {r.compression for r in records if isinstance(r, Chunk)} == {"zstd"}
    assert raw == [HELLO] * 10


# The metadata


def test_the_metadata_has_every_field_of_rosbag2_version_9(recording: Path) -> None:
    found = information(recording)

    topics = found.pop("topics_with_message_count")
    span = {
        "starting_time": {"nanoseconds_since_epoch": FIRST_LOG_TIME_NS},
        "duration": {"nanoseconds": 4_000_000},
        "message_count": 5,
    }
    assert found == {
        "version": 9,
        "storage_identifier": "mcap",
        **span,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": ["walk.1.mcap"],
        "files": [{"path": "walk.1.mcap", **span}],
        "custom_data": None,
        "ros_distro": "jazzy",
    }
    assert [topic["message_count"] for topic in topics] == [1] * 5
    for name, topic in topic_metadata(recording).items():
        message_type = type(sample_messages()[name])
        assert topic["type"] == read_definition(type_name(message_type)).type_name
        assert topic["serialization_format"] == "cdr"
        more = {"offered_qos_profiles", "type_description_hash"}
        assert set(topic) == {"name", "type", "serialization_format"} | more


@pytest.mark.parametrize("qos", [QOS, LATCHED_QOS], ids=["volatile", "latched"])
def test_hash_and_qos_are_those_that_a_publisher_announces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, qos: QoSProfile
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/joint_states", "sensor_msgs/msg/JointState", qos)

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
    """A real publisher as discovery tells it."""
    context = rclpy.Context()
    rclpy.init(context=context)
    try:
        node = rclpy.create_node("announcer", context=context)
        node.create_publisher(message_type, topic, qos)
        (endpoint,) = node.get_publishers_info_by_topic(topic)
        return endpoint
    finally:
        context.try_shutdown()


# Wrong uses


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"log_time": "sun"}, "unknown log time 'sun'; there are: wall, simulated"),
        ({"compression": "lz4"}, "unknown compression 'lz4'; there are: none, zstd"),
    ],
)
def test_a_wrong_choice_names_the_right_ones_and_leaves_nothing(
    tmp_path: Path, options: dict[str, str], sentence: str
) -> None:
    with pytest.raises(ConfigurationError, match=sentence):
        BagWriter(tmp_path / "bag", **options)
    assert not list(tmp_path.iterdir())


def test_a_directory_that_cannot_be_made_is_one_clear_error(tmp_path: Path) -> None:
    bag = write_samples(tmp_path / "bag")
    before = (bag / "metadata.yaml").read_bytes()
    with pytest.raises(RecordingError, match="bag exists already; remove it or choose another"):
        BagWriter(bag)
    assert (bag / "metadata.yaml").read_bytes() == before

    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match=r"^cannot create recording .*bag: Not a directory$"):
        BagWriter(tmp_path / "file" / "bag")

    tmp_path.chmod(0o555)
    with (
        unprivileged(),
        pytest.raises(RecordingError, match=r"^cannot create recording .*more: Permission denied$"),
    ):
        BagWriter(tmp_path / "more")


def test_a_topic_is_added_once_and_before_its_messages(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/text", "std_msgs/msg/String", QOS)
        with pytest.raises(RecordingError, match="has topic '/text' already"):
            writer.add_topic("/text", "std_msgs/msg/String", QOS)
        with pytest.raises(RecordingError, match=r"'/texts'; did you mean '/text'\? there"):
            writer.write("/texts", b"", 1)


@pytest.mark.parametrize("log_time_ns", [-1, 2**63])
def test_a_log_time_out_of_range_is_refused_and_harms_nothing(
    tmp_path: Path, log_time_ns: int
) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/text", "std_msgs/msg/String", QOS)
        with pytest.raises(RecordingError, match=f"log time {log_time_ns} ns is not within"):
            writer.write("/text", b"", log_time_ns)
        writer.write("/text", b"1", 2**63 - 1)

    assert [message.raw for message in read_messages(tmp_path / "bag")] == [b"1"]


# The end


def test_nothing_is_written_after_the_end_and_closing_again_does_nothing(tmp_path: Path) -> None:
    writer = write(tmp_path / "bag", 1)
    writer.close()
    metadata = information(tmp_path / "bag")

    writer.close()
    late: list[Callable[[], None]] = [
        lambda: writer.write("/text", b"2", 2),
        lambda: writer.add_topic("/more", "std_msgs/msg/String", QOS),
        writer.flush,
    ]
    for act in late:
        with pytest.raises(RecordingError, match="bag is closed"):
            act()

    assert information(tmp_path / "bag") == metadata


def test_an_error_inside_the_block_still_leaves_a_complete_recording(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/text", "std_msgs/msg/String", QOS)
        writer.write("/text", b"1", 1)
        raise KeyboardInterrupt

    assert [message.raw for message in read_messages(tmp_path / "bag")] == [b"1"]


# Full disks


def test_a_full_disk_at_a_write_is_a_clear_error_and_ends_the_recording(tmp_path: Path) -> None:
    writer = write(tmp_path / "bag", 0)
    with file_size_limit(CHUNK_SIZE // 2):
        with pytest.raises(RecordingError, match=r"bag is incomplete, cannot write: File too lar"):
            writer.write("/text", bytes(CHUNK_SIZE), 1)
        with pytest.raises(RecordingError, match="closed"):
            writer.write("/text", b"", 2)
        writer.close()


@EACH_KIND
def test_a_full_disk_at_a_flush_is_one_clear_error_and_ends_the_recording(
    tmp_path: Path, compression: str
) -> None:
    writer = write(tmp_path / "bag", 0, compression=compression)
    writer.flush()
    with file_size_limit(60_000):
        for number in range(100):
            writer.write("/text", os.urandom(2000), number)
        with pytest.raises(RecordingError, match=r"^recording .* is incomplete, cannot write: \w"):
            writer.flush()
        with pytest.raises(RecordingError, match="bag is closed"):
            writer.write("/text", HELLO, 2)
        writer.close()


def test_a_disk_that_is_full_at_the_end_is_one_clear_error(tmp_path: Path) -> None:
    writer = write(tmp_path / "bag", 0)
    writer.flush()
    writer.write("/text", bytes(100_000), 1)
    with file_size_limit(60_000), pytest.raises(RecordingError, match="incomplete, cannot write"):
        writer.close()


def test_a_disk_that_is_full_at_the_start_leaves_nothing_behind(tmp_path: Path) -> None:
    with (
        file_size_limit(10),
        pytest.raises(RecordingError, match=r"^cannot create recording .*bag: \w"),
    ):
        BagWriter(tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


# Flushing


def chunks_of(file: Path) -> list[Chunk]:
    """The chunks of a file that is not closed yet."""
    chunks = []
    with file.open("rb") as stream, suppress(Exception):  # it has many names for the file's end
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Chunk):
                chunks.append(record)
    return chunks


def test_what_was_flushed_is_in_the_mcap_file_once_and_nothing_was_before(tmp_path: Path) -> None:
    writer = write(tmp_path / "bag", 3)
    file = tmp_path / "bag" / "bag.mcap"
    assert not chunks_of(file)

    for _ in range(5):  # without a new message another flush makes no chunk
        writer.flush()

    (chunk,) = chunks_of(file)
    assert chunk.data.count(HELLO) == 3
    writer.close()


@EACH_KIND
def test_messages_after_a_flush_are_in_the_recording_as_well(
    tmp_path: Path, compression: str
) -> None:
    writer = BagWriter(tmp_path / "bag", compression=compression)
    writer.flush()
    for number, topic in enumerate(("/a", "/b")):
        writer.add_topic(topic, "std_msgs/msg/String", QOS)
        writer.flush()
        writer.write(topic, HELLO, number)
        writer.flush()
    writer.write("/a", HELLO, 2)
    writer.close()

    assert [message.topic for message in read_messages(tmp_path / "bag")] == ["/a", "/b", "/a"]


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
            writer.add_topic(topic, "std_msgs/msg/String", QOS)
        for message in written:
            writer.write(*message)

    read = [(message.topic, message.raw, message.log_time_ns) for message in read_messages(path)]

    assert read == sorted(written, key=lambda message: message[2])
