"""What a bag sends in the simulator's place: its messages as they are, state by state."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory

from actuated_characters.bags.reader import read_messages
from actuated_characters.bags.recording import Recording, find_bag
from msgs_config.errors import RecordingError
from msgs_config.messages import topics
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.joint_state import JointStateDecoder, decode
from msgs_config.messages.topics import Topic

AROUND = (topics.CONTACTS, topics.APPLIED_WRENCH, topics.ODOM)
"""What the simulator publishes of a tick before its state, for who listens."""

_CONFIGURATION = topics.CONFIGURATION.of(topics.SIM_NODE)
STEERING = tuple(
    topic.of(topics.CONTROLLER_NODE) for topic in (topics.JOINT_TRAJECTORY, topics.STRENGTH)
)
"""What a controller is told while it works."""

_TAKEN = tuple(  # what it says of each that it took
    topic.of(topics.CONTROLLER_NODE) for topic in (topics.ACTIVE_TRAJECTORY, topics.ACTIVE_STRENGTH)
)

Steering: TypeAlias = "JointTrajectory | JointState"
_Published: TypeAlias = tuple[int, Steering]
"""When it was published, ns of wall time, and the message."""


@dataclass
class Stream:
    """The messages that come before a state, by its row in the recording."""

    configuration: bytes = b""  # the simulator's, before all states
    episodes: dict[int, bytes] = field(default_factory=dict)
    steering: dict[int, list[tuple[str, Steering]]] = field(default_factory=dict)  # topic, message

    @property
    def steered(self) -> set[str]:
        """The names of the topics of `STEERING` that there is anything for."""
        return {name for messages in self.steering.values() for name, _ in messages}


@dataclass
class RecordedTick:
    """What the simulator published at a tick, serialised."""

    around: list[tuple[str, bytes]]  # what came before the state, each with its topic's name
    state: bytes


def read_ticks(path: Path, recording: Recording) -> Iterator[RecordedTick]:
    """The ticks of a recording in order, each once.

    Raises:
        RecordingError: the bag cannot be read, or has become another one.
    """
    names = {_name(recording, topic): topic.name for topic in (*AROUND, topics.JOINT_STATES)}
    decoder, row, around = JointStateDecoder(), 0, list[tuple[str, bytes]]()
    for message in read_messages(find_bag(path)):
        if row == len(recording.stamps_ns):
            return
        name = names.get(message.topic)
        if name is None or _raw_stamp_ns(message.raw) < recording.stamps_ns[row]:
            continue  # another topic, or what was published again
        if name != topics.JOINT_STATES.name:
            around.append((name, message.raw))
        elif decoder.decode(message.raw).stamp_ns == recording.stamps_ns[row]:
            row += 1
            yield RecordedTick(around, message.raw)
            around = []
    if row < len(recording.stamps_ns):
        raise RecordingError(f"recording {path} has changed while it was read")


def _raw_stamp_ns(raw: bytes) -> int:
    """The stamp of a serialised message that begins with a header."""
    seconds, nanoseconds = struct.unpack_from("<iI" if raw[1] & 1 else ">iI", raw, 4)
    return int(seconds) * NANOSECONDS_PER_SECOND + int(nanoseconds)


def read_stream(path: Path, recording: Recording) -> Stream:
    """Read what goes with a recording's states.

    The trajectories and strengths are those that its controller took, each with the stamp that it
    began at; of an older bag, which does not say it, those that were sent.

    Raises:
        RecordingError: the bag cannot be read.
    """
    stream, kept = Stream(), dict[str, list[_Published]]()
    types = {_name(recording, topic): topic.message_type for topic in (*STEERING, *_TAKEN)}
    for message in read_messages(find_bag(path)):
        if message.topic == _name(recording, _CONFIGURATION):
            stream.configuration = message.raw
        elif message.topic == _name(recording, topics.EPISODE):
            row = int(np.searchsorted(recording.stamps_ns, _stamp_ns(message.decode())))
            stream.episodes[row] = message.raw
        elif message.topic in types:
            content = decode(message.raw, types[message.topic])
            kept.setdefault(message.topic, []).append((message.log_time_ns, content))
    for sent, taken in zip(STEERING, _TAKEN, strict=True):
        told = kept.get(_name(recording, taken)) or kept.get(_name(recording, sent), [])
        for published_ns, content in told:
            before = _row(recording, published_ns, _stamp_ns(content.header))
            if before is not None:
                stream.steering.setdefault(before, []).append((sent.name, content))
    return stream


def _row(recording: Recording, published_ns: int, start_ns: int) -> int | None:
    """The state before whose answer a message came; None if there is none.

    The controller published what it took before that answer, but two topics of a bag that another
    recorder has written may be out of order: it came before it began, too.
    """
    stamps = recording.stamps_ns
    answered = np.array([c[0].published_ns if c else 0 for c in recording.commands])
    later = np.flatnonzero(answered >= published_ns)
    row = int(later[0]) if len(later) else len(stamps)
    if start_ns:
        row = min(row, int(np.searchsorted(stamps, start_ns, side="right")) - 1)
    return row if 0 <= row < len(stamps) else None


def _name(recording: Recording, topic: Topic) -> str:
    """A topic's name in the bag."""
    return f"/{topic.under(recording.name).name}"


def _stamp_ns(header: Header) -> int:
    return int(header.stamp.sec) * NANOSECONDS_PER_SECOND + int(header.stamp.nanosec)
