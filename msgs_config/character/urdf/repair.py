"""A URDF as ROS means it: links without mass are frames, and every inertia is a body's."""

from dataclasses import replace
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Frame, UrdfOptions
from msgs_config.character.urdf.file_formats.vocabulary import listed
from msgs_config.character.urdf.frames import LinkTree, joint_end
from msgs_config.character.urdf.inertia import (
    ENTRIES,
    LEAST_MASS,
    LEAST_MOMENT,
    Inertial,
    ball_moment,
    nearest_physical,
    principal_axes,
    read_inertial,
    write_inertial,
    write_moments,
)
from msgs_config.character.urdf.joints import fix_locked_joints
from msgs_config.character.urdf.mimic import lock_followers_of_fixed, read_mimics
from msgs_config.character.urdf.origin import write_origin
from msgs_config.geometry import fixed_order, rotations

_CHANGE_TOLERANCE = 1e-6  # share of the largest moment of inertia: more than a file's last digits


class Repairs(NamedTuple):
    """What was changed in a URDF."""

    frames: tuple[Frame, ...]
    """The links that were merged into others; a frame that others are in comes first."""
    fixed: frozenset[str]
    """The names of the hinges and sliders that became fixed joints."""
    warnings: tuple[str, ...]
    """One of each kind of change."""


def repair_urdf(robot: ElementTree.Element, loading: UrdfOptions) -> Repairs:
    """Change a URDF's root to what it means.

    Joints that move no mass are fixed, and those whose limits leave one position, in that. Links
    without `<inertial>` that are fixed to others are merged into those; others have no mass. A
    floating base without mass takes that of a link which is fixed to it. With `inertia_from_file`
    each inertia is given about its principal axes, and where no body can have it, it is the nearest
    that one can. With `fill_inertia` a link that has a mass but no inertia, as files have for
    whatever they do not know, has that of a ball of water; where no link has a mass, each with a
    shape has 1 kg.
    """
    warnings = _fill_masses(robot, loading) if loading.fill_inertia else []
    if loading.mimics:
        lock_followers_of_fixed(robot, read_mimics(loading.urdf_path, robot, scale=1.0))
    locked = fix_locked_joints(robot)
    if locked:
        places = [f"{name} at {position:.4g}" for name, position in locked.items()]
        warnings.append(f"joints whose limits leave no room are fixed: {listed(places)}")
    tree = LinkTree(robot)
    empty = tree.fix_empty_joints()
    if empty:
        warnings.append(f"joints that move no mass are fixed at 0: {listed(empty)}")
    warnings += _merge_links(tree, loading)
    warnings += _repair_links(robot, loading)
    frames = [replace(each, pose=each.pose.scaled(loading.scale)) for each in reversed(tree.frames)]
    return Repairs(tuple(frames), frozenset((*locked, *empty)), tuple(warnings))


def _merge_links(tree: LinkTree, loading: UrdfOptions) -> list[str]:
    """Merge links without mass into others; a warning of each kind."""
    warnings = []
    frames = tree.merge_frames()
    if frames:
        pairs = [f"{name} of {link}" for name, link in frames.items()]
        warnings.append(f"links without <inertial> are frames of others: {listed(pairs)}")
    merged = [] if loading.fixed_base else tree.give_base_mass()
    if merged:
        base = tree.base().get("name")
        warnings.append(f"base link '{base}' has no mass, and takes that of {merged[-1]}")
    return warnings


def _repair_links(robot: ElementTree.Element, loading: UrdfOptions) -> list[str]:
    """Give each link an inertia that a body can have; a warning of each kind of change."""
    changed, scaled, filled, tiny = list[str](), list[str](), list[str](), list[str]()
    for link in robot.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            write_inertial(link, 0.0, 0.0)  # without it the engine assumes 1 kg and 1 kg m^2
            continue
        mass = inertial.find("mass")
        if mass is not None and read_inertial(link).mass == 0.0 != float(mass.get("value", "0")):
            tiny.append(f"{link.get('name')} ({mass.get('value')})")
            mass.set("value", "0")
        if inertial.find("inertia") is None:  # the engine refuses it without one
            write_moments(ElementTree.SubElement(inertial, "inertia"), (0.0, 0.0, 0.0))
        if loading.inertia_from_file:
            scaled += _scale_inertia(link)
            changed += _repair_inertia(link)
            filled += _fill_inertia(link) if loading.fill_inertia else []
    warnings = []
    if tiny:
        warnings.append(f"masses of at most {LEAST_MASS:g} kg count as none: {listed(tiny)}")
    if scaled:
        warnings.append(f"<inertia_scaling>, which is Bullet's own, multiplies: {listed(scaled)}")
    if filled:
        warnings.append(
            "links with a mass but no inertia, or none about an axis, with that of a ball of water "
            f"(kg m^2): {listed(filled)}"
        )
    if changed:
        warnings.append(
            "links whose inertia no body can have, with the nearest principal moments that one "
            f"can (kg m^2): {'; '.join(changed)}"
        )
    return warnings


