"""Any character as an MJCF file: its links, joints, shapes, motors and sensors for MuJoCo alone.

Mass matrix and bias are those of the controller's model to rounding. How contacts are solved is
MuJoCo's default, not what `mujoco_world` sets.
"""

import math
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from msgs_config.character.layout import ROOT, JointType
from msgs_config.character.mjcf.reading import HOME
from msgs_config.character.model import Character, Joint, Link, Pose, Shape, ShapeType
from msgs_config.character.mujoco_model import ancestors
from msgs_config.character.sensors import SensorType
from msgs_config.character.urdf.file_formats.vocabulary import listed
from msgs_config.character.urdf.inertia import LEAST_MASS, LEAST_MOMENT
from msgs_config.character.urdf.origin import write_numbers
from msgs_config.geometry import rotations

_TYPES = {
    JointType.REVOLUTE: "hinge",
    JointType.PRISMATIC: "slide",
    JointType.SPHERICAL: "ball",
    JointType.FLOATING: "free",
}
_NO_CONTACT = {"contype": "0", "conaffinity": "0"}
_SEEN, _TOUCHED = {"group": "2", **_NO_CONTACT}, {"group": "3"}
_MESHES = (".obj", ".stl")
_WHOLE_LINK = 10.0  # m, the radius of a touch sensor's site: all contacts of its link are within
_AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}


class Written(NamedTuple):
    """A character as an MJCF."""

    text: str
    left_out: tuple[str, ...]
    """A line for each kind of what the file does not have."""


def write_mjcf(character: Character, *, servos: bool = False) -> Written:
    """The text of an MJCF with a plane to stand on.

    Its actuators are motors, whose controls are efforts; with `servos` they are targets of hinges
    and sliders, which have the character's gains.
    """
    root = ElementTree.Element("mujoco", model=character.name)
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true")
    assets, world = (ElementTree.SubElement(root, tag) for tag in ("asset", "worldbody"))
    ElementTree.SubElement(world, "light", pos="0 0 4", dir="0 0 -1", directional="true")
    floor = {"name": "floor", "type": "plane", "size": "0 0 1", "conaffinity": "0"}
    ElementTree.SubElement(world, "geom", floor)
    unread: list[str] = []
    bodies = _add_bodies(character, world, assets, unread)
    _add_frames(character, bodies)
    _add_contacts(character, root, bodies)
    _add_followers(character, root)
    _add_actuators(character, root, servos=servos)
    _add_sensors(character, root, bodies)
    _add_rest_pose(character, root)
    ElementTree.indent(root)
    left_out = tuple(_left_out(character, unread, servos=servos))
    return Written(ElementTree.tostring(root, encoding="unicode") + "\n", left_out)


def _add_bodies(
    character: Character,
    world: ElementTree.Element,
    assets: ElementTree.Element,
    unread: list[str],
) -> list[ElementTree.Element]:
    """Add all links; the bodies, in their order."""
    bodies: list[ElementTree.Element] = []
    touch = {} if character.loading.self_collision else {"contype": "0"}
    for link in character.links:
        parent = world if link.parent < 0 else bodies[link.parent]
        # the name of the worldbody itself
        name = "world_link" if link.name == "world" else link.name
        body = ElementTree.SubElement(parent, "body", name=name)
        pose = link.joint.pose_in_parent
        if link.joint.type is JointType.FLOATING:
            rest = np.array(character.rest_position[:6])
            pose = Pose.of_arrays(rest[:3], rotations.exp(rest[3:]))
        _place(body, pose)
        if link.joint.type is not JointType.FIXED:
            _add_joint(body, link.joint)
        _add_inertial(body, link)
        collided = [_outline(shape) for shape in link.collision_shapes]
        for shape in link.shapes:
            if _outline(shape) not in collided:
                _add_geom(body, assets, shape, _SEEN, unread)
        seen = {_outline(shape): shape for shape in link.shapes}
        for shape in link.collision_shapes:
            own = seen.get(_outline(shape))
            group = _TOUCHED if own is None else {}
            _add_geom(body, assets, shape if own is None else own, group | touch, unread)
        bodies.append(body)
    return bodies


