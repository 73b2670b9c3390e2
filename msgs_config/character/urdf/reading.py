"""A URDF's text as elements: those that count, and each axis a direction."""

from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from msgs_config import files
from msgs_config.character.urdf.file_formats.vocabulary import LeftOut, leave_out_unknown, listed
from msgs_config.errors import CharacterError
from msgs_config.geometry.scalars import norm

WITH_AXIS = ("revolute", "continuous", "prismatic")
"""The types of joints that move along or about an axis."""
DEFAULT_AXIS = "1 0 0"
FLOATING = "floating"
"""The type of a joint between the world and a base that floats, which is one without it as well."""

_DIGITS = 1e-3  # how far the length of a unit vector in a file may be off by its digits


class ReadUrdf(NamedTuple):
    """A URDF as it counts."""

    robot: ElementTree.Element
    remarks: tuple[LeftOut, ...]
    """A line for each kind of what does not count or counts otherwise."""


def read_robot(path: Path, text: str) -> ReadUrdf:
    """The root of a URDF's text, of which `check_urdf` has made sure.

    Raises:
        CharacterError: the text is no XML; names the file.
    """
    robot = files.parse_xml(path, text, CharacterError)
    left_out = leave_out_unknown(robot)
    changed = _normalise_axes(robot)
    if changed:
        line = f"axes of another length than 1 are directions alone: {listed(changed)}"
        left_out = (*left_out, LeftOut("axis", line))
    floating = [joint for joint in robot.findall("joint") if joint.get("type") == FLOATING]
    for joint in floating:
        joint.set("type", "fixed")
        line = f"joint '{joint.get('name')}' is that of the floating base"
        left_out = (*left_out, LeftOut(FLOATING, line))
    return ReadUrdf(robot, left_out)


def _normalise_axes(robot: ElementTree.Element) -> list[str]:
    """Give the axis of each joint the length 1; names those whose length was clearly another.

    The engine takes the length for a gear: it scales the inertia by its square. An `<axis>`
    without numbers is x, as no `<axis>` is.
    """
    changed = []
    for joint in robot.findall("joint"):
        axis = joint.find("axis") if joint.get("type") in WITH_AXIS else None
        if axis is None:
            continue
        x, y, z = vector = read_axis(axis)
        largest = max(map(abs, vector))
        length = norm((x, y, z))
        if length == 1.0 or not largest:
            axis.set("xyz", axis.get("xyz", DEFAULT_AXIS))
            continue
        # in two steps, because a tiny length has few digits
        scaled = (x / largest, y / largest, z / largest)
        unit = norm(scaled)
        axis.set("xyz", " ".join(repr(component / unit + 0.0) for component in scaled))
        if abs(length - 1.0) > _DIGITS:
            changed.append(f"{joint.get('name')} ({length:.4g})")
    return changed


def read_axis(axis: ElementTree.Element) -> list[float]:
    """The numbers of an `<axis>`; without any it is x."""
    return [float(piece) for piece in axis.get("xyz", DEFAULT_AXIS).split()]
