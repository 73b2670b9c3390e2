"""The geoms of an MJCF file as shapes of a URDF's links."""

from collections.abc import Iterator
from xml.etree import ElementTree

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.mjcf.compiling import CompiledMjcf
from msgs_config.character.mjcf.places import anchor, turn_of
from msgs_config.character.mjcf.robot import Robot
from msgs_config.character.urdf.file_formats.vocabulary import LeftOut, listed
from msgs_config.character.urdf.origin import write_numbers, write_origin
from msgs_config.geometry import rotations

_KINDS = mujoco.mjtGeom
_SEEN_GROUPS = 3  # MuJoCo shows those below, as long as nobody asks for others
_MESHES = (".obj", ".stl", ".dae", ".glb", ".ply")
_GREY = (0.5, 0.5, 0.5, 1.0)  # of a geom that says no colour


def add_shapes(mjcf: CompiledMjcf, robot: Robot, links: dict[int, ElementTree.Element]) -> None:
    """Give the links of bodies their shapes, those that are seen and those that collide."""
    model = mjcf.model
    for geom in _of_robot(model, robot):
        shape = _geometry(mjcf, geom)
        if shape is None:
            continue
        body = int(model.geom_bodyid[geom])
        geometry, position, turn = shape
        place = position - anchor(model, body), rotations.matrix(turn)
        if _is_seen(model, geom):
            visual = ElementTree.SubElement(links[body], "visual")
            write_origin(visual, *place)
            visual.append(geometry)
            material = ElementTree.SubElement(visual, "material", name=f"geom_{geom}")
            ElementTree.SubElement(material, "color", rgba=write_numbers(_colour(model, geom)))
        if collides(model, geom):
            collision = ElementTree.SubElement(links[body], "collision")
            write_origin(collision, *place)
            collision.append(geometry)


def collides(model: mujoco.MjModel, geom: int) -> bool:
    """Whether a geom meets what the world is made of; where that is nothing, any other."""
    own = (int(model.geom_contype[geom]), int(model.geom_conaffinity[geom]))
    ground = [g for g in _of_world(model) if model.geom_contype[g] or model.geom_conaffinity[g]]
    if not ground:
        return any(own)
    return any(
        own[0] & int(model.geom_conaffinity[g]) or own[1] & int(model.geom_contype[g])
        for g in ground
    )


def is_touched(mjcf: CompiledMjcf, geom: int) -> bool:
    """Whether a geom is a shape of its link that collides."""
    return collides(mjcf.model, geom) and _geometry(mjcf, geom) is not None


def remark_shapes(mjcf: CompiledMjcf, robot: Robot) -> Iterator[LeftOut]:
    """A line for each kind of what becomes no shape, or touches otherwise."""
    model = mjcf.model
    world = [mjcf.name("geom", geom) for geom in _of_world(model)]
    if world:
        yield LeftOut(
            "ground",
            f"left out: geoms of the world, which has a plane of its own at z = 0 ({len(world)}): "
            f"{listed(world)}",
        )
    own = _of_robot(model, robot)
    without = [mjcf.name("geom", geom) for geom in own if _geometry(mjcf, geom) is None]
    if without:
        yield LeftOut(
            "geom",
            "left out: geoms that are no box, sphere, cylinder, capsule or mesh of a file "
            f"({len(without)}): {listed(without)}",
        )
    touching = [geom for geom in own if collides(model, geom)]
    others = [mjcf.name("geom", geom) for geom in touching if _touches_otherwise(model, geom)]
    if others:
        yield LeftOut(
            "friction",
            "left out: contact parameters of geoms, for which those of sim_node stand "
            f"(friction, solref, ...) ({len(others)}): {listed(others)}",
        )
    bodies = {int(model.body_weldid[model.geom_bodyid[geom]]) for geom in touching}
    if len(bodies) > 1:
        yield LeftOut(
            "self_collision",
            "links do not hit each other; 'self_collision: true' of a .yaml file has them do so",
        )


def _of_world(model: mujoco.MjModel) -> list[int]:
    return [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == 0]


def _of_robot(model: mujoco.MjModel, robot: Robot) -> list[int]:
    numbers = robot.numbers
    return [geom for geom in range(model.ngeom) if int(model.geom_bodyid[geom]) in numbers]


