"""A character as MuJoCo has it: its links and joints in a model, and its shapes.

Bodies are in the order of the characters' links, because MuJoCo lists them depth-first, too.
"""

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.meshes.thickness import is_flat, with_thickness
from msgs_config.character.meshes.triangles import is_converted, read_vertices
from msgs_config.character.model import Character, Joint, Link, Shape, ShapeType
from msgs_config.geometry import rotations

_NAME = "link "  # before each link's, because MuJoCo's own body is called `world`

_MUJOCO_TYPES = {
    JointType.REVOLUTE: mujoco.mjtJoint.mjJNT_HINGE,
    JointType.PRISMATIC: mujoco.mjtJoint.mjJNT_SLIDE,
    JointType.SPHERICAL: mujoco.mjtJoint.mjJNT_BALL,
    JointType.FLOATING: mujoco.mjtJoint.mjJNT_FREE,
}

_GEOMETRIES = {
    ShapeType.BOX: mujoco.mjtGeom.mjGEOM_BOX,
    ShapeType.SPHERE: mujoco.mjtGeom.mjGEOM_SPHERE,
    ShapeType.CYLINDER: mujoco.mjtGeom.mjGEOM_CYLINDER,
    ShapeType.CAPSULE: mujoco.mjtGeom.mjGEOM_CAPSULE,
    ShapeType.MESH: mujoco.mjtGeom.mjGEOM_MESH,
}


def quaternion_starts(model: mujoco.MjModel) -> list[int]:
    """First entry of each quaternion among MuJoCo's positions."""
    before = {int(mujoco.mjtJoint.mjJNT_BALL): 0, int(mujoco.mjtJoint.mjJNT_FREE): 3}
    return [
        int(address) + before[int(kind)]
        for address, kind in zip(model.jnt_qposadr, model.jnt_type, strict=True)
        if int(kind) in before
    ]


def add_links(spec: mujoco.MjSpec, links: Sequence[Link], prefix: str = "") -> list[mujoco.MjsBody]:
    """Add all links and joints of a body, without shapes; MuJoCo's bodies are in their order.

    Their names begin with `prefix`.
    """
    bodies = [spec.worldbody]
    for link in links:
        bodies.append(_add_body(bodies[link.parent + 1], link, prefix))
    return bodies[1:]


def compile_exactly(spec: mujoco.MjSpec, links: Sequence[Link]) -> mujoco.MjModel:
    """Compile a model whose bodies are these links, whose inertia is kept to the last bit.

    Raises:
        ValueError: MuJoCo refuses the model.
    """
    spec.compiler.balanceinertia = False
    model = spec.compile()
    # set afterwards: the compiler refuses a link without mass or inertia, which is sound wherever
    # the joints above it do not move it alone
    model.body_inertia[1:] = np.reshape([link.inertia_diagonal for link in links], (-1, 3))
    _set_masses(model, [link.mass for link in links])
    model.dof_simplenum[:] = 0  # else a simple body keeps the mass matrix as compiled
    return model


def compile_for_contacts(spec: mujoco.MjSpec, links: Sequence[Link]) -> mujoco.MjModel:
    """As `compile_exactly`, for a model with contacts, limits or friction.

    MuJoCo scales these by how easily a force moves a body (`body_invweight0`, `dof_invweight0`),
    which is then that of the links, not of the bodies that it has compiled.

    Raises:
        ValueError: MuJoCo refuses the model.
    """
    model = compile_exactly(spec, links)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    model.dof_simplenum[:] = 0
    return model


def _set_masses(model: mujoco.MjModel, masses: list[float]) -> None:
    """Set the masses of all bodies but the world's, and what MuJoCo has of their sums."""
    if model.body_mass[1:].tolist() == masses:
        return
    model.body_mass[1:] = masses
    model.body_subtreemass[:] = model.body_mass
    for body in range(model.nbody - 1, 0, -1):
        model.body_subtreemass[model.body_parentid[body]] += model.body_subtreemass[body]


def _add_body(parent: mujoco.MjsBody, link: Link, prefix: str) -> mujoco.MjsBody:
    pose, inertial = link.joint.pose_in_parent, link.inertial_pose
    body = parent.add_body(
        name=prefix + _NAME + link.name,
        pos=pose.position,
        quat=rotations.wxyz_from_xyzw(np.array(pose.orientation_xyzw)),
        mass=link.mass or 1.0,
        ipos=inertial.position,
        iquat=rotations.wxyz_from_xyzw(np.array(inertial.orientation_xyzw)),
        inertia=(1.0, 1.0, 1.0),
        explicitinertial=True,
    )
    if link.joint.type is not JointType.FIXED:
        _add_joint(body, link.joint, prefix)
    return body


def _add_joint(body: mujoco.MjsBody, joint: Joint, prefix: str) -> None:
    axis = joint.axis_in_child if any(joint.axis_in_child) else (0.0, 0.0, 1.0)
    kind = _MUJOCO_TYPES[joint.type]
    body.add_joint(name=prefix + joint.name, type=kind, axis=axis, armature=joint.armature)


def geometry(spec: mujoco.MjSpec, shape: Shape) -> dict[str, object]:
    """A shape as MuJoCo has it, which takes half of what a length is; of a mesh its hull."""
    turn = rotations.wxyz_from_xyzw(np.array(shape.pose.orientation_xyzw))
    place: dict[str, object] = {"type": _GEOMETRIES[shape.type], "pos": shape.pose.position}
    place["quat"] = turn
    if shape.type is ShapeType.MESH:
        file = Path(shape.mesh)
        vertices = read_vertices(file)
        if is_converted(file) or is_flat(vertices * shape.size):
            mesh = add_hull(spec, vertices, shape.size)
        else:
            mesh = spec.add_mesh(scale=shape.size)
            mesh.file, mesh.name = shape.mesh, f"mesh {len(spec.meshes)}"
        return {**place, "meshname": mesh.name}
    if shape.type is ShapeType.BOX:
        return {**place, "size": tuple(0.5 * edge for edge in shape.size)}
    radius, *length = shape.size
    half = 0.5 * length[0] if length else 0.0
    return {**place, "size": (radius, half, 0.0)}


def add_hull(spec: mujoco.MjSpec, vertices: FloatArray, scale: Sequence[float]) -> mujoco.MjsMesh:
    """Add a mesh of vertices (m, 3), scaled along its axes, of which MuJoCo takes the hull.

    What is flat gets a thickness: MuJoCo finds no hull of it.
    """
    mesh = spec.add_mesh(name=f"mesh {len(spec.meshes) + 1}")
    if is_flat(scaled := vertices * scale):
        mesh.uservert = with_thickness(scaled).ravel()
    else:
        mesh.uservert, mesh.scale = vertices.ravel(), scale
    return mesh


def ancestors(character: Character, index: int) -> set[int]:
    """The links above one, by their indices."""
    found: set[int] = set()
    while (index := character.links[index].parent) >= 0:
        found.add(index)
    return found
