"""Poses in a URDF: `<origin>` elements, read, written and composed."""

from collections.abc import Iterable
from xml.etree import ElementTree

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Pose
from msgs_config.errors import CharacterError
from msgs_config.geometry import rotations


def read_origin(element: ElementTree.Element) -> Pose:
    """The pose that an element's `<origin>` gives it, in m; no origin is no change.

    Raises:
        CharacterError: it lacks numbers.
    """
    origin = element.find("origin")
    if origin is None:
        return Pose()
    position = np.array(read_numbers(origin.get("xyz", "0 0 0"), 3, "xyz of <origin>"))
    roll, pitch, yaw = read_numbers(origin.get("rpy", "0 0 0"), 3, "rpy of <origin>")
    about_x, about_y, about_z = rotations.exp(np.diag([roll, pitch, yaw]))
    turn = rotations.multiply(rotations.multiply(about_z, about_y), about_x)
    return Pose.of_arrays(position, turn)


def read_numbers(text: str, count: int, what: str) -> list[float]:
    """Numbers of a text, of which `check_urdf` has made sure wherever they are given.

    Raises:
        CharacterError: there are not as many.
    """
    pieces = text.split()
    if len(pieces) != count:
        raise CharacterError(f"{what} is missing")
    return [float(piece) for piece in pieces]


def write_origin(element: ElementTree.Element, position: FloatArray, axes: FloatArray) -> None:
    """Give an element the pose of a position (3,) in m and axes (3, 3), which are columns."""
    origin = element.find("origin")
    if origin is None:
        origin = ElementTree.SubElement(element, "origin")
    yaw, pitch, roll = rotations.yaw_pitch_roll(axes).tolist()
    origin.set("xyz", write_numbers(position.tolist()))
    origin.set("rpy", write_numbers((roll, pitch, yaw)))


def write_numbers(numbers: Iterable[float]) -> str:
    """A text of numbers, of which none loses a digit."""
    return " ".join(repr(float(number) + 0.0) for number in numbers)  # -0.0 becomes 0.0


def move_origin(element: ElementTree.Element, frame: Pose) -> None:
    """Give an element, whose pose is in a frame, its pose in that frame's parent."""
    if frame == Pose():
        return  # the element's numbers stay to the last digit
    pose = read_origin(element)
    turn = np.array(frame.orientation_xyzw)
    write_origin(
        element,
        np.array(frame.position) + rotations.rotate(turn, np.array(pose.position)),
        rotations.matrix(rotations.multiply(turn, np.array(pose.orientation_xyzw))),
    )