def _fill_masses(robot: ElementTree.Element, loading: UrdfOptions) -> list[str]:
    """Give links 1 kg each if none has a mass and some joint moves; a warning if so.

    They are those with a shape, also with one whose mesh is missing; where there are no shapes,
    those that a joint moves.
    """
    links = robot.findall("link")
    moving = [joint for joint in robot.findall("joint") if joint.get("type") != "fixed"]
    if not moving or any(read_inertial(link).mass for link in links):
        return []
    names = {link.get("name") for link in loading.robot.findall("link") if _has_shape(link)}
    names = names or {joint_end(joint, "child") for joint in moving}
    filled = [link for link in links if link.get("name") in names]
    for link in filled:
        for inertial in link.findall("inertial"):
            link.remove(inertial)
        write_inertial(link, 1.0, ball_moment(1.0))
    named = listed(link.get("name", "") for link in filled)
    return [f"no link has a mass; these have 1 kg each: {named}"]


def _has_shape(link: ElementTree.Element) -> bool:
    return link.find("visual") is not None or link.find("collision") is not None


def _fill_inertia(link: ElementTree.Element) -> list[str]:
    """Give a link with a mass the inertia that it lacks, about all axes or one; says which.

    It is that of a ball of its mass; about one axis, no more than about the others.
    """
    inertia, given = link.find("inertial/inertia"), read_inertial(link)
    moments = np.diag(given.tensor)  # principal moments by now
    lacking = moments <= LEAST_MOMENT
    if inertia is None or not given.mass or not lacking.any():
        return []
    moment = ball_moment(given.mass)
    if not lacking.all():
        moment = min(moment, float(moments[~lacking].min()))
    x, y, z = np.where(lacking, moment, moments).tolist()
    write_moments(inertia, (x, y, z))
    return [f"{link.get('name')} ({moment:.4g})"]


def _scale_inertia(link: ElementTree.Element) -> list[str]:
    """Multiply a link's inertia by Bullet's own element, which is removed; says by how much."""
    named = []
    for contact in link.findall("contact"):
        for scaling in contact.findall("inertia_scaling"):
            contact.remove(scaling)
            factor = float(scaling.get("value", "1"))
            for inertia in link.iterfind("inertial/inertia") if factor != 1.0 else ():
                for name in ENTRIES:
                    inertia.set(name, repr(factor * float(inertia.get(name, "0"))))
                named.append(f"inertia of {link.get('name')} by {factor:g}")
    return named


def _repair_inertia(link: ElementTree.Element) -> list[str]:
    """Give a link principal moments that a body can have; says which, if they are others."""
    inertia = link.find("inertial/inertia")
    if inertia is None:
        return []
    inertial = read_inertial(link)
    tensor = np.array(inertial.tensor)
    is_diagonal = not (tensor - np.diag(np.diag(tensor))).any()
    moments, axes = (np.diag(tensor), np.eye(3)) if is_diagonal else principal_axes(tensor)
    physical = moments.tolist()
    if not _is_physical(*physical):
        physical = list(nearest_physical(moments))
    elif is_diagonal:
        return []
    write_moments(inertia, (physical[0], physical[1], physical[2]))
    if not is_diagonal:
        _turn(link, inertial, axes)
    change = float(np.abs(moments - physical).max())
    if change <= max(LEAST_MOMENT, _CHANGE_TOLERANCE * float(np.abs(moments).max())):
        return []
    before, after = (", ".join(f"{moment:.4g}" for moment in m) for m in (moments, physical))
    return [f"{link.get('name')} ({before}) -> ({after})"]


def _is_physical(x: float, y: float, z: float) -> bool:
    return min(x, y, z) >= 0.0 and x <= y + z and y <= x + z and z <= x + y


def _turn(link: ElementTree.Element, inertial: Inertial, axes: FloatArray) -> None:
    """Turn a link's inertial frame to its principal axes (3, 3)."""
    element = link.find("inertial")
    assert element is not None
    own = rotations.matrix(np.array(inertial.pose.orientation_xyzw))
    write_origin(element, np.array(inertial.pose.position), fixed_order.product(own, axes))
