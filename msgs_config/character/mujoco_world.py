"""The world as engine MuJoCo has it: characters, ground, and how contacts are solved.

Each option has its reason in `docs/engines.md`. Which shapes may touch, and how, is as in Bullet's
world: a link never touches those above it, and friction is the product of both surfaces'.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.meshes.parts import read_parts
from msgs_config.character.model import Character, Link, Shape, ShapeType
from msgs_config.character.mujoco_model import add_hull, add_links, ancestors, geometry
from msgs_config.character.urdf.mimic import Mimic
from msgs_config.geometry import rotations

_UNWANTED_PARTS = ("AUTORESET", "FILTERPARENT", "WARMSTART")
_UNUSED_PARTS = ("SPRING", "DAMPER", "ACTUATION", "SENSOR")
_SWEEPS = 2  # of the solver for each iteration, because each step begins with no forces
_LANDING = 2.0  # damping ratio of contacts and limits: what meets them hardly bounces
_FRICTION_HARDNESS = 10.0  # how much less than what carries friction yields: less creeps
_LARGEST_IMPEDANCE = 0.95  # MuJoCo's own
_GROUND_PRIORITY = 1  # MuJoCo takes the friction of the shape with the higher one


@dataclass(frozen=True)
class Contacts:
    """How what touches is held apart."""

    step_s: float
    friction: float  # of contacts with the ground
    friction_between_links: float
    iterations: int = 10  # of the solver, a step


def set_options(option: mujoco.MjOption, contacts: Contacts, gravity: float) -> None:
    """Set how contacts are solved; gravity is in m/s^2 along -z."""
    option.timestep = contacts.step_s
    option.gravity = (0.0, 0.0, -gravity)
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.solver = mujoco.mjtSolver.mjSOL_PGS
    option.iterations = _SWEEPS * contacts.iterations
    option.tolerance = 0.0  # always the same number of iterations
    option.impratio = _FRICTION_HARDNESS
    # With this, with islands, which are MuJoCo's default, and without a warm start, about which it
    # decides for all together, no bit of a character depends on who else is in the world.
    option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    option.disableflags = sum(
        int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{part}"))
        for part in _UNWANTED_PARTS + _UNUSED_PARTS
    )


def _stiffness(contacts: Contacts, damping_ratio: float = 1.0) -> tuple[float, float]:
    """Time constant in s, the shortest that a step allows, and damping ratio of a constraint."""
    return 2.0 * contacts.step_s, damping_ratio


def _joint_friction(contacts: Contacts) -> tuple[float, float]:
    """As of `_stiffness`, such that friction of joints stops them within a step, and no more."""
    return 2.0 * contacts.step_s / _LARGEST_IMPEDANCE, 1.0


def add_ground(
    spec: mujoco.MjSpec, contacts: Contacts, *, plane: bool = True, shapes: Sequence[Shape] = ()
) -> None:
    """Add the plane z = 0, and shapes that do not move."""
    surface = _surface(contacts, contacts.friction)
    surface["priority"] = _GROUND_PRIORITY
    if plane:
        kind = mujoco.mjtGeom.mjGEOM_PLANE
        spec.worldbody.add_geom(type=kind, size=(0.0, 0.0, 1.0), **surface)
    for shape in shapes:
        _add_shape(spec, spec.worldbody, shape, surface)


def _surface(contacts: Contacts, friction: float) -> dict[str, object]:
    return {
        "condim": 3,
        "friction": (friction, 0.0, 0.0),
        "solref": _stiffness(contacts, _LANDING),
    }


def add_character(
    spec: mujoco.MjSpec, prefix: str, character: Character, contacts: Contacts
) -> None:
    """Add a character, with what may not touch and what is coupled; names begin with `prefix`."""
    bodies = add_body(spec, prefix, character.links, contacts)
    for index, other in combinations(range(len(bodies)), 2):
        if not character.loading.self_collision or index in ancestors(character, other):
            spec.add_exclude(bodyname1=bodies[index].name, bodyname2=bodies[other].name)
    for joint in character.moving_joints:
        if joint.mimic is not None:
            spec.add_equality(
                type=mujoco.mjtEq.mjEQ_JOINT,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                name1=prefix + joint.name,
                name2=prefix + joint.mimic.leader,
                data=_mimic(joint.mimic),
                solref=_stiffness(contacts),
            )


def _mimic(mimic: Mimic) -> FloatArray:
    """A coupling as MuJoCo has it: a polynomial in the leader's position."""
    data = np.zeros(mujoco.mjNEQDATA)
    data[:2] = mimic.offset, mimic.multiplier
    return data


def add_body(
    spec: mujoco.MjSpec, prefix: str, links: Sequence[Link], contacts: Contacts
) -> list[mujoco.MjsBody]:
    """Add links with their shapes and the limits of their joints; names begin with `prefix`."""
    surface = _surface(contacts, contacts.friction_between_links)
    bodies = add_links(spec, links, prefix)
    for link, body in zip(links, bodies, strict=True):
        for joint in body.joints:
            joint.solref_friction = _joint_friction(contacts)
            if np.isfinite(link.joint.lower):
                joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
                joint.range = (link.joint.lower, link.joint.upper)
                joint.solref_limit = _stiffness(contacts, _LANDING)
        for shape in link.collision_shapes:
            _add_shape(spec, body, shape, surface)
    return bodies


def _add_shape(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, shape: Shape, surface: dict[str, object]
) -> None:
    """Add a shape, of a mesh the hulls of its parts."""
    if shape.type is not ShapeType.MESH:
        body.add_geom(**geometry(spec, shape), **surface)
        return
    turn = rotations.wxyz_from_xyzw(np.array(shape.pose.orientation_xyzw))
    for vertices in read_parts(Path(shape.mesh)):
        mesh = add_hull(spec, vertices, shape.size)
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # also of what has no volume
        place = {"pos": shape.pose.position, "quat": turn, "meshname": mesh.name}
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, **place, **surface)