def _outline(shape: Shape) -> tuple[object, ...]:
    """A shape without its colour."""
    return (shape.type, shape.size, shape.pose, shape.mesh)


def _add_joint(body: ElementTree.Element, joint: Joint) -> None:
    attributes = {"name": joint.name, "type": _TYPES[joint.type]}
    if joint.type in (JointType.REVOLUTE, JointType.PRISMATIC):
        attributes["axis"] = write_numbers(joint.axis_in_child)
        if math.isfinite(joint.lower) and math.isfinite(joint.upper):
            attributes["range"] = write_numbers((joint.lower, joint.upper))
    passive = {
        "damping": joint.damping,
        "frictionloss": joint.friction,
        "armature": joint.armature,
    }
    attributes |= {name: repr(float(value)) for name, value in passive.items() if value}
    ElementTree.SubElement(body, "joint", attributes)


def _add_inertial(body: ElementTree.Element, link: Link) -> None:
    """Give a body its mass; MuJoCo wants some where something moves, so nothing is next to it."""
    is_fixed = link.joint.type is JointType.FIXED
    if is_fixed and not link.mass and not any(link.inertia_diagonal):
        return
    inertial = ElementTree.SubElement(body, "inertial", mass=repr(float(link.mass or LEAST_MASS)))
    _place(inertial, link.inertial_pose)
    moments = [max(moment, LEAST_MOMENT) for moment in link.inertia_diagonal]
    inertial.set("diaginertia", write_numbers(moments))


def _add_geom(
    body: ElementTree.Element,
    assets: ElementTree.Element,
    shape: Shape,
    attributes: dict[str, str],
    unread: list[str],
) -> None:
    """Add a shape; of a mesh MuJoCo takes the hull to collide with."""
    if not all(shape.size):
        return  # nothing to see or touch, which MuJoCo refuses
    geom = {"type": shape.type.value, "mass": "0", **attributes}
    geom["rgba"] = write_numbers(shape.color_rgba)
    if shape.type is ShapeType.MESH:
        if Path(shape.mesh).suffix.lower() not in _MESHES:
            unread.append(Path(shape.mesh).name)
            return
        geom["mesh"] = f"mesh_{len(assets)}"
        scale = write_numbers(shape.size)
        asset = {"name": geom["mesh"], "file": shape.mesh, "scale": scale, "inertia": "shell"}
        ElementTree.SubElement(assets, "mesh", asset)
    elif shape.type is ShapeType.BOX:
        geom["size"] = write_numbers(0.5 * edge for edge in shape.size)
    else:
        radius, *length = shape.size
        geom["size"] = write_numbers((radius, *(0.5 * each for each in length)))
    element = ElementTree.SubElement(body, "geom", geom)
    _place(element, shape.pose)


def _add_frames(character: Character, bodies: list[ElementTree.Element]) -> None:
    """Add the links that are parts of others, as bodies that are empty."""
    places = {link.name: body for link, body in zip(character.links, bodies, strict=True)}
    for frame in character.frames:
        body = ElementTree.SubElement(places[frame.parent], "body", name=frame.name)
        _place(body, frame.pose)
        places[frame.name] = body


def _add_contacts(
    character: Character, root: ElementTree.Element, bodies: list[ElementTree.Element]
) -> None:
    """Exclude contacts of a link with those above it."""
    if not character.loading.self_collision:
        return
    contact = ElementTree.SubElement(root, "contact")
    for index, other in combinations(range(len(bodies)), 2):
        if index in ancestors(character, other):
            pair = {f"body{n + 1}": bodies[i].get("name", "") for n, i in enumerate((index, other))}
            ElementTree.SubElement(contact, "exclude", pair)


def _add_followers(character: Character, root: ElementTree.Element) -> None:
    if not character.leaders:
        return
    equality = ElementTree.SubElement(root, "equality")
    for joint in character.moving_joints:
        if joint.mimic is not None:
            ElementTree.SubElement(
                equality,
                "joint",
                joint1=joint.name,
                joint2=joint.mimic.leader,
                polycoef=write_numbers((joint.mimic.offset, joint.mimic.multiplier, 0.0, 0.0, 0.0)),
            )


