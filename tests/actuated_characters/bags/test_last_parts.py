"""A bag that keeps the last part alone: what is in it, who can read it, and what cannot be done."""

from itertools import zip_longest
from pathlib import Path

import pytest
import yaml
from rosbags.highlevel import AnyReader

from actuated_characters.bags.format.metadata import EARLIER_BAG
from actuated_characters.bags.last_parts import LastPartsWriter
from actuated_characters.bags.reader import read_messages
from actuated_characters.bags.recording import read_recording
from actuated_characters.render.scene import make_scene
from actuated_characters.replay.replay import replay
from msgs_config.errors import RecordingError
from tests.support.bags import (
    Made,
    RawMessage,
    make_run,
    raw_configuration,
    raw_references,
    raw_states,
)

PART = 30_000  # bytes of messages
START_NS = 1_700_000_000 * 10**9


@pytest.fixture(scope="module")
def made() -> Made:
    return make_run("pendulum", 4.0)


def in_time(made: Made) -> list[RawMessage]:
    """What a recorder hears of a run, one state after another with its reference."""
    states = raw_states(made.plan, made.states)
    references = [tick.reference for tick in made.ticks]
    desired = raw_references(made.plan, [each for each in references if each is not None])
    pairs = zip_longest(states, desired)
    return [raw_configuration(made.plan), *(each for pair in pairs for each in pair if each)]


def write(path: Path, messages: list[RawMessage], part_bytes: int) -> LastPartsWriter:
    bag = LastPartsWriter(path, part_bytes)
    for topic in {topic.name: topic for topic, _ in messages}.values():
        bag.add_topic(f"/{topic.name}", topic.type_name, topic.quality)
    for number, (topic, raw) in enumerate(messages):
        bag.write(f"/{topic.name}", raw, START_NS + number)
    return bag


def test_a_short_recording_is_kept_whole_and_repeated(made: Made, tmp_path: Path) -> None:
    write(tmp_path / "bag", in_time(made), 10 * PART**2).close()

    recording = read_recording(tmp_path / "bag")

    assert len(recording.stamps_ns) == len(made.states)
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_of_a_long_one_the_last_states_are_kept_to_the_bit(made: Made, tmp_path: Path) -> None:
    messages = in_time(made)
    total = sum(len(raw) for _, raw in messages)
    write(tmp_path / "bag", messages, PART).close()

    files = sorted(path.name for path in (tmp_path / "bag").iterdir())
    messages = list(read_messages(tmp_path / "bag"))
    recording = read_recording(tmp_path / "bag")

    assert total > 4 * PART
    assert files == ["bag-earlier.mcap", "bag.mcap", "metadata.yaml"]
    assert PART < sum(len(each.raw) for each in messages) < 2.2 * PART
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]
    states = made.states[-len(recording.stamps_ns) :]
    assert 200 < len(states) < len(made.states)
    assert recording.begins_amid
    assert recording.stamps_ns.tolist() == [state.stamp_ns for state in states]
    for row, state in enumerate(states):
        assert recording.position[row].tobytes() == state.position.tobytes()
        if row:
            assert state.effort is not None
            assert recording.effort[row - 1].tobytes() == state.effort.tobytes()


def test_it_can_be_shown_and_says_that_it_cannot_be_repeated(made: Made, tmp_path: Path) -> None:
    write(tmp_path / "bag", in_time(made), PART).close()
    recording = read_recording(tmp_path / "bag")

    assert len(make_scene((recording,)).times) == len(recording.stamps_ns)
    with pytest.raises(RecordingError, match=r"middle of an episode.*viewed, not repeated") as told:
        replay((recording,))
    assert "\n" not in str(told.value)


def test_its_metadata_is_that_of_all_its_files(made: Made, tmp_path: Path) -> None:
    """As an independent reader has it, and by rosbag2's fields."""
    write(tmp_path / "bag", in_time(made), PART).close()
    text = (tmp_path / "bag" / "metadata.yaml").read_text()
    found = yaml.safe_load(text)["rosbag2_bagfile_information"]
    messages = list(read_messages(tmp_path / "bag"))

    with AnyReader([tmp_path / "bag"]) as reader:
        times = [time for _, time, _ in reader.messages()]
        assert len(times) == reader.message_count == found["message_count"] == len(messages)
        assert (reader.start_time, reader.end_time) == (times[0], times[-1] + 1)
    assert found["relative_file_paths"] == ["bag-earlier.mcap", "bag.mcap"]
    counts = [each["message_count"] for each in found["topics_with_message_count"]]
    assert sum(counts) == sum(each["message_count"] for each in found["files"]) == len(messages)
    assert found["starting_time"]["nanoseconds_since_epoch"] == times[0]
    assert found["duration"]["nanoseconds"] == times[-1] - times[0]


def test_after_a_kill_the_part_before_is_a_bag_of_its_own(made: Made, tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", in_time(made), PART)
    bag.flush()  # and nothing more: its process was killed

    assert read_recording(tmp_path / EARLIER_BAG).begins_amid
