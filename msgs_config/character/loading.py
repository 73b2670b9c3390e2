"""Makes a `Character` of its YAML file and of its URDF as the engine understands it.

The engine's own numbers are taken (mass, principal inertia, frames), so that the simulator and
the controller's model of the dynamics are built from the same ones.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.bullet import connect, load_urdf, pybullet
from msgs_config.character.file import CharacterFile, read_character_file
from msgs_config.character.layout import ROOT, JointLayout, JointType
from msgs_config.character.meshes import resolve_meshes
from msgs_config.character.model import (
    ROOT_TORQUE,
    Character,
    Gains,
    Joint,
    Link,
    Pose,
    Quaternion,
    SoftLimit,
    Vector,
)
from msgs_config.character.shapes import read_collision_shapes, read_shapes
from msgs_config.character.urdf_check import links_without_inertial, parse_urdf
from msgs_config.errors import CharacterError, LayoutError, one_of
from msgs_config.geometry import rotations

_JOINT_TYPES = {
    pybullet.JOINT_REVOLUTE: JointType.REVOLUTE,
    pybullet.JOINT_PRISMATIC: JointType.PRISMATIC,
    pybullet.JOINT_SPHERICAL: JointType.SPHERICAL,
    pybullet.JOINT_FIXED: JointType.FIXED,
}


def load_character(name_or_path: str) -> Character:
    """Load a shipped character by name, or any by the path of its YAML file or of its URDF alone.

    Raises:
        CharacterError: no such character, or its file or URDF cannot be used; says why.
    """
    return make_character(read_character_file(name_or_path))


def make_character(file: CharacterFile) -> Character:
    """The character that a file and its URDF describe.

    Raises:
        CharacterError: the two do not fit each other, or a mesh cannot be used; says why.
    """
    urdf = file.loading.urdf_path
    robot = parse_urdf(urdf, file.loading.urdf_text)
    resolve_meshes(robot, urdf)
    seen = read_shapes(robot, urdf, file.loading.scale)
    touched = read_collision_shapes(robot, urdf, file.loading.scale)
    client = connect()
    try:
        body = load_urdf(client, file.loading)
        links = _read_links(client, body, file)
    finally:
        pybullet.disconnect(client)
    _check_finite(urdf, links)
    links = [
        replace(link, shapes=seen[link.name], collision_shapes=touched[link.name])
        for link in _depth_first(links)
    ]
    for link in links[1:]:
        if link.joint.name in (ROOT, ROOT_TORQUE) and link.joint.type is not JointType.FIXED:
            raise CharacterError(
                f"{urdf}: a joint is named '{link.joint.name}', which is the floating base's"
            )
    try:
        layout = JointLayout((link.joint.name, link.joint.type) for link in links)
    except LayoutError as error:
        raise CharacterError(f"{urdf}: {error}") from error
    _check_joint_names(file, layout)
    _check_rest_pose(file, links)
    return Character(
        name=file.name,
        file=file.path,
        file_text=file.text,
        loading=file.loading,
        links=tuple(links),
        gains=_gains(file, layout),
        rest_position=_rest_position(file, layout),
        clips=file.clips,
        feet=file.feet,
        planning=file.planning,
        warnings=_warnings(file, layout, links, links_without_inertial(robot)),
    )


def _read_links(client: int, body: int, file: CharacterFile) -> list[Link]:
    """The links in the engine's order, each after its parent, the base first."""
    base_type = JointType.FIXED if file.loading.fixed_base else JointType.FLOATING
    base_name = pybullet.getBodyInfo(body, physicsClientId=client)[0].decode()
    base_joint = Joint(ROOT, base_type, pose_in_parent=_fixed_base_pose(file))
    links = [_link(client, body, -1, base_name, -1, base_joint)]
    for index in range(pybullet.getNumJoints(body, physicsClientId=client)):
        info = pybullet.getJointInfo(body, index, physicsClientId=client)
        name, parent = info[1].decode(), info[16] + 1
        if info[2] not in _JOINT_TYPES:
            raise CharacterError(
                f"{file.loading.urdf_path}: joint '{name}' is of a type that is not supported; "
                "it must be revolute, continuous, prismatic, spherical or fixed"
            )
        link = _link(client, body, index, info[12].decode(), parent, Joint(name, JointType.FIXED))
        joint = _joint(info, links[parent].inertial_pose, link.inertial_pose)
        links.append(replace(link, joint=_with_file(joint, file)))
    return links


