"""A character's URDF as other programs of ROS can read it (RViz, robot_state_publisher)."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from msgs_config.character.layout import JointType
from msgs_config.character.meshes.resolving import resolve_meshes
from msgs_config.character.model import Character, Link, Pose, Quadruple, Shape, ShapeType
from msgs_config.character.urdf.described_joints import DescribedJoint, DescribedJoints
from msgs_config.character.urdf.inertia import read_inertial, write_moments
from msgs_config.character.urdf.joints import fix_locked_joints
from msgs_config.character.urdf.mimic import Mimic, lock_followers_of_fixed, read_mimics
from msgs_config.character.urdf.origin import write_numbers, write_origin
from msgs_config.frame_names import BASE_FRAME
from msgs_config.geometry import rotations

_JOINT_TYPES = {"revolute", "continuous", "prismatic", "fixed"}
_SHAPES = {"box", "sphere", "cylinder", "mesh"}
_MAX_NUMBER = 1e9  # m, N, N m or their rates: URDF's limits must be numbers


def robot_description(character: Character, base_frame: str = BASE_FRAME) -> str:
    """The text of a URDF of a character, its meshes as `file://` URIs.

    It is the character's own where that is a legal one, of which it has what counts, and that as it
    is simulated: axes, fixed joints, effort limits, mass and inertia. Ball joints, capsules and a
    scale are the engine's own and no part of URDF; a character that has any is described by hinges,
    cylinders and spheres. The root is `base_frame`, see `DescribedJoints`.
    """
    joints = DescribedJoints(character, base_frame)
    if character.loading.scale == 1.0 and _is_legal(character.loading.robot):
        robot = resolve_meshes(character.loading).robot
        if character.loading.mimics:
            path = character.loading.urdf_path
            lock_followers_of_fixed(robot, read_mimics(path, robot, scale=1.0))
        fix_locked_joints(robot)
        for mesh in robot.iterfind("link//mesh"):
            mesh.set("filename", Path(mesh.get("filename", "")).as_uri())
        _write_joints(robot, joints)
        _write_inertia(robot, character)
        if joints.has_own_base:
            robot.insert(0, ElementTree.Element("link", name=joints.root))
            robot.insert(1, _joint(joints.joints[0]))
        sensors = {sensor.name for sensor in character.sensors}
        for each in joints.joints:
            if each.child in sensors:
                robot.extend((ElementTree.Element("link", name=each.child), _joint(each)))
    else:
        robot = _describe(character, joints)
    return ElementTree.tostring(robot, encoding="unicode")


def _write_joints(robot: ElementTree.Element, joints: DescribedJoints) -> None:
    """Give joints the type, the effort limit and the leader that they have here."""
    elements = {joint.get("name"): joint for joint in robot.findall("joint")}
    for joint in joints.fixed:  # those that move no mass are fixed here as well
        if joint.name in elements:
            elements[joint.name].set("type", "fixed")
            _write_mimic(elements[joint.name], None)
    for joint in joints.moving:
        _write_mimic(elements[joint.name], joint.mimic)
        limit = elements[joint.name].find("limit")
        effort = min(joint.effort_limit, _MAX_NUMBER)
        if limit is None or joint.mimic is not None:  # no motor drives a follower
            continue
        if float(limit.get("effort", "0")) != effort:
            limit.set("effort", repr(effort))


def _write_mimic(element: ElementTree.Element, mimic: Mimic | None) -> None:
    """Let a joint follow what it follows here, or nothing, where its file says otherwise."""
    own = element.find("mimic")
    if own is not None:
        if mimic is None:
            element.remove(own)
        elif own.get("joint") != mimic.leader:
            own.set("joint", mimic.leader)
            own.set("multiplier", repr(mimic.multiplier))
            own.set("offset", repr(mimic.offset))


def _write_inertia(robot: ElementTree.Element, character: Character) -> None:
    """Give links the mass and inertia that they have here, where that is not what the file says.

    A link that took the mass of one which is fixed to it stays as it is: so does the other.
    """
    elements = {link.get("name", ""): link for link in robot.findall("link")}
    merged = {each.parent for each in character.frames if read_inertial(elements[each.name]).mass}
    for link in character.links:
        element = elements[link.name]
        given, own = read_inertial(element), link.inertia_in_link_axes()
        same = np.allclose(given.in_link_axes(), own, rtol=0.0, atol=1e-9 * np.abs(own).max())
        if link.mass > 0.0 and link.name not in merged and not (same and given.mass == link.mass):
            for inertial in element.findall("inertial"):
                element.remove(inertial)
            element.append(_inertial(link))


def _is_legal(robot: ElementTree.Element) -> bool:
    """Whether a URDF has only what the format knows."""
    types = {joint.get("type") for joint in robot.findall("joint")}
    parts = [part for tag in ("visual", "collision") for part in robot.iterfind(f"link/{tag}")]
    shapes = {shape.tag for part in parts for shape in part.iterfind("geometry/*")}
    limits = robot.findall("joint/limit")
    whole = all({"effort", "velocity"} <= set(limit.attrib) for limit in limits)
    named = robot.tag == "robot" and bool(robot.get("name"))
    return named and types <= _JOINT_TYPES and shapes <= _SHAPES and whole


def _describe(character: Character, joints: DescribedJoints) -> ElementTree.Element:
    """A URDF made of the character's links and of the joints of its description."""
    robot = ElementTree.Element("robot", name=character.name)
    colors = sorted({shape.color_rgba for link in character.links for shape in link.shapes})
    materials = {color: f"color_{number}" for number, color in enumerate(colors)}
    for color, name in materials.items():
        material = ElementTree.SubElement(robot, "material", name=name)
        ElementTree.SubElement(material, "color", rgba=write_numbers(color))
    links = {link.name: link for link in character.links}
    for name in (joints.root, *(joint.child for joint in joints.joints)):
        element = ElementTree.SubElement(robot, "link", name=name)
        if name in links:
            element.extend(_parts(links[name], materials))
    robot.extend(_joint(joint) for joint in joints.joints)
    return robot


