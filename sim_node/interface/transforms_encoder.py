"""`tf2_msgs/TFMessage` in its serialised form: only stamps and poses change."""

import struct
from collections.abc import Sequence

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.messages.cdr import CDR_LITTLE_ENDIAN, encode_text, padding, split_stamp

_POSE = 7  # doubles: translation, and rotation xyzw


class TransformsEncoder:
    """Serialises the poses of the same frames in their parents, all of one stamp."""

    def __init__(self, frames: Sequence[tuple[str, str]]) -> None:
        """`frames` are parents with their children."""
        content = bytearray(struct.pack("<I", len(frames)))
        stamps, poses = [], []
        for parent, child in frames:
            content += bytes(padding(len(content), 4))
            stamps.append(len(content) // 4)
            content += bytes(8) + encode_text(parent) + encode_text(child)
            content += bytes(padding(len(content), 8))
            poses.append(len(content) // 8)
            content += bytes(8 * _POSE)
        self._size = len(content)
        content += bytes(padding(len(content), 8))  # padding, where there are no frames
        self._words = np.frombuffer(content, dtype="<u4")
        self._doubles = self._words.view("<f8")
        self._stamps = np.array(stamps, dtype=np.intp)
        self._poses = np.add.outer(np.array(poses, dtype=np.intp), np.arange(_POSE))

    def encode(self, stamp_ns: int, poses: FloatArray) -> bytes:
        """The serialised message of poses (frames, 7): position in m, orientation xyzw."""
        self._words[self._stamps], self._words[self._stamps + 1] = split_stamp(stamp_ns)
        self._doubles[self._poses] = poses
        return CDR_LITTLE_ENDIAN + self._words.tobytes()[: self._size]