def _with_file(joint: Joint, file: CharacterFile) -> Joint:
    """The URDF's joint, with what the character's file says instead of it, or besides."""
    name = joint.name
    damping = joint.damping if file.urdf_damping else 0.0
    if not 0.0 <= damping < math.inf:
        raise CharacterError(
            f"{file.loading.urdf_path}: joint '{name}' has a damping of {damping:g}; it must be 0 "
            f"or more, or not count ('joint_damping: none' in {file.path.name})"
        )
    if name in file.soft_limits and joint.type is not JointType.SPHERICAL:
        raise CharacterError(
            f"{file.path}: joints.{name}.soft_limit: it is for ball joints, this joint is "
            f"{joint.type.value}; its limits are the URDF's"
        )
    return replace(
        joint,
        effort_limit=file.effort_limits.get(name, joint.effort_limit),
        damping=file.passive_damping.get(name, damping),
        soft_limit=file.soft_limits.get(name),
    )


def _link(client: int, body: int, index: int, name: str, parent: int, joint: Joint) -> Link:
    dynamics = pybullet.getDynamicsInfo(body, index, physicsClientId=client)
    pose = Pose(position=dynamics[3], orientation_xyzw=dynamics[4])
    return Link(name, parent, joint, dynamics[0], dynamics[2], pose)


def _joint(info: tuple[Any, ...], parent_inertial: Pose, child_inertial: Pose) -> Joint:
    """A joint from `getJointInfo`, whose frames are the links' inertial ones.

    Its position is given in the parent's inertial frame, its axis in the child's, and its
    orientation turns the parent's inertial frame into the child's.
    """
    parent_turn = np.array(parent_inertial.orientation_xyzw)
    child_turn = np.array(child_inertial.orientation_xyzw)
    offset, turn, axis = (np.array(info[index], dtype=float) for index in (14, 15, 13))
    position = np.array(parent_inertial.position) + rotations.rotate(parent_turn, offset)
    orientation = rotations.multiply(
        rotations.multiply(parent_turn, rotations.conjugate(turn)), rotations.conjugate(child_turn)
    )
    joint_type = _JOINT_TYPES[info[2]]
    is_scalar = joint_type in (JointType.REVOLUTE, JointType.PRISMATIC)
    limited = is_scalar and info[8] <= info[9]
    return Joint(
        name=info[1].decode(),
        type=joint_type,
        axis_in_child=_triple(rotations.rotate(child_turn, axis)),
        pose_in_parent=Pose(_triple(position), _quadruple(orientation)),
        lower=float(info[8]) if limited else -math.inf,
        upper=float(info[9]) if limited else math.inf,
        effort_limit=float(info[10]) if info[10] > 0.0 else math.inf,
        damping=float(info[6]) if is_scalar else 0.0,
    )


def _check_finite(urdf: Path, links: list[Link]) -> None:
    """The engine computes inertia and frames; numbers that are too large overflow there."""
    for link in links:
        poses = (link.inertial_pose, link.joint.pose_in_parent)
        numbers = [number for pose in poses for number in (*pose.position, *pose.orientation_xyzw)]
        if not np.isfinite([link.mass, *link.inertia_diagonal, *numbers]).all():
            raise CharacterError(
                f"{urdf}: link '{link.name}' has a mass, an inertia or a frame that is too large"
            )


def _depth_first(links: list[Link]) -> list[Link]:
    """The links with every child right after its parent's branch so far, parents renumbered."""
    children: list[list[int]] = [[] for _ in links]
    for index, link in enumerate(links[1:], start=1):
        children[link.parent].append(index)
    order: list[int] = []
    pending = [0]
    while pending:
        order.append(pending.pop())
        pending += reversed(children[order[-1]])
    place = {old: new for new, old in enumerate(order)} | {-1: -1}
    return [replace(links[old], parent=place[links[old].parent]) for old in order]


