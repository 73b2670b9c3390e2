"""The URDF of an MJCF file's character: links, joints, mass and inertia as MuJoCo compiled them."""

import math
from xml.etree import ElementTree

import mujoco
import numpy as np

from msgs_config.character.mjcf.actuators import Drive
from msgs_config.character.mjcf.compiling import CompiledMjcf
from msgs_config.character.mjcf.followers import Follower
from msgs_config.character.mjcf.places import anchor, link_places, turn_of
from msgs_config.character.mjcf.robot import WORLD, Robot, own_joints
from msgs_config.character.mjcf.shapes import add_shapes
from msgs_config.character.urdf.origin import write_numbers, write_origin
from msgs_config.geometry import rotations

_JOINTS = mujoco.mjtJoint
_UNBOUNDED = 1e6  # m: a slider of a URDF has bounds
_DIAGONAL, _PRODUCTS = ("ixx", "iyy", "izz"), ("ixy", "ixz", "iyz")


def write_urdf(
    mjcf: CompiledMjcf,
    robot: Robot,
    drives: dict[int, Drive],
    followers: dict[int, Follower],
) -> str:
    """The text of the URDF; see `places` for where its links are."""
    root = ElementTree.Element("robot", name=mjcf.spec.modelname or mjcf.path.stem)
    links: dict[int, ElementTree.Element] = {}
    if not robot.floats:
        links[0] = ElementTree.SubElement(root, "link", name=WORLD)
    for body in robot.bodies:
        for joint in own_joints(mjcf.model, body)[:-1]:
            ElementTree.SubElement(root, "link", name=robot.between[joint])
        links[body] = ElementTree.SubElement(root, "link", name=robot.links[body])
        _add_inertial(mjcf.model, body, links[body])
        if not (robot.floats and body == robot.bodies[0]):
            _add_joints(mjcf.model, robot, body, root)
    for element in root.findall("joint"):
        _complete(element, mjcf.model, robot, drives, followers)
    add_shapes(mjcf, robot, links)
    return ElementTree.tostring(root, encoding="unicode")


def _add_inertial(model: mujoco.MjModel, body: int, link: ElementTree.Element) -> None:
    mass = float(model.body_mass[body])
    if not mass:
        return
    inertial = ElementTree.SubElement(link, "inertial")
    place = np.array(model.body_ipos[body]) - anchor(model, body)
    write_origin(inertial, place, rotations.matrix(turn_of(model.body_iquat[body])))
    ElementTree.SubElement(inertial, "mass", value=repr(mass))
    moments = zip(_DIAGONAL, model.body_inertia[body].tolist(), strict=True)
    entries = {name: repr(moment) for name, moment in moments} | dict.fromkeys(_PRODUCTS, "0")
    ElementTree.SubElement(inertial, "inertia", entries)


def _add_joints(model: mujoco.MjModel, robot: Robot, body: int, root: ElementTree.Element) -> None:
    """Add what leads to a body's link: its joints one after another, or a fixed one."""
    parent = robot.links[int(model.body_parentid[body])]
    joints: list[int | None] = [*own_joints(model, body)] or [None]
    for joint, (position, axes) in zip(joints, link_places(model, body), strict=True):
        name = f"{robot.links[body]}_fixed" if joint is None else robot.joints[joint]
        element = ElementTree.SubElement(root, "joint", name=name, type="fixed")
        child = robot.links[body] if joint is None else robot.between.get(joint, robot.links[body])
        write_origin(element, position, axes)
        ElementTree.SubElement(element, "parent", link=parent)
        ElementTree.SubElement(element, "child", link=child)
        parent = child


def _complete(
    element: ElementTree.Element,
    model: mujoco.MjModel,
    robot: Robot,
    drives: dict[int, Drive],
    followers: dict[int, Follower],
) -> None:
    """Give an element its joint's type, axis, bounds, effort limit and passive forces."""
    numbers = {name: joint for joint, name in robot.joints.items()}
    joint = numbers.get(element.get("name", ""))
    if joint is None:
        return
    kind, dof = int(model.jnt_type[joint]), int(model.jnt_dofadr[joint])
    limited, drive = bool(model.jnt_limited[joint]), drives.get(joint, Drive())
    lower, upper = model.jnt_range[joint].tolist() if limited else (-_UNBOUNDED, _UNBOUNDED)
    limit: dict[str, str] = {}
    if math.isfinite(drive.effort_limit) and drive.effort_limit > 0.0:
        limit["effort"] = repr(drive.effort_limit)
    dynamics = {"armature": float(model.dof_armature[dof]) + drive.armature}
    if kind == _JOINTS.mjJNT_BALL:
        element.set("type", "spherical")
    else:
        slides = kind == _JOINTS.mjJNT_SLIDE
        element.set("type", "prismatic" if slides else "revolute" if limited else "continuous")
        ElementTree.SubElement(element, "axis", xyz=write_numbers(model.jnt_axis[joint]))
        if slides or limited:
            limit |= {"lower": repr(lower), "upper": repr(upper)}
        dynamics["damping"] = float(model.dof_damping[dof])
        dynamics["friction"] = float(model.dof_frictionloss[dof])
    if limit:
        ElementTree.SubElement(element, "limit", limit)
    given = {name: repr(value) for name, value in dynamics.items() if value}
    if given:
        ElementTree.SubElement(element, "dynamics", given)
    if joint in followers:
        leader, multiplier, offset = followers[joint]
        coupling = {"multiplier": repr(multiplier), "offset": repr(offset)}
        ElementTree.SubElement(element, "mimic", {"joint": robot.joints[leader]} | coupling)
