"""Limits of a URDF's joints as its text has them."""

from xml.etree import ElementTree

WITH_BOUNDS = ("revolute", "prismatic")


def read_bounds(limit: ElementTree.Element) -> tuple[float, float]:
    """Lower and upper bound of a hinge or slider, rad or m; one that is not there is 0."""
    return float(limit.get("lower", "0")), float(limit.get("upper", "0"))