def _parts(link: Link, materials: dict[Quadruple, str]) -> Iterator[ElementTree.Element]:
    """Mass and shapes of a link."""
    if link.mass > 0.0:
        yield _inertial(link)
    for shape in _without_capsules(link.shapes):
        visual = _shape("visual", shape)
        ElementTree.SubElement(visual, "material", name=materials[shape.color_rgba])
        yield visual
    for shape in _without_capsules(link.collision_shapes):
        yield _shape("collision", shape)


def _inertial(link: Link) -> ElementTree.Element:
    """Mass and inertia of a link, about its principal axes."""
    inertial = ElementTree.Element("inertial")
    _place(inertial, link.inertial_pose)
    ElementTree.SubElement(inertial, "mass", value=repr(float(link.mass)))
    x, y, z = link.inertia_diagonal
    write_moments(ElementTree.SubElement(inertial, "inertia"), (float(x), float(y), float(z)))
    return inertial


def _without_capsules(shapes: Sequence[Shape]) -> Iterator[Shape]:
    for shape in shapes:
        yield from shape.without_capsule()


def _shape(tag: str, shape: Shape) -> ElementTree.Element:
    """A shape that is seen or touched, of any type but a capsule."""
    element = ElementTree.Element(tag)
    _place(element, shape.pose)
    attributes = {"size": write_numbers(shape.size)}
    if shape.type is ShapeType.MESH:
        attributes = {"filename": Path(shape.mesh).as_uri(), "scale": write_numbers(shape.size)}
    elif shape.type is not ShapeType.BOX:
        names = ("radius", "length")[: len(shape.size)]
        attributes = {n: repr(float(v)) for n, v in zip(names, shape.size, strict=True)}
    geometry = ElementTree.SubElement(element, "geometry")
    ElementTree.SubElement(geometry, shape.type.value, attributes)
    return element


def _joint(joint: DescribedJoint) -> ElementTree.Element:
    is_endless = joint.type is JointType.REVOLUTE and math.isinf(joint.upper - joint.lower)
    element = ElementTree.Element(
        "joint", name=joint.name, type="continuous" if is_endless else joint.type.value
    )
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.child)
    _place(element, joint.pose)
    if joint.type is not JointType.FIXED:
        ElementTree.SubElement(element, "axis", xyz=write_numbers(joint.axis))
        limits = {"effort": joint.effort_limit, "velocity": math.inf}
        if not is_endless:
            limits |= {"lower": joint.lower, "upper": joint.upper}
        bounded = {n: max(min(value, _MAX_NUMBER), -_MAX_NUMBER) for n, value in limits.items()}
        ElementTree.SubElement(element, "limit", {n: repr(v) for n, v in bounded.items()})
    if joint.mimic is not None:
        leader, multiplier, offset = joint.mimic
        numbers = {"multiplier": repr(multiplier), "offset": repr(offset)}
        ElementTree.SubElement(element, "mimic", {"joint": leader} | numbers)
    return element


def _place(element: ElementTree.Element, pose: Pose) -> None:
    """Give an element its `<origin>`."""
    axes = rotations.matrix(np.array(pose.orientation_xyzw))
    write_origin(element, np.array(pose.position), axes)
