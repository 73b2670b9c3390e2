"""Shapes of a character and balls as `visualization_msgs/MarkerArray`: only poses, stamps change.

A message is filled and serialised once, with numbers in it that are found again among the bytes.
"""

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from geometry_msgs.msg import Point, Vector3
from rclpy.serialization import serialize_message
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character, Shape, ShapeType
from msgs_config.geometry import rotations
from msgs_config.messages.joint_state import split_stamp
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.messages.wrenches import WORLD

_TYPES = {
    ShapeType.BOX: Marker.CUBE,
    ShapeType.SPHERE: Marker.SPHERE,
    ShapeType.CYLINDER: Marker.CYLINDER,
    ShapeType.MESH: Marker.MESH_RESOURCE,
}
_POSE = 7  # doubles: position and orientation, xyzw
_FIND_POSE = -7.125e250  # times 1, 2, 3 and so on
_BALL_RGBA = (0.85, 0.25, 0.15, 1.0)
_FIND_SECONDS = -1_987_654_321


class MarkerEncoder:
    """Serialises where the shapes of a character and balls are, as markers in the world."""

    def __init__(
        self, character: Character, throws: Sequence[ProjectileThrow] = (), gone: int = 0
    ) -> None:
        """For a character, the balls of these throws, and `gone` balls that are to be taken away.

        The markers of the balls are numbered on from the character's.
        """
        parts = list(_parts(character))
        for row, throw in enumerate(throws, start=len(character.links)):
            parts.append((row, Shape(ShapeType.SPHERE, (throw.radius,), color_rgba=_BALL_RGBA)))
        self._rows = [row for row, _ in parts]
        self._offsets = np.array([part.pose.position for _, part in parts]).reshape(-1, 3)
        turns = [part.pose.orientation_xyzw for _, part in parts]
        self._turns_xyzw = np.array(turns).reshape(-1, 4)
        markers = [_marker(number, part) for number, (_, part) in enumerate(parts)]
        for number, marker in enumerate(markers):
            marker.header.stamp.sec, marker.header.stamp.nanosec = _FIND_SECONDS, number
            marker.pose.position = Point(x=_FIND_POSE * (number + 1))
        deleted = [Marker(id=len(parts) + i, action=Marker.DELETE) for i in range(gone)]
        for marker in deleted:
            marker.header.frame_id = WORLD
        self.takes_away = gone > 0
        """Whether its messages take balls away."""
        self._content = bytearray(serialize_message(MarkerArray(markers=markers + deleted)))
        self._stamps = [
            _find(self._content, "<iI", _FIND_SECONDS, number) for number in range(len(parts))
        ]
        self._poses = [
            _find(self._content, "<d", _FIND_POSE * (number + 1)) for number in range(len(parts))
        ]

    def encode(self, stamp_ns: int, origins: FloatArray, turns_xyzw: FloatArray) -> bytes:
        """The serialised message, of origins (b, 3) in m and orientations (b, 4): links, balls."""
        turns = turns_xyzw[self._rows]
        poses = np.empty((len(self._rows), _POSE))
        poses[:, :3] = origins[self._rows] + rotations.rotate(turns, self._offsets)
        poses[:, 3:] = rotations.multiply(turns, self._turns_xyzw)
        stamp = struct.pack("<iI", *split_stamp(stamp_ns))
        for at, pose_at, pose in zip(self._stamps, self._poses, poses, strict=True):
            self._content[at : at + len(stamp)] = stamp
            self._content[pose_at : pose_at + pose.nbytes] = pose.tobytes()
        return bytes(self._content)


def _find(content: bytes | bytearray, form: str, *numbers: float) -> int:
    """Where numbers of this form are, which are nowhere else."""
    wanted = struct.pack(form, *numbers)
    at = content.find(wanted)
    assert at >= 0 and content.find(wanted, at + 1) < 0, "a number is not where it can be found"
    return at


def _parts(character: Character) -> Iterator[tuple[int, Shape]]:
    """Every shape with its link's row; a capsule as a cylinder and two spheres."""
    for row, link in enumerate(character.links):
        for shape in link.shapes:
            for part in shape.without_capsule():
                yield row, part


def _marker(number: int, shape: Shape) -> Marker:
    red, green, blue, alpha = shape.color_rgba
    marker = Marker(type=_TYPES[shape.type], id=number, scale=_scale(shape))
    marker.header.frame_id = WORLD
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=alpha)
    if shape.mesh:
        marker.mesh_resource = Path(shape.mesh).as_uri()
        marker.mesh_use_embedded_materials = True
    return marker


def _scale(shape: Shape) -> Vector3:
    """A marker's edges or diameters."""
    if shape.type is ShapeType.SPHERE:
        return _vector(np.full(3, 2.0 * shape.size[0]))
    if shape.type is ShapeType.CYLINDER:
        radius, length = shape.size
        return _vector(np.array((2.0 * radius, 2.0 * radius, length)))
    return _vector(np.array(shape.size))


def _vector(values: FloatArray) -> Vector3:
    x, y, z = values.tolist()
    return Vector3(x=x, y=y, z=z)
