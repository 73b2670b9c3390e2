"""What a terrain's URDF collides with, where it lies: no joint of a terrain ever moves."""

import copy
from collections.abc import Mapping
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np

from msgs_config.character.meshes.resolving import resolve_meshes
from msgs_config.character.model import Pose, Shape, ShapeType, UrdfOptions
from msgs_config.character.shapes import read_shapes
from msgs_config.character.urdf.frames import joint_end
from msgs_config.character.urdf.origin import read_numbers, read_origin
from msgs_config.character.urdf.repair import repair_urdf
from msgs_config.errors import CharacterError
from msgs_config.geometry import rotations

_PLANE_EDGES = (1000.0, 1000.0, 10.0)  # m: stands for a plane, whose upper side is this box's


def terrain_shapes(loading: UrdfOptions) -> list[Shape]:
    """The shapes that collide, their poses in the world, where the base link is at the origin.

    Raises:
        CharacterError: the URDF or a mesh of it cannot be used; names the file.
    """
    robot = resolve_meshes(loading).robot
    if robot.find("link") is None:
        raise CharacterError(f"{loading.urdf_path}: not a usable URDF: it has no link")
    repair_urdf(robot, loading)
    frames = _link_frames(robot)
    planes = _take_planes(robot)
    shapes = [
        replace(shape, pose=_composed(frames[name].scaled(loading.scale), shape.pose))
        for name, (_, collided) in read_shapes(robot, loading).items()
        for shape in collided
    ]
    for name, pose in planes:
        place = _composed(frames[name], pose).scaled(loading.scale)
        shapes.append(Shape(ShapeType.BOX, _PLANE_EDGES, place))
    return shapes


def pieces_of(loading: UrdfOptions, meshes: Mapping[str, str]) -> str:
    """What collides, as a text that is the same for equal content, wherever its files lie.

    Args:
        loading: The terrain.
        meshes: SHA-256 of each mesh by its name in the URDF, see `collision_meshes`.

    Raises:
        CharacterError: it is no URDF.
    """
    robot = copy.deepcopy(loading.robot)
    for link in robot.findall("link"):
        for seen in link.findall("visual"):
            link.remove(seen)
    for mesh in robot.iter("mesh"):
        name = mesh.get("filename", "")
        mesh.set("filename", meshes.get(name, name))
    return ElementTree.canonicalize(ElementTree.tostring(robot), strip_text=True)


def is_plane(shape: Shape) -> bool:
    """Whether a terrain's shape stands for a plane."""
    return shape.type is ShapeType.BOX and shape.size == _PLANE_EDGES


def _link_frames(robot: ElementTree.Element) -> dict[str, Pose]:
    """Where each link is, by its name, in the URDF's own lengths."""
    joints = {joint_end(joint, "child"): joint for joint in robot.findall("joint")}
    frames: dict[str, Pose] = {}
    for link in robot.findall("link"):
        line = [link.get("name", "")]
        while line[-1] in joints and line[-1] not in frames:
            line.append(joint_end(joints[line[-1]], "parent"))
        frames.setdefault(line.pop(), Pose())
        while line:
            joint = joints[line[-1]]
            frames[line.pop()] = _composed(frames[joint_end(joint, "parent")], read_origin(joint))
    return frames


def _take_planes(robot: ElementTree.Element) -> list[tuple[str, Pose]]:
    """Remove the planes; returns the link of each, and the pose of a box that is below it."""
    planes = []
    for link in robot.findall("link"):
        for part in link.findall("collision"):
            plane = part.find("geometry/plane")
            if plane is not None:
                normal = read_numbers(plane.get("normal", "0 0 1"), 3, "normal of <plane>")
                turn = rotations.from_z(np.array(normal))
                below = rotations.rotate(turn, np.array((0.0, 0.0, -0.5 * _PLANE_EDGES[2])))
                pose = _composed(read_origin(part), Pose.of_arrays(below, turn))
                planes.append((link.get("name", ""), pose))
                link.remove(part)
    return planes


def _composed(outer: Pose, inner: Pose) -> Pose:
    """A pose in a frame that has a pose itself."""
    turn = np.array(outer.orientation_xyzw)
    position = rotations.rotate(turn, np.array(inner.position)) + np.array(outer.position)
    return Pose.of_arrays(position, rotations.multiply(turn, np.array(inner.orientation_xyzw)))
