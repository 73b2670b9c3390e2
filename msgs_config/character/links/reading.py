"""Links and joints of a URDF in numbers: mass, principal moments, frames, axes and bounds."""

import math
from collections import defaultdict
from xml.etree import ElementTree

from msgs_config.character.layout import ROOT, SCALAR, JointType
from msgs_config.character.links.shape_inertia import moments_of_shapes
from msgs_config.character.links.transforms import (
    IDENTITY,
    Transform,
    compose,
    inverse,
    multiply,
    quaternion,
    read_transform,
    rotate,
    transposed,
)
from msgs_config.character.model import Joint, Link, Pose, UrdfOptions, Vector
from msgs_config.character.urdf.frames import joint_end
from msgs_config.character.urdf.limits import WITH_BOUNDS, read_bounds
from msgs_config.character.urdf.reading import DEFAULT_AXIS
from msgs_config.errors import CharacterError
from msgs_config.geometry import scalars

_TYPES = {
    "revolute": JointType.REVOLUTE,
    "continuous": JointType.REVOLUTE,
    "prismatic": JointType.PRISMATIC,
    "spherical": JointType.SPHERICAL,
    "fixed": JointType.FIXED,
}
_NEEDED = {  # attributes without which an element says nothing
    "inertial/mass": ("value",),
    "inertial/inertia": ("ixx", "iyy", "izz"),
    **{
        f"contact/{name}": ("value",)
        for name in (
            "inertia_scaling",
            "lateral_friction",
            "rolling_friction",
            "restitution",
            "spinning_friction",
            "stiffness",
            "damping",
        )
    },
}


def read_links(robot: ElementTree.Element, loading: UrdfOptions) -> list[Link]:
    """The links of a repaired URDF, without shapes: the base first, then each branch in a row.

    The children of a link are in the order of their joints in the text. A fixed base has no mass.
    Moments of inertia are the text's with `inertia_from_file`, else those of boxes round shapes.

    Raises:
        CharacterError: an element lacks a number, or a mesh cannot be used.
    """
    _check_complete(robot, loading)
    elements = {link.get("name", ""): link for link in robot.findall("link")}
    below = defaultdict[str, list[ElementTree.Element]](list)
    for element in robot.findall("joint"):
        below[joint_end(element, "parent")].append(element)
    (base,) = set(elements) - {joint_end(each, "child") for each in robot.findall("joint")}
    root = Joint(ROOT, JointType.FIXED if loading.fixed_base else JointType.FLOATING)
    frame = _inertial_frame(elements[base], loading)
    links = [_read_link(elements[base], -1, root, frame, loading)]
    frames = [frame]
    pending = [(element, 0) for element in reversed(below[base])]
    while pending:
        element, parent = pending.pop()
        link = elements[joint_end(element, "child")]
        frame = _inertial_frame(link, loading)
        joint = _read_joint(element, frames[parent], frame, loading.scale)
        pending += [(each, len(links)) for each in reversed(below[link.get("name", "")])]
        links.append(_read_link(link, parent, joint, frame, loading))
        frames.append(frame)
    return links


def _check_complete(robot: ElementTree.Element, loading: UrdfOptions) -> None:
    """Check that the elements of links have the numbers that they are there for."""
    if robot.get("name") is None:
        raise CharacterError(f"{loading.urdf_path}: not a usable URDF: <robot> has no 'name'")
    for link in robot.findall("link"):
        for path, needed in _NEEDED.items():
            element = link.find(path)
            lacking = [
                name for name in needed if element is not None and name not in element.attrib
            ]
            if lacking:
                raise CharacterError(
                    f"{loading.urdf_path}: not a usable URDF: <{path.rpartition('/')[2]}> of link "
                    f"'{link.get('name')}' has no '{lacking[0]}'"
                )


def _inertial_frame(link: ElementTree.Element, loading: UrdfOptions) -> Transform:
    """Where the axes of a link's moments of inertia are in the link."""
    frame = read_transform(link.find("inertial"), loading.scale)
    if not loading.inertia_from_file:
        return frame
    # Bullet multiplies by the principal axes, which are its own by now: -0.0 may become 0.0.
    return Transform(compose(frame, IDENTITY).axes, frame.origin)


def _read_link(
    element: ElementTree.Element, parent: int, joint: Joint, frame: Transform, loading: UrdfOptions
) -> Link:
    """A link of a parent, by its place among the links, and an inertial frame."""
    mass = _number(element.find("inertial/mass"), "value")
    inertia = element.find("inertial/inertia")
    moments = (_number(inertia, "ixx"), _number(inertia, "iyy"), _number(inertia, "izz"))
    if joint.type is JointType.FIXED and parent < 0:
        mass, moments = 0.0, (0.0, 0.0, 0.0)
    elif not loading.inertia_from_file:
        moments = moments_of_shapes(element, mass, frame, loading)
    return Link(element.get("name", ""), parent, joint, mass, moments, frame.pose())


def _read_joint(
    element: ElementTree.Element, parent: Transform, child: Transform, lengths: float
) -> Joint:
    """A joint between links whose inertial frames are given.

    Bullet keeps a joint's position and turn between those, and its axis in the child's. From there
    they are brought back into the links' frames, which leaves them their last bits.
    """
    joint_type = _TYPES[element.get("type", "")]
    is_scalar = joint_type in SCALAR
    in_parent = compose(inverse(parent), read_transform(element, lengths))
    back = quaternion(inverse(child).axes)
    turn = multiply(back, quaternion(transposed(in_parent.axes)))
    axis = rotate(back, _read_axis(element)) if is_scalar else (0.0, 0.0, 0.0)
    parent_turn, child_turn = quaternion(parent.axes), quaternion(child.axes)
    orientation = scalars.multiply(
        scalars.multiply(parent_turn, scalars.conjugate(turn)), scalars.conjugate(child_turn)
    )
    offset = scalars.to_parent(scalars.axes(parent_turn), in_parent.origin)
    limit, dynamics = element.find("limit"), element.find("dynamics")
    effort = _number(limit, "effort")
    lower, upper = -math.inf, math.inf
    if element.get("type") in WITH_BOUNDS and limit is not None:
        unit = lengths if joint_type is JointType.PRISMATIC else 1.0
        lower, upper = (bound * unit for bound in read_bounds(limit))
    return Joint(
        name=element.get("name", ""),
        type=joint_type,
        axis_in_child=scalars.to_parent(scalars.axes(child_turn), axis),
        pose_in_parent=Pose(scalars.add(parent.origin, offset), orientation),
        lower=lower,
        upper=upper,
        effort_limit=effort if effort > 0.0 else math.inf,
        damping=_number(dynamics, "damping") if is_scalar else 0.0,
        friction=_number(dynamics, "friction") if is_scalar else 0.0,
        armature=_number(dynamics, "armature"),
    )


def _read_axis(joint: ElementTree.Element) -> Vector:
    axis = joint.find("axis")
    text = DEFAULT_AXIS if axis is None else axis.get("xyz", DEFAULT_AXIS)
    x, y, z = map(float, text.split())
    return x, y, z


def _number(element: ElementTree.Element | None, name: str) -> float:
    """An element's number; 0 where there is none."""
    return 0.0 if element is None else float(element.get(name, "0"))
