"""Bags with something changed in them: other messages, or one bit of a number."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from actuated_characters.bags.reader import RecordedMessage, read_messages
from actuated_characters.bags.writer import BagWriter
from msgs_config.arrays import FloatArray
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointArrays, JointStateDecoder, JointStateEncoder
from msgs_config.messages.topic import Topic
from tests.support.physics import character

_TYPES = {
    topic.name.rpartition("/")[2]: topic
    for topic in vars(topics).values()
    if isinstance(topic, Topic)
}
_TYPES |= {
    sensor.name: topics.sensor_reading(sensor.type, sensor.topic)
    for sensor in character("humanoid").sensors
}


def rewrite(
    bag: Path,
    target: Path,
    change: Callable[[RecordedMessage], bytes | None],
    rename: Callable[[str], str] = str,
) -> Path:
    """Copy a bag's messages as `change` makes them, without those of which it makes None."""
    with BagWriter(target) as writer:
        added = set[str]()
        for message in read_messages(bag):
            raw = change(message)
            if raw is None:
                continue
            name = rename(message.topic)
            if name not in added:
                topic = _TYPES[name.rpartition("/")[2]]
                writer.add_topic(name, topic.type_name, topic.quality)
                added.add(name)
            writer.write(name, raw, message.log_time_ns)
    return target


def flipped(values: FloatArray, index: int, bit: int) -> FloatArray:
    """A copy of some doubles with one bit of one of them flipped; bit 0 is the lowest."""
    bits = values.copy().view(np.uint64)
    bits[index] ^= np.uint64(1) << np.uint64(bit)
    return bits.view(float)


def with_flipped_effort(
    bag: Path, target: Path, *, topic: str, stamp_ns: int, name: str, bit: int
) -> Path:
    """Copy a bag with one bit of one effort flipped, in the first message of that stamp."""
    decoder, done = JointStateDecoder(), False

    def change(message: RecordedMessage) -> bytes:
        nonlocal done
        if message.topic.strip("/") != topic or done:
            return message.raw
        content = decoder.decode(message.raw)
        if content.stamp_ns != stamp_ns:
            return message.raw
        done = True
        effort = flipped(content.effort, content.names.index(name), bit)
        return encoded(content._replace(effort=effort))

    rewrite(bag, target, change)
    assert done
    return target


def encoded(content: JointArrays) -> bytes:
    """A JointState, serialised."""
    encoder = JointStateEncoder(content.names)
    return encoder.encode(content.stamp_ns, content.position, content.velocity, content.effort)
