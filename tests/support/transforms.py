"""`/tf` and `/tf_static` in tests: a stand-in for `tf2_msgs`, and an independent reader."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.node import Node
from rosbags.typesys import Stores, get_typestore

from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations
from msgs_config.messages.topic import CHANGES, STREAM

TF2 = Path(__file__).parent / "tf2"
"""A folder for `PYTHONPATH` with a package `tf2_msgs`."""

_TYPES = get_typestore(Stores.ROS2_JAZZY)


def environment_with_tf2() -> dict[str, str]:
    """The environment of a process that can import `tf2_msgs`."""
    paths = (str(TF2), os.environ.get("PYTHONPATH", ""))
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}


class Frames:
    """All frames that a node hears of, by the child's name."""

    def __init__(self, node: Node) -> None:
        """Subscribe; `TF2` must be among the paths of Python."""
        from tf2_msgs.msg import TFMessage

        self.static: dict[str, Any] = {}
        self.moving: dict[int, dict[str, Any]] = {}  # by stamp, ns
        self.parents: dict[str, set[str]] = {}
        node.create_subscription(TFMessage, "/tf", self._take, STREAM.profile, raw=True)
        node.create_subscription(
            TFMessage, "/tf_static", self._take_static, CHANGES.profile, raw=True
        )

    def _take(self, raw: bytes) -> None:
        for each in self._decode(raw):
            stamp = each.header.stamp.sec * 10**9 + each.header.stamp.nanosec
            self.moving.setdefault(stamp, {})[each.child_frame_id] = each

    def _take_static(self, raw: bytes) -> None:
        for each in self._decode(raw):
            self.static[each.child_frame_id] = each

    def _decode(self, raw: bytes) -> list[Any]:
        found = list(_TYPES.deserialize_cdr(raw, "tf2_msgs/msg/TFMessage").transforms)
        for each in found:
            self.parents.setdefault(each.child_frame_id, set()).add(each.header.frame_id)
        return found

    def in_frame(self, name: str, root: str, stamp: int) -> FloatArray:
        """Homogeneous matrix (4, 4) of a frame in another above it."""
        matrix = np.eye(4)
        while name != root:
            each = (self.static | self.moving[stamp])[name]
            matrix = _matrix(each.transform) @ matrix
            name = each.header.frame_id
        return matrix


def _matrix(transform: Any) -> FloatArray:
    turn = np.array([getattr(transform.rotation, axis) for axis in "xyzw"])
    assert np.linalg.norm(turn) == pytest.approx(1.0, abs=1e-12)
    matrix = np.eye(4)
    matrix[:3, :3] = rotations.matrix(turn)
    matrix[:3, 3] = [getattr(transform.translation, axis) for axis in "xyz"]
    return matrix
