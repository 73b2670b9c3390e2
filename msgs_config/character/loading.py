"""Makes a `Character` of its YAML file and of its URDF.

The simulator and the controller's model of the dynamics are built from the same numbers.
"""

import math
import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from msgs_config.character.file import CharacterFile, read_character_file
from msgs_config.character.file_defaults import add_defaults
from msgs_config.character.joints.followers import add_mimics, check_followers, couple_rest_pose
from msgs_config.character.layout import ROOT, JointLayout, JointType
from msgs_config.character.links.reading import read_links
from msgs_config.character.meshes.resolving import resolve_meshes
from msgs_config.character.meshes.triangles import check_for_engine
from msgs_config.character.model import (
    ROOT_TORQUE,
    Character,
    ClipFormat,
    Gains,
    Joint,
    Link,
    Pose,
    UrdfOptions,
    layout_of,
)
from msgs_config.character.sensors import check_sensors
from msgs_config.character.shapes import read_shapes
from msgs_config.character.urdf.inertia import read_inertial
from msgs_config.character.urdf.repair import repair_urdf
from msgs_config.errors import CharacterError, LayoutError, one_of
from msgs_config.geometry import rotations
from msgs_config.mappings import show_value
from msgs_config.plain_values import as_plain

_MAX_MASS_DIFFERENCE = 1e-9  # share of all links' mass that a repair may lose by rounding


def load_character(name_or_path: str | os.PathLike[str], collides: bool = True) -> Character:
    """Load a shipped character by name, or any by the path of its YAML file or of its URDF alone.

    Without `collides` nothing of it collides, as `collision: none` in its file has it.

    Raises:
        CharacterError: no such character, or its file or URDF cannot be used; says why.
    """
    name = as_plain(name_or_path)
    if not isinstance(name, str):
        raise CharacterError(f"a character is {show_value(name)}; it must be a name or a path")
    return build_character(read_character_file(name), collides)


def build_character(file: CharacterFile, collides: bool = True) -> Character:
    """The character that a file and its URDF describe; see `load_character`.

    Raises:
        CharacterError: the two do not fit each other, or a mesh cannot be used; says why.
    """
    if not collides:
        file = replace(file, loading=replace(file.loading, collisions=False))
    robot, missing = resolve_meshes(file.loading)
    repairs = repair_urdf(robot, file.loading)
    links, led = add_mimics(_load_links(robot, file), file.loading)
    try:
        layout = layout_of(links)
    except LayoutError as error:
        raise CharacterError(f"{file.loading.urdf_path}: {error}") from error
    _check_names(file, layout, repairs.fixed)
    check_followers(file, links)
    _check_rest_pose(file, links)
    # where nothing collides, a force sensor has nothing to measure, and is no mistake
    may_touch = not file.loading.collisions
    has_shapes = {link.name: may_touch or bool(link.collision_shapes) for link in links}
    check_sensors(file.path, file.sensors, has_shapes)
    character = Character(
        name=file.name,
        file=file.path,
        file_text=file.text,
        loading=file.loading,
        links=tuple(links),
        gains=_merge_gains(file, layout),
        rest_position=_place_rest_pose(file, layout, links),
        clips=_clip_format(file, layout),
        feet=file.feet,
        planning=file.planning,
        warnings=(
            *_collect_warnings(file, layout, links),
            *missing,
            *repairs.warnings,
            *led,
            *(each.line for each in file.loading.remarks if each.kind not in file.left_out),
        ),
        sensors=file.sensors,
        up_axis=file.up_axis,
        frames=repairs.frames,
    )
    return add_defaults(couple_rest_pose(character, file), file)


def _clip_format(file: CharacterFile, layout: JointLayout) -> ClipFormat:
    """How clips of the character are written; without `clips` in its file by all of its joints."""
    if file.clips.joints:
        return file.clips
    return replace(file.clips, joints=tuple(layout.actuated_joint_names))