def _add_actuators(character: Character, root: ElementTree.Element, *, servos: bool) -> None:
    actuator = ElementTree.SubElement(root, "actuator")
    for joint in character.moving_joints:
        if joint.type is JointType.FLOATING or joint.mimic is not None or not joint.effort_limit:
            continue
        limit, gains = joint.effort_limit, character.gains[joint.name]
        named, bounds = {"name": joint.name, "joint": joint.name}, dict[str, str]()
        is_servo = servos and joint.type is not JointType.SPHERICAL and gains.stiffness > 0.0
        if math.isfinite(limit):
            name = "forcerange" if is_servo else "ctrlrange"
            bounds[name] = write_numbers((-limit, limit))
        if is_servo:
            own = {"kp": repr(gains.stiffness), "kv": repr(gains.damping), **bounds}
            ElementTree.SubElement(actuator, "position", named | own)
        elif joint.type is JointType.SPHERICAL:
            for axis, gear in _AXES.items():
                own = {"name": f"{joint.name}_{axis}", "joint": joint.name, "gear": gear}
                ElementTree.SubElement(actuator, "motor", own | bounds)
        else:
            ElementTree.SubElement(actuator, "motor", named | bounds)


def _add_sensors(
    character: Character, root: ElementTree.Element, bodies: list[ElementTree.Element]
) -> None:
    places = {link.name: body for link, body in zip(character.links, bodies, strict=True)}
    element = ElementTree.SubElement(root, "sensor")
    for sensor in character.sensors:
        site = ElementTree.SubElement(places[sensor.link], "site", name=sensor.name, group="4")
        _place(site, Pose(sensor.position, sensor.orientation_xyzw))
        if sensor.type is SensorType.FORCE:
            site.set("size", repr(_WHOLE_LINK))
            ElementTree.SubElement(element, "touch", name=sensor.name, site=sensor.name)
            continue
        for kind in ("accelerometer", "gyro"):
            ElementTree.SubElement(element, kind, name=f"{sensor.name}_{kind}", site=sensor.name)
        name = f"{sensor.name}_orientation"
        turn = {"name": name, "objtype": "site", "objname": sensor.name}
        ElementTree.SubElement(element, "framequat", turn)


def _add_rest_pose(character: Character, root: ElementTree.Element) -> None:
    rest, numbers = np.array(character.rest_position), list[float]()
    for joint in character.layout.joints:
        if joint.rotation is None:
            numbers.append(rest[joint.start])
            continue
        numbers += rest[joint.start : joint.rotation.start].tolist()
        turn = rotations.exp(rest[joint.rotation])
        numbers += rotations.wxyz_from_xyzw(turn).tolist()
    keys = ElementTree.SubElement(root, "keyframe")
    ElementTree.SubElement(keys, "key", name=HOME, qpos=write_numbers(numbers))


def _place(element: ElementTree.Element, pose: Pose) -> None:
    turn = rotations.wxyz_from_xyzw(np.array(pose.orientation_xyzw))
    element.set("pos", write_numbers(pose.position))
    element.set("quat", write_numbers(turn))


def _left_out(character: Character, unread: list[str], *, servos: bool) -> Iterator[str]:
    moving = character.moving_joints
    soft = [joint.name for joint in moving if joint.soft_limit is not None]
    balls = [joint.name for joint in moving if joint.type is JointType.SPHERICAL]
    driven = [joint for joint in moving if character.gains.get(joint.name) and joint.name != ROOT]
    if unread:
        yield f"left out: meshes that MuJoCo does not read ({len(unread)}): {listed(unread)}"
    if soft:
        yield f"left out: soft limits of ball joints ({len(soft)}): {listed(soft)}"
    if balls:
        named = f"({len(balls)}): {listed(balls)}"
        yield f"ball joints have a motor for each axis, each with the whole limit {named}"
    if driven and not servos:
        yield "left out: gains; --servos has them, of hinges and sliders"
    if any(sensor.type is SensorType.FORCE for sensor in character.sensors):
        yield "force sensors are touch sensors, of the normal forces on their links"
    if any(sensor.noise for sensor in character.sensors):
        yield "left out: noise of sensors"
