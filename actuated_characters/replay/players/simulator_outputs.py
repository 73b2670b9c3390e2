"""What a bag sends in the simulator's place: its messages, in another session."""

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from actuated_characters.bags.reader import read_messages, read_topics
from actuated_characters.bags.recording import Recording, find_bag, read_recording
from msgs_config.arrays import IntArray
from msgs_config.errors import RecordingError
from msgs_config.messages import topics, typed
from msgs_config.messages.cdr import (
    JOINT_STATE,
    decode_header,
    decode_string,
    encode_header,
    encode_string,
)
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.configuration import SINCE
from msgs_config.messages.joint_state import JointStateDecoder, JointStateEncoder
from msgs_config.messages.session import episode_text
from msgs_config.messages.topic import Kept, SessionPlace, Topic

REQUESTS = tuple(topic.of(topics.CONTROLLER_NODE) for topic in topics.TABLE if topic.accepted_on)
"""What a controller is asked for while it works."""

_ACCEPTED = tuple(  # what the controller publishes of each request that it has accepted
    topic.of(topics.CONTROLLER_NODE)
    for request in REQUESTS
    for topic in topics.TABLE
    if topic.name == request.accepted_on
)
_CONFIGURATION = topics.CONFIGURATION.of(topics.SIM_NODE)
_OF_SIMULATOR = (_CONFIGURATION, topics.EPISODE)


@dataclass
class RareMessages:
    """The messages that are not of each tick, by the row of the state that they come before."""

    configurations: dict[int, bytes] = field(default_factory=dict)  # the simulator's
    episodes: dict[int, bytes] = field(default_factory=dict)
    requests: dict[int, list[tuple[str, bytes]]] = field(default_factory=dict)  # topic, message

    @property
    def requested(self) -> set[str]:
        """The names of the topics of `REQUESTS` that have messages."""
        return {name for messages in self.requests.values() for name, _ in messages}


class SessionRewriter:
    """Names a session in serialised messages; their numbers stay the same to the bit."""

    def __init__(self, session: str) -> None:
        self._session = session
        self._decoder = JointStateDecoder()
        self._encoder = lru_cache(maxsize=16)(lambda names: JointStateEncoder(names, session))

    def rewrite(self, topic: Topic, raw: bytes) -> bytes:
        """A message on a topic; one of a topic that names no session stays as it is.

        Raises:
            MessageError: the bytes are no message of the topic.
        """
        match topic.session:
            case SessionPlace.NOWHERE:
                return raw
            case SessionPlace.EPISODE:
                stamp_ns, frame_id = decode_header(raw)
                number = frame_id.partition(" ")[0]  # of older bags it is all that is there
                text = episode_text(int(number) if number.isdecimal() else 1, self._session)
                return encode_header(stamp_ns, text)
            case SessionPlace.CONFIGURATION:
                content = {**json.loads(decode_string(raw)), "session": self._session}
                return encode_string(json.dumps(content, allow_nan=False))
        if topic.type_name == JOINT_STATE:  # one a tick, whose names are always the same
            state = self._decoder.decode(raw)
            arrays = (state.position, state.velocity, state.effort)
            return self._encoder(state.names).encode(state.stamp_ns, *arrays)
        message = typed.decode(raw, topic.type_name)
        message.header.frame_id = self._session
        return typed.encode(message)


def tick_topics(recording: Recording) -> list[Topic]:
    """What the simulator publishes at each tick; its state is the last."""
    sensors = recording.character.sensors
    readings = [topics.sensor_reading(each.type, each.topic) for each in sensors]
    of_all = [each for each in topics.TABLE if each.is_of_tick and each.kept is not Kept.IF_NAMED]
    return [*readings, *reversed(of_all)]


def read_ticks(path: Path, recording: Recording) -> Iterator[list[tuple[Topic, bytes]]]:
    """The messages of each tick of a recording in order, each tick once, its state at the end.

    Raises:
        RecordingError: the bag cannot be read, or has become another one.
    """
    found = {_name(recording, topic): topic for topic in tick_topics(recording)}
    decoder, row, messages = JointStateDecoder(), 0, list[tuple[Topic, bytes]]()
    for message in read_messages(find_bag(path)):
        if row == len(recording.stamps_ns):
            return
        topic = found.get(message.topic)
        if topic is None or _raw_stamp_ns(message.raw) < recording.stamps_ns[row]:
            continue  # another topic, or what was published again
        if topic is not topics.JOINT_STATES:
            messages.append((topic, message.raw))
        elif decoder.decode(message.raw).stamp_ns == recording.stamps_ns[row]:
            row += 1
            yield [*messages, (topic, message.raw)]
            messages = []
    if row < len(recording.stamps_ns):
        raise RecordingError(f"recording {path} has changed while it was read")