def _load_links(robot: ElementTree.Element, file: CharacterFile) -> list[Link]:
    """The links of a repaired URDF with their shapes, each subtree in a row."""
    loading = file.loading
    shapes = read_shapes(robot, loading)
    if loading.collisions:
        _check_meshes(robot, loading.urdf_path)
    links = read_links(robot, loading)
    _check_links(loading.urdf_path, links)
    _check_mass(robot, loading)
    armature = 0.0 if loading.fixed_base else file.root_armature
    root = replace(links[0].joint, pose_in_parent=_pose_fixed_base(file), armature=armature)
    joints = [root]
    joints += [_apply_file(link.joint, file) for link in links[1:]]
    return [
        replace(
            link, joint=joint, shapes=shapes[link.name][0], collision_shapes=shapes[link.name][1]
        )
        for link, joint in zip(links, joints, strict=True)
    ]


def _apply_file(joint: Joint, file: CharacterFile) -> Joint:
    """The URDF's joint with the character's own effort limit, passive forces and soft limit."""
    name = joint.name
    damping = joint.damping if file.urdf_damping else 0.0
    friction = joint.friction if file.urdf_friction else 0.0
    for kind, value in (("damping", damping), ("friction", friction)):
        if not 0.0 <= value < math.inf:
            raise CharacterError(
                f"{file.loading.urdf_path}: joint '{name}' has a {kind} of {value:g}; it must be 0 "
                f"or more, or not count ('joint_{kind}: none' in {file.path.name})"
            )
    if not 0.0 <= joint.armature < math.inf:
        raise CharacterError(
            f"{file.loading.urdf_path}: joint '{name}' has an armature of {joint.armature:g}; it "
            "must be 0 or more"
        )
    if name in file.friction and joint.type is JointType.SPHERICAL:
        raise CharacterError(
            f"{file.path}: joints.{name}.friction: it is for hinges and sliders, this joint is "
            f"{joint.type.value}"
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
        friction=file.friction.get(name, friction),
        soft_limit=file.soft_limits.get(name),
    )


def _check_meshes(robot: ElementTree.Element, urdf: Path) -> None:
    """Check that the meshes that are collided with can be used, each file once."""
    names = [mesh.get("filename", "") for mesh in robot.iterfind("link/collision//mesh")]
    for name in dict.fromkeys(names):
        try:
            check_for_engine(Path(name))
        except CharacterError as error:
            raise CharacterError(f"{urdf}: {error}") from error


def _check_links(urdf: Path, links: list[Link]) -> None:
    """Check numbers, of which large ones have overflown, and joints' names."""
    for link in links:
        poses = (link.inertial_pose, link.joint.pose_in_parent)
        numbers = [number for pose in poses for number in (*pose.position, *pose.orientation_xyzw)]
        if not np.isfinite([link.mass, *link.inertia_diagonal, *numbers]).all():
            raise CharacterError(
                f"{urdf}: link '{link.name}' has a mass, an inertia or a frame that is too large"
            )
    for joint in (link.joint for link in links[1:]):
        if joint.name in (ROOT, ROOT_TORQUE) and joint.type is not JointType.FIXED:
            raise CharacterError(
                f"{urdf}: a joint is named '{joint.name}', which is the floating base's"
            )


def _check_mass(repaired: ElementTree.Element, loading: UrdfOptions) -> None:
    """Check that a URDF's repair has neither lost mass nor made any, unless it filled it in."""
    before, after = (
        math.fsum(read_inertial(link).mass for link in robot.findall("link"))
        for robot in (loading.robot, repaired)
    )
    if loading.fill_inertia and before == 0.0:
        return
    if abs(after - before) > _MAX_MASS_DIFFERENCE * before:
        raise CharacterError(
            f"{loading.urdf_path}: all links have {after:.6g} kg; the URDF's text has {before:.6g}"
        )


