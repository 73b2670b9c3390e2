"""The message of a keyframe: all that a node goes on from, in the state of a stamp.

ROS has no message of stamped bytes but `sensor_msgs/CompressedImage`; its `format` says that these
are no picture.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from msgs_config.errors import MessageError, RecordingError
from msgs_config.messages import typed
from msgs_config.messages.session import read_session

TYPE_NAME = "sensor_msgs/msg/CompressedImage"
_FORMAT = "keyframe of a node"


class Keyframe(NamedTuple):
    """The memory of a node in a state, before what follows from that."""

    stamp_ns: int
    session: str
    memory: bytes  # as `MemoryFormat` writes it


def encode_keyframe(keyframe: Keyframe) -> bytes:
    """The serialised message."""
    message = typed.stamped(TYPE_NAME, keyframe.stamp_ns, keyframe.session, format=_FORMAT)
    message.data = np.frombuffer(keyframe.memory, np.uint8)
    return typed.encode(message)


def decode_keyframe(raw: bytes) -> Keyframe:
    """The keyframe of a serialised message, such as a file of one is.

    Raises:
        MessageError: it is no keyframe.
    """
    message = typed.decode(raw, TYPE_NAME)
    if message.format != _FORMAT:
        raise MessageError(f"a picture of format {message.format!r:.60}, no keyframe")
    session = read_session(message.header.frame_id)
    return Keyframe(typed.stamp_of(message), session, message.data.tobytes())


def read_keyframe(path: str) -> Keyframe:
    """The keyframe in a file, which is a serialised message.

    Raises:
        ActuatedCharactersError: there is no such file, or it is no keyframe.
    """
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise RecordingError(f"keyframe {path} cannot be read: {error.strerror}") from error
    return decode_keyframe(raw)


def write_keyframe(directory: Path, node: str, raw: bytes | None) -> str:
    """Write a node's keyframe; the file's path, as a parameter, empty where there is none."""
    if raw is None:
        return ""
    file = directory / f"{node}.keyframe"
    file.write_bytes(raw)
    return str(file)
