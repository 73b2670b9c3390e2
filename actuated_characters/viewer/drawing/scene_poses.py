"""Poses of many nodes of the scene, sooner than viser's own setters send them.

A setter compares the new value with the old one by `numpy.allclose`, which takes ten times as long
as all else, twice for each link of each picture. What moves all the time needs no comparison.
"""

from collections.abc import Sequence

import viser
from viser._messages import SetOrientationMessage, SetPositionMessage

from msgs_config.arrays import FloatArray


def set_poses(
    nodes: Sequence[viser.SceneNodeHandle], origins: FloatArray, turns_xyzw: FloatArray
) -> None:
    """Move nodes to origins (k, 3), m, with orientations (k, 4), both in their parent's frame."""
    turns_wxyz = turns_xyzw[:, (3, 0, 1, 2)]
    for node, origin, turn in zip(nodes, origins.tolist(), turns_wxyz.tolist(), strict=True):
        own = node._impl
        own.position[:], own.wxyz[:] = origin, turn
        send = own.api._queue_scene_message
        send(SetPositionMessage(own.name, tuple(origin)))
        send(SetOrientationMessage(own.name, tuple(turn)))