def _check_names(file: CharacterFile, layout: JointLayout, fixed: frozenset[str]) -> None:
    """Check that the file names joints and degrees of freedom that there are.

    Of a joint that became a fixed one (`fixed`) gains and bounds are no mistake.
    """

    def check(key: str, names: Iterable[str], what: str, known: list[str]) -> None:
        for name in names:
            if name not in known:
                raise CharacterError(f"{file.path}: {key}: {one_of(what, name, known)}")

    joints = [name for name in layout.joint_names if name != ROOT]
    clips = file.clips
    check("joints", [name for name in file.gains if name not in fixed], "joint", joints)
    check("clips.joints", clips.joints, "joint", joints)
    check("planner.sigma", file.planning.sigma, "joint", joints)
    check("planner.gains", file.planning.gains, "joint", joints)
    of_one_angle = [
        name for name in clips.joints if layout.joint(name).type is not JointType.SPHERICAL
    ]
    check("clips.signs", clips.signs, "joint of one angle", of_one_angle)
    check("clips.offsets", clips.offsets, "joint of one angle", of_one_angle)
    check("rest_pose", file.rest_pose, "degree of freedom", list(layout.dof_names))
    if file.assistance and not layout.has_floating_base:
        raise CharacterError(f"{file.path}: root_assistance is for a floating base, this is fixed")


def _check_rest_pose(file: CharacterFile, links: list[Link]) -> None:
    """Check that the rest pose is within hard and soft limits; of the latter also where it is 0."""
    for joint in (link.joint for link in links):
        limits = [(joint.name, joint.lower, joint.upper)]
        if joint.soft_limit is not None:
            names = [joint.name + suffix for suffix in joint.type.suffixes]
            limits = list(zip(names, joint.soft_limit.lower, joint.soft_limit.upper, strict=True))
        for name, lower, upper in limits:
            value = file.rest_pose.get(name, None if joint.soft_limit is None else 0.0)
            if value is not None and not lower <= value <= upper:
                kind = "limits" if joint.soft_limit is None else "soft limits"
                raise CharacterError(
                    f"{file.path}: rest_pose.{name} is {value:g}; "
                    f"its {kind} are {lower:g} to {upper:g}"
                )


def _collect_warnings(
    file: CharacterFile, layout: JointLayout, links: list[Link]
) -> tuple[str, ...]:
    limp = [name for name in layout.actuated_joint_names if name not in file.gains]
    warnings = list(file.misread)
    if limp and not file.automatic_gains:
        warnings.append(f"joints without gains in {file.path.name} are limp: {', '.join(limp)}")
    if file.loading.fixed_base and "fixed_base" not in file.text and links[0].name != "world":
        warnings.append(f"base link '{links[0].name}' has no mass, so that it is fixed")
    moved = _nearest_to_zero(file, links)
    if moved:
        places = ", ".join(f"{name} at {value:.4g}" for name, value in moved.items())
        warnings.append(f"0 is beyond the limits, so it rests there: {places}")
    return tuple(warnings)


def _nearest_to_zero(file: CharacterFile, links: list[Link]) -> dict[str, float]:
    """Where hinges and sliders rest, rad or m, that have no rest pose, and no 0 in their limits."""
    return {
        joint.name: min(max(0.0, joint.lower), joint.upper)
        for joint in (link.joint for link in links)
        if joint.name not in file.rest_pose
        and joint.mimic is None
        and not joint.lower <= 0.0 <= joint.upper
    }


def _merge_gains(file: CharacterFile, layout: JointLayout) -> dict[str, Gains]:
    gains = {name: file.gains.get(name, Gains()) for name in layout.actuated_joint_names}
    if layout.has_floating_base:
        gains[ROOT] = file.assistance.get("force", Gains())
        gains[ROOT_TORQUE] = file.assistance.get("torque", Gains())
    return gains


def _pose_fixed_base(file: CharacterFile) -> Pose:
    """Where a fixed base stands in the world; a floating one has its pose in the state."""
    if file.loading.fixed_base and file.up_axis == "y":
        return Pose.of_arrays(np.zeros(3), rotations.ABOUT_X_QUARTER_TURN_XYZW)
    return Pose()


def _place_rest_pose(
    file: CharacterFile, layout: JointLayout, links: list[Link]
) -> tuple[float, ...]:
    """The rest pose (n,), message form; a y-up model is turned to stand in the z-up world."""
    position = np.zeros(layout.size)
    if layout.has_floating_base and file.up_axis == "y":
        turned = rotations.log(rotations.ABOUT_X_QUARTER_TURN_XYZW)
        position[layout.joint(ROOT).vectors[1]] = turned
    for name, value in (_nearest_to_zero(file, links) | file.rest_pose).items():
        position[layout.dof_names.index(name)] = value
    return tuple(position.tolist())
