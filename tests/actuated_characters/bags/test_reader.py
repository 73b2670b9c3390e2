"""Reading the chosen topics, clear errors for others, and definitions as ROS installs them."""

import json
from importlib import import_module
from pathlib import Path

import pytest
from rclpy.qos import QoSProfile
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from actuated_characters.bags.format.definitions import read_definition
from actuated_characters.bags.reader import RecordedMessage, read_messages
from actuated_characters.bags.writer import BagWriter
from msgs_config.bus.endpoint_types import type_name
from msgs_config.errors import RecordingError
from tests.support.foreign_bags import SENT

QOS = QoSProfile(depth=10)
# It gives `char` a hash of its own, where ROS makes it uint8; all other types are right.
HASHED_WRONG_BY_ROSBAGS = ["std_msgs/msg/Char"]


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    with BagWriter(tmp_path / "walk.1") as writer:
        for topic in ("/a", "/b", "/silent"):
            writer.add_topic(topic, "std_msgs/msg/String", QOS)
        for sent in SENT:
            writer.write(sent.topic, sent.cdr, sent.log_time_ns)
    return tmp_path / "walk.1"


def test_only_the_chosen_topics_are_read(recording: Path) -> None:
    chosen = [message.topic for message in read_messages(recording, ["/silent", "/b"])]
    assert chosen == ["/b"] * 10
    assert list(read_messages(recording, [])) == []


def test_a_topic_that_was_not_recorded_is_an_error_that_names_those_that_were(
    recording: Path,
) -> None:
    with pytest.raises(RecordingError, match=r"unknown topic '/torques'; .*: /a, /b, /silent"):
        list(read_messages(recording, ["/torques"]))


def test_what_is_no_complete_recording_is_an_error_that_names_the_path(
    recording: Path, tmp_path: Path
) -> None:
    with pytest.raises(RecordingError, match=r"no complete recording at .*nowhere: "):
        list(read_messages(tmp_path / "nowhere"))
    with (recording / "walk.1.mcap").open("r+b") as file:
        file.truncate(1000)
    cut_off = r"^cannot read recording .*walk\.1: walk.1.mcap: it is cut off, or was never closed; "
    with pytest.raises(
        RecordingError, match=f"{cut_off}'actuated_characters info .*walk.1 --recover'"
    ):
        list(read_messages(recording))
    (recording / "metadata.yaml").write_bytes(b"\xff")
    with pytest.raises(RecordingError, match=r"cannot read recording .*walk\.1: metadata.yaml is"):
        list(read_messages(recording))
    (recording / "metadata.yaml").unlink()
    with pytest.raises(RecordingError, match=r"no complete recording at .*walk\.1: .* makes one"):
        list(read_messages(recording))


@pytest.mark.parametrize(
    ("type_name", "sentence"),
    [
        ("rosgraph_msgs/msg/Clock", "message on '/clock' at 17 ns is no rosgraph_msgs/msg/Clock"),
        ("nothing_msgs/msg/Clock", "message type nothing_msgs/msg/Clock is not installed"),
        ("rosgraph_msgs/msg/Nothing", "message type rosgraph_msgs/msg/Nothing is not installed"),
    ],
)
def test_a_message_that_cannot_be_decoded_is_named(type_name: str, sentence: str) -> None:
    with pytest.raises(RecordingError, match=sentence):
        RecordedMessage("/clock", 17, b"\x00\x01\x00\x00", type_name).decode()


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
        definition = read_definition(type_name(message_type))
        typestore = get_typestore(Stores.EMPTY)
        typestore.register(get_types_from_msg(definition.text, definition.type_name))
        confirmed = typestore.hash_rihs01(definition.type_name) == definition.type_hash
        assert confirmed == (definition.type_name not in HASHED_WRONG_BY_ROSBAGS)


def test_a_type_without_an_installed_definition_is_refused_by_name(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        with pytest.raises(RecordingError, match=r"message type std_srvs/srv/Trigger_Request: "):
            writer.add_topic("/trigger", "std_srvs/srv/Trigger_Request", QOS)
        with pytest.raises(RecordingError, match=r"message type int: share/int.json is not inst"):
            writer.add_topic("/number", "int", QOS)

    assert list(read_messages(tmp_path / "bag")) == []


SAMPLE_TYPE = type("Sample", (), {"__module__": "own_msgs.msg._sample"})


def test_a_definition_is_found_in_a_workspace_and_its_parts_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Colcon installs a message package under a prefix of its own."""
    prefix = tmp_path / "install" / "own_msgs"
    code = prefix / "lib" / "python3" / "site-packages"
    share = prefix / "share" / "own_msgs" / "msg"
    (code / "own_msgs").mkdir(parents=True)
    share.mkdir(parents=True)
    (share / "Sample.msg").write_text("std_msgs/String text")
    parts = {"referenced_type_descriptions": [{"type_name": "std_msgs/msg/String"}]}
    hashes = [{"type_name": "own_msgs/msg/Sample", "hash_string": "RIHS01_0"}]
    description = {"type_description_msg": parts, "type_hashes": hashes}
    (share / "Sample.json").write_text(json.dumps(description))
    monkeypatch.syspath_prepend(code)

    definition = read_definition("own_msgs/msg/Sample")

    own, string = definition.text.split("\n" + "=" * 80 + "\n")
    assert own == "std_msgs/String text"
    assert string.startswith("MSG: std_msgs/String\n")
    assert string.endswith("string data\n")
    assert definition.type_hash == "RIHS01_0"
    (share / "Sample.msg").unlink()
    with pytest.raises(RecordingError, match=r"share/own_msgs/msg/Sample\.msg is not installed"):
        read_definition("own_msgs/msg/Sample")
