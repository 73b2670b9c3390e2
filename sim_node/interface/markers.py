"""Shapes of a character and balls as `visualization_msgs/MarkerArray`: only poses, stamps change.

A message is filled and serialised once, with numbers in it that are found again among the bytes.
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character, Shape, ShapeType
from msgs_config.frame_names import WORLD
from msgs_config.geometry import rotations
from msgs_config.messages import topics, typed
from msgs_config.messages.cdr import split_stamp
from msgs_config.messages.throw import ProjectileThrow

_MARKER = "visualization_msgs/msg/Marker"
_TYPES = {  # names of the message's constants
    ShapeType.BOX: "CUBE",
    ShapeType.SPHERE: "SPHERE",
    ShapeType.CYLINDER: "CYLINDER",
    ShapeType.MESH: "MESH_RESOURCE",
}
_POSE = 7  # doubles: position and orientation, xyzw
_FIND_POSE = -7.125e250  # times 1, 2, ...: marks the poses in a serialised message
_BALL_RGBA = (0.85, 0.25, 0.15, 1.0)
_FIND_SECONDS = -1_987_654_321


class MarkerEncoder:
    """Serialises where the shapes of a character and balls are, as markers in the world."""

    def __init__(self, character: Character) -> None:
        self._links = len(character.links)
        self._shapes = list(_shapes(character))
        self._serialise((), 0)

    def encode(
        self,
        stamp_ns: int,
        origins: FloatArray,
        turns_xyzw: FloatArray,
        throws: Sequence[ProjectileThrow],
        motion: FloatArray,
    ) -> bytes:
        """The serialised message.

        The links' origins (links, 3) in m and orientations (links, 4); the balls' throws and
        motion (m, 13). Balls that are there no more are deleted.
        """
        if throws != self._throws:
            self._serialise(throws, max(len(self._throws) - len(throws), 0))
        turns = np.concatenate((turns_xyzw, motion[:, 3:7]))[self._rows]
        poses = np.empty((len(self._rows), _POSE))
        poses[:, :3] = np.concatenate((origins, motion[:, :3]))[self._rows]
        poses[:, :3] += rotations.rotate(turns, self._offsets)
        poses[:, 3:] = rotations.multiply(turns, self._turns_xyzw)
        stamp = struct.pack("<iI", *split_stamp(stamp_ns))
        for at, pose_at, pose in zip(self._stamps, self._poses, poses, strict=True):
            self._content[at : at + len(stamp)] = stamp
            self._content[pose_at : pose_at + pose.nbytes] = pose.tobytes()
        content = bytes(self._content)
        if self._deletes:  # a ball that is gone is deleted in one message only
            self._serialise(throws, 0)
        return content

    def _serialise(self, throws: Sequence[ProjectileThrow], gone: int) -> None:
        """Serialise a message of the shapes, balls and `gone` deleted balls, and find its numbers.

        The markers of the balls are numbered on from the character's.
        """
        shapes = self._shapes + [
            (row, replace(throw.shape, color_rgba=_BALL_RGBA))
            for row, throw in enumerate(throws, start=self._links)
        ]
        self._throws, self._deletes = throws, gone > 0
        self._rows = [row for row, _ in shapes]
        self._offsets = np.array([shape.pose.position for _, shape in shapes]).reshape(-1, 3)
        turns = [shape.pose.orientation_xyzw for _, shape in shapes]
        self._turns_xyzw = np.array(turns).reshape(-1, 4)
        markers = [_marker(number, shape) for number, (_, shape) in enumerate(shapes)]
        delete = typed.constants(_MARKER).DELETE
        deleted = [typed.new(_MARKER, id=len(shapes) + i, action=delete) for i in range(gone)]
        for marker in deleted:
            marker.header.frame_id = WORLD
        message = typed.new(topics.VISUALIZATION.type_name, markers=markers + deleted)
        self._content = bytearray(typed.encode(message))
        numbers = range(len(shapes))
        self._stamps = [_find(self._content, "<iI", _FIND_SECONDS, number) for number in numbers]
        self._poses = [_find(self._content, "<d", _FIND_POSE * (n + 1)) for n in numbers]


def _find(content: bytes | bytearray, form: str, *numbers: float) -> int:
    """Where numbers of this form are, which are nowhere else."""
    wanted = struct.pack(form, *numbers)
    at = content.find(wanted)
    assert at >= 0 and content.find(wanted, at + 1) < 0, "a number is not where it can be found"
    return at


def _shapes(character: Character) -> Iterator[tuple[int, Shape]]:
    """Every shape with its link's row; a capsule as a cylinder and two spheres."""
    for row, link in enumerate(character.links):
        for shape in link.shapes:
            for part in shape.without_capsule():
                yield row, part


def _marker(number: int, shape: Shape) -> Any:
    """A marker whose stamp and pose are the numbers that are looked for."""
    kind = getattr(typed.constants(_MARKER), _TYPES[shape.type])
    marker = typed.new(_MARKER, type=kind, id=number, scale=_scale(shape))
    marker.header.frame_id = WORLD
    marker.header.stamp.sec, marker.header.stamp.nanosec = _FIND_SECONDS, number
    marker.pose.position.x = _FIND_POSE * (number + 1)
    colour = dict(zip("rgba", shape.color_rgba, strict=True))
    marker.color = typed.new("std_msgs/msg/ColorRGBA", **colour)
    if shape.mesh:
        marker.mesh_resource = Path(shape.mesh).as_uri()
        marker.mesh_use_embedded_materials = True
    return marker


def _scale(shape: Shape) -> Any:
    """A marker's edges or diameters."""
    if shape.type is ShapeType.SPHERE:
        (radius,) = shape.size
        return _vector(2.0 * radius, 2.0 * radius, 2.0 * radius)
    if shape.type is ShapeType.CYLINDER:
        radius, length = shape.size
        return _vector(2.0 * radius, 2.0 * radius, length)
    return _vector(*shape.size)


def _vector(x: float, y: float, z: float) -> Any:
    return typed.new("geometry_msgs/msg/Vector3", x=x, y=y, z=z)
