"""Bounds that a character's file gives its hinges and sliders instead of the URDF's."""

import math
from pathlib import Path
from xml.etree import ElementTree

from msgs_config.character.urdf.limits import read_bounds
from msgs_config.errors import CharacterError

Bounds = tuple[float | None, float | None]
"""Lower and upper bound of a joint, rad or m; None leaves the URDF's."""

_KINDS = ("revolute", "continuous", "prismatic")


def write_bounds(
    robot: ElementTree.Element, bounds: dict[str, Bounds], scale: float, file: Path
) -> str:
    """The text of a URDF with other bounds, so that each of its readers obeys them.

    `bounds` are by the joint's name, a slider's with the URDF's `scale` applied. A continuous joint
    becomes a revolute one. Names that are no joint's are left out. `file` is where they are from.

    Raises:
        CharacterError: a joint can have no bounds, lacks one, or has the lower above the upper.
    """
    for joint in robot.findall("joint"):
        name = joint.get("name", "")
        if name in bounds:
            try:
                _set_bounds(joint, bounds[name], scale if joint.get("type") == "prismatic" else 1.0)
            except CharacterError as error:
                raise CharacterError(f"{file}: joints.{name}: {error}") from error
    return ElementTree.tostring(robot, encoding="unicode")


def _set_bounds(joint: ElementTree.Element, given: Bounds, unit: float) -> None:
    kind = joint.get("type")
    if kind not in _KINDS:
        raise CharacterError(f"lower and upper are for hinges and sliders, this joint is {kind}")
    limit = joint.find("limit")
    if limit is None:
        limit = ElementTree.SubElement(joint, "limit")
    lower, upper = (
        old if new is None else new / unit
        for old, new in zip(_own_bounds(kind, limit), given, strict=True)
    )
    if math.isinf(lower) or math.isinf(upper):
        raise CharacterError("its URDF has no bounds; both lower and upper must be given")
    if lower > upper:
        raise CharacterError(
            f"lower is {lower * unit:g}, upper is {upper * unit:g}; lower must not be above upper"
        )
    joint.set("type", "prismatic" if kind == "prismatic" else "revolute")
    limit.set("lower", repr(lower))
    limit.set("upper", repr(upper))


def _own_bounds(kind: str, limit: ElementTree.Element) -> tuple[float, float]:
    """The URDF's bounds; infinite where it has none, or none that can be."""
    lower, upper = read_bounds(limit)
    bounded = kind != "continuous" and bool({"lower", "upper"} & set(limit.attrib))
    return (lower, upper) if bounded and lower <= upper else (-math.inf, math.inf)