def _check_joint_names(file: CharacterFile, layout: JointLayout) -> None:
    planning = file.planning
    for key, names in (
        ("joints", file.gains),
        ("clips.joints", file.clips.joints),
        ("planner.sigma", planning.sigma),
        ("planner.gains", planning.gains),
    ):
        for name in names:
            if name not in layout.actuated_joint_names:
                sentence = one_of("joint", name, layout.actuated_joint_names)
                raise CharacterError(f"{file.path}: {key}: {sentence}")
    of_one_angle = [
        name for name in file.clips.joints if layout.joint(name).type is not JointType.SPHERICAL
    ]
    for key, changed in (("signs", file.clips.signs), ("offsets", file.clips.offsets)):
        for name in changed:
            if name not in of_one_angle:
                sentence = one_of("joint of one angle", name, of_one_angle)
                raise CharacterError(f"{file.path}: clips.{key}: {sentence}")
    if file.assistance and not layout.has_floating_base:
        raise CharacterError(f"{file.path}: root_assistance is for a floating base, this is fixed")


def _check_rest_pose(file: CharacterFile, links: list[Link]) -> None:
    for joint in (link.joint for link in links):
        value = file.rest_pose.get(joint.name)
        if value is not None and not joint.lower <= value <= joint.upper:
            raise CharacterError(
                f"{file.path}: rest_pose.{joint.name} is {value:g}; "
                f"its limits are {joint.lower:g} to {joint.upper:g}"
            )
        if joint.soft_limit is not None:
            _check_ball_joint(file, joint.name, joint.soft_limit)


def _check_ball_joint(file: CharacterFile, name: str, limit: SoftLimit) -> None:
    """The rest pose is one that the joint's soft limit leaves alone."""
    for suffix, lower, upper in zip(
        JointType.SPHERICAL.suffixes, limit.lower, limit.upper, strict=True
    ):
        value = file.rest_pose.get(name + suffix, 0.0)
        if not lower <= value <= upper:
            raise CharacterError(
                f"{file.path}: rest_pose.{name}{suffix} is {value:g}; "
                f"its soft limits are {lower:g} to {upper:g}"
            )


def _warnings(
    file: CharacterFile, layout: JointLayout, links: list[Link], without_mass: set[str]
) -> tuple[str, ...]:
    limp = [name for name in layout.actuated_joint_names if name not in file.gains]
    first = 1 if file.loading.fixed_base else 0
    unknown = sorted(without_mass & {link.name for link in links[first:]})
    warnings = []
    if limp:
        warnings.append(f"joints without gains in {file.path.name} are limp: {', '.join(limp)}")
    if unknown:
        warnings.append(
            f"links without <inertial>, the engine assumes a mass: {', '.join(unknown)}"
        )
    return tuple(warnings)


def _gains(file: CharacterFile, layout: JointLayout) -> dict[str, Gains]:
    gains = {name: file.gains.get(name, Gains()) for name in layout.actuated_joint_names}
    if layout.has_floating_base:
        gains[ROOT] = file.assistance.get("force", Gains())
        gains[ROOT_TORQUE] = file.assistance.get("torque", Gains())
    return gains


def _fixed_base_pose(file: CharacterFile) -> Pose:
    """Where a fixed base stands in the world; a floating one has its pose in the state."""
    if file.loading.fixed_base and file.up_axis == "y":
        return Pose(orientation_xyzw=_quadruple(rotations.ABOUT_X_QUARTER_TURN_XYZW))
    return Pose()


def _rest_position(file: CharacterFile, layout: JointLayout) -> tuple[float, ...]:
    """The rest pose (n,), message form; a y-up model is turned to stand in the z-up world."""
    position = np.zeros(layout.size)
    if layout.has_floating_base and file.up_axis == "y":
        turned = rotations.log(rotations.ABOUT_X_QUARTER_TURN_XYZW)
        position[layout.joint(ROOT).vectors[1]] = turned
    for name, value in file.rest_pose.items():
        if name not in layout.dof_names:
            sentence = one_of("degree of freedom", name, list(layout.dof_names))
            raise CharacterError(f"{file.path}: rest_pose: {sentence}")
        position[layout.dof_names.index(name)] = value
    return tuple(position.tolist())


def _triple(values: FloatArray) -> Vector:
    x, y, z = values.tolist()
    return (x, y, z)


def _quadruple(values: FloatArray) -> Quaternion:
    x, y, z, w = values.tolist()
    return (x, y, z, w)