def opponent_of(recording: Recording) -> str:
    """The name of the recording of a character's opponent, which its controller listens to."""
    given = recording.controller[0].parameters if recording.controller else {}
    opponent, world = str(given.get("opponent", "")), recording.name.rpartition("/")[0]
    return f"{world}/{opponent}".lstrip("/") if opponent else ""


def read_opponent(path: Path, recording: Recording) -> Iterator[bytes]:
    """The opponent's states of the ticks of a recording, in order.

    Raises:
        RecordingError: as `read_ticks`; or the opponent is not in the bag.
    """
    first_ns = recording.stamps_ns[0]
    for messages in read_ticks(path, read_recording(path, opponent_of(recording))):
        _, state = messages[-1]
        if _raw_stamp_ns(state) >= first_ns:
            yield state


def _raw_stamp_ns(raw: bytes) -> int:
    """The stamp of a serialised message that begins with a header."""
    seconds, nanoseconds = struct.unpack_from("<iI" if raw[1] & 1 else ">iI", raw, 4)
    return int(seconds) * NANOSECONDS_PER_SECOND + int(nanoseconds)


def read_rare_messages(path: Path, recording: Recording) -> RareMessages:
    """Read the messages of a recording that are not of each tick.

    The trajectories, velocities and strengths are those that its controller accepted, each with the
    stamp that it began at; of an older bag, which does not have these, those that were sent.

    Raises:
        RecordingError: the bag cannot be read.
    """
    rare, by_topic = RareMessages(), dict[str, list[tuple[int, bytes]]]()
    types = {_name(recording, topic): topic.type_name for topic in (*REQUESTS, *_ACCEPTED)}
    bag, names = find_bag(path), {*types, *(_name(recording, each) for each in _OF_SIMULATOR)}
    for message in read_messages(bag, names & read_topics(bag).keys()):
        if message.topic == _name(recording, _CONFIGURATION):
            since_ns = json.loads(decode_string(message.raw)).get(SINCE)
            row = 0 if since_ns is None else np.searchsorted(recording.stamps_ns, since_ns, "right")
            rare.configurations[int(row)] = message.raw
        elif message.topic == _name(recording, topics.EPISODE):
            stamp_ns = _raw_stamp_ns(message.raw)
            rare.episodes[int(np.searchsorted(recording.stamps_ns, stamp_ns))] = message.raw
        elif message.topic in types:
            typed.decode(
                message.raw, types[message.topic]
            )  # what is none of its type is not sent again
            by_topic.setdefault(message.topic, []).append((message.sent_ns, message.raw))
    answered = np.maximum.accumulate(
        [commands[0].published_ns if commands else 0 for commands in recording.commands]
    )
    for topic, active in zip(REQUESTS, _ACCEPTED, strict=True):
        sent = by_topic.get(_name(recording, active)) or by_topic.get(_name(recording, topic), [])
        for published_ns, raw in sent:
            row = _row(recording.stamps_ns, answered, published_ns, _raw_stamp_ns(raw))
            # a keyframe has what was accepted up to its answer
            if row is not None and (row or recording.keyframe is None):
                rare.requests.setdefault(row, []).append((topic.name, raw))
    return rare


def _row(stamps: IntArray, answered: IntArray, published_ns: int, start_ns: int) -> int | None:
    """The row of the state before whose answer a message came; None if there is none.

    `answered` (t + 1,) are the times, ns, by which the states of the `stamps` were answered.
    The controller published what it accepted before that answer, but two topics of a bag that
    another recorder has written may be out of order: it came before it began, too.
    """
    row = int(np.searchsorted(answered, published_ns))
    if start_ns:
        row = min(row, int(np.searchsorted(stamps, start_ns, side="right")) - 1)
    return row if 0 <= row < len(stamps) else None


def _name(recording: Recording, topic: Topic) -> str:
    """A topic's name in the bag."""
    return f"/{topic.under(recording.name).name}"