def _geometry(
    mjcf: CompiledMjcf, geom: int
) -> tuple[ElementTree.Element, FloatArray, FloatArray] | None:
    """A geom's `<geometry>`, and its position (3,) and turn (4,) in the body; None without one."""
    model = mjcf.model
    kind, size = int(model.geom_type[geom]), model.geom_size[geom].tolist()
    position, turn = np.array(model.geom_pos[geom]), turn_of(model.geom_quat[geom])
    geometry = ElementTree.Element("geometry")
    if geom in mjcf.stand_ins:
        if not mjcf.stand_ins[geom].lower().endswith(_MESHES):
            return None
        ElementTree.SubElement(geometry, "mesh", filename=mjcf.stand_ins[geom])
    elif kind == _KINDS.mjGEOM_BOX:
        ElementTree.SubElement(geometry, "box", size=write_numbers(2.0 * edge for edge in size))
    elif kind == _KINDS.mjGEOM_SPHERE:
        ElementTree.SubElement(geometry, "sphere", radius=repr(size[0]))
    elif kind in (int(_KINDS.mjGEOM_CYLINDER), int(_KINDS.mjGEOM_CAPSULE)):
        tag = "cylinder" if kind == _KINDS.mjGEOM_CYLINDER else "capsule"
        lengths = {"radius": repr(size[0]), "length": repr(2.0 * size[1])}
        ElementTree.SubElement(geometry, tag, lengths)
    elif kind == _KINDS.mjGEOM_MESH:
        return _mesh(mjcf, geom, geometry, position, turn)
    else:
        return None
    return geometry, position, turn


def _mesh(
    mjcf: CompiledMjcf,
    geom: int,
    geometry: ElementTree.Element,
    position: FloatArray,
    turn: FloatArray,
) -> tuple[ElementTree.Element, FloatArray, FloatArray] | None:
    """As of `_geometry`: MuJoCo moves a mesh to its centre and principal axes, which is undone."""
    model, number = mjcf.model, int(mjcf.model.geom_dataid[geom])
    mesh = next(each for each in mjcf.spec.meshes if each.id == number)
    scale, ref_turn = np.array(mesh.scale), rotations.normalised(turn_of(mesh.refquat))
    is_turned = bool(np.abs(ref_turn[:3]).any())
    name = mjcf.mesh_file(number)
    if not name.lower().endswith(_MESHES) or (is_turned and np.ptp(scale) > 0.0):
        return None
    turn = rotations.multiply(turn, rotations.conjugate(turn_of(model.mesh_quat[number])))
    position = position - rotations.rotate(turn, np.array(model.mesh_pos[number]))
    turn = rotations.multiply(turn, rotations.conjugate(ref_turn))
    position = position - rotations.rotate(turn, scale * np.array(mesh.refpos))
    ElementTree.SubElement(geometry, "mesh", filename=name, scale=write_numbers(scale))
    return geometry, position, turn


def _is_seen(model: mujoco.MjModel, geom: int) -> bool:
    return bool(model.geom_group[geom] < _SEEN_GROUPS and _colour(model, geom)[3] > 0.0)


def _colour(model: mujoco.MjModel, geom: int) -> tuple[float, float, float, float]:
    """The colour rgba of a geom, or that of its material where it has none of its own."""
    own, material = model.geom_rgba[geom], int(model.geom_matid[geom])
    if material >= 0 and np.allclose(own, _GREY):
        own = model.mat_rgba[material]
    red, green, blue, alpha = (round(float(each), 6) for each in own)
    return red, green, blue, alpha


def _touches_otherwise(model: mujoco.MjModel, geom: int) -> bool:
    """Whether a geom has other contact parameters than MuJoCo's defaults."""
    given = (
        *model.geom_friction[geom],
        *model.geom_solref[geom],
        *model.geom_solimp[geom],
        *(model.geom_margin[geom], model.geom_gap[geom], model.geom_condim[geom]),
        *(model.geom_priority[geom], model.geom_adhesion[geom]),
        *np.ravel(model.geom_surfacevel[geom]),
    )
    usual = (1.0, 0.005, 0.0001, 0.02, 1.0, 0.9, 0.95, 0.001, 0.5, 2.0, 0.0, 0.0, 3)
    return not np.allclose(given[: len(usual)], usual) or bool(np.any(given[len(usual) :]))
