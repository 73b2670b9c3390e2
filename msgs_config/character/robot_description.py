"""A character's URDF as other programs of ROS can read it (RViz, robot_state_publisher)."""

from pathlib import Path
from xml.etree import ElementTree

from msgs_config.character.meshes import resolve_meshes
from msgs_config.character.model import Character
from msgs_config.character.urdf_check import parse_urdf

_JOINT_TYPES = {"revolute", "continuous", "prismatic", "fixed"}
_SHAPES = {"box", "sphere", "cylinder", "mesh"}


def robot_description(character: Character) -> str | None:
    """The text of a character's URDF, its meshes as `file://` URIs; None where it has no legal one.

    Ball joints, capsules and a scale are the engine's own and no part of URDF.
    """
    urdf = character.loading.urdf_path
    robot = parse_urdf(urdf, character.loading.urdf_text)
    if character.loading.scale != 1.0 or not _is_legal(robot):
        return None
    resolve_meshes(robot, urdf)
    for mesh in robot.iterfind("link//mesh"):
        mesh.set("filename", Path(mesh.get("filename", "")).as_uri())
    return ElementTree.tostring(robot, encoding="unicode")


def _is_legal(robot: ElementTree.Element) -> bool:
    """Whether a URDF has only what the format knows."""
    types = {joint.get("type") for joint in robot.findall("joint")}
    parts = [part for tag in ("visual", "collision") for part in robot.iterfind(f"link/{tag}")]
    shapes = {shape.tag for part in parts for shape in part.iterfind("geometry/*")}
    limits = robot.findall("joint/limit")
    whole = all({"effort", "velocity"} <= set(limit.attrib) for limit in limits)
    named = robot.tag == "robot" and bool(robot.get("name"))
    return named and types <= _JOINT_TYPES and shapes <= _SHAPES and whole
