"""MuJoCo's model of a world: the ground, characters and balls, and how contacts are solved.

Each option has its reason in `docs/engines.md`. Which shapes may touch, and how, is as in Bullet's
world: a link never touches those above it, and friction is the product of both surfaces'.
"""

import copy
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.meshes.parts import read_parts
from msgs_config.character.model import Character, Joint, Link, Pose, Shape, ShapeType
from msgs_config.character.mujoco_model import (
    add_hull,
    add_links,
    ancestors,
    compile_for_contacts,
    geometry,
)
from msgs_config.character.terrain import terrain_shapes
from msgs_config.character.urdf.mimic import Mimic
from msgs_config.errors import CharacterError
from msgs_config.geometry import rotations
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.runtime.fork_safe import fork_safe_lock
from sim_node.physics.settings import WorldSettings

_UNWANTED_PARTS = ("AUTORESET", "FILTERPARENT", "WARMSTART")
_UNUSED_PARTS = ("SPRING", "DAMPER", "ACTUATION", "SENSOR")
_MOST_KEPT_MODELS = 8  # compiled models, of which the same worlds are made again
_SWEEPS = 2  # of the solver for each iteration, because each step begins with no forces
_LANDING = 2.0  # damping ratio of contacts and limits: what meets them hardly bounces
_FRICTION_HARDNESS = (
    10.0  # how much less than what carries friction yields: what stands creeps less
)
_LARGEST_IMPEDANCE = 0.95  # MuJoCo's own
_GROUND_PRIORITY = 1  # MuJoCo takes the friction of the shape with the higher one

_keeping = fork_safe_lock()  # worlds may be made in several threads
_kept: OrderedDict[object, tuple[tuple[Character, ...], mujoco.MjModel]] = OrderedDict()


def compile_world(
    characters: Sequence[Character], balls: Sequence[ProjectileThrow], settings: WorldSettings
) -> mujoco.MjModel:
    """The model of a world: first the characters' links, then the balls, in their order.

    Raises:
        CharacterError: a file cannot be used, or MuJoCo refuses what it says.
    """
    # Characters are compared by identity, and kept with the model, so that none takes another's.
    shapes = tuple((ball.mass, ball.radius) for ball in balls)
    key = (*map(id, characters), shapes, replace(settings, gravity=0.0))
    with _keeping:
        if key not in _kept:
            _kept[key] = (tuple(characters), _compile(characters, balls, settings))
            while len(_kept) > _MOST_KEPT_MODELS:
                _kept.popitem(last=False)
        _kept.move_to_end(key)
        return copy.copy(_kept[key][1])


def ball_link(number: int, throw: ProjectileThrow) -> Link:
    """A ball as a body of one link: a solid sphere."""
    inertia = 0.4 * throw.mass * throw.radius * throw.radius
    shape = Shape(ShapeType.SPHERE, (throw.radius,))
    joint = Joint(f"ball {number}", JointType.FLOATING)
    return Link(f"ball {number}", -1, joint, throw.mass, (inertia,) * 3, Pose(), (), (shape,))


def _compile(
    characters: Sequence[Character], balls: Sequence[ProjectileThrow], settings: WorldSettings
) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False  # limits are in rad
    _set_options(spec.option, settings)
    _add_ground(spec, settings)
    for number, character in enumerate(characters):
        _add_character(spec, f"{number}/", character, settings)
    ball_links = [ball_link(number, throw) for number, throw in enumerate(balls)]
    for link in ball_links:
        _add_body(spec, "", [link], settings)
    links = [link for character in characters for link in character.links] + ball_links
    try:
        model = compile_for_contacts(spec, links)
    except (ValueError, mujoco.FatalError) as error:
        files = [str(each.file) for each in characters]
        if settings.terrain is not None:
            files.append(str(settings.terrain.urdf_path))
        reason = str(error).strip().replace("\n", "; ")
        raise CharacterError(f"{', '.join(files)}: not usable by MuJoCo: {reason}") from error
    return model


def _set_options(option: mujoco.MjOption, settings: WorldSettings) -> None:
    option.timestep = settings.step_s
    option.gravity = (0.0, 0.0, -settings.gravity)
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.solver = mujoco.mjtSolver.mjSOL_PGS
    option.iterations = _SWEEPS * settings.solver_iterations
    option.tolerance = 0.0  # always the same number of iterations
    option.impratio = _FRICTION_HARDNESS
    # With this, with islands, which are MuJoCo's default, and without a warm start, about which it
    # decides for all together, no bit of a character depends on who else is in the world.
    option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    option.disableflags = sum(
        int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{part}"))
        for part in _UNWANTED_PARTS + _UNUSED_PARTS
    )


def _stiffness(settings: WorldSettings, damping_ratio: float = 1.0) -> tuple[float, float]:
    """Time constant in s, the shortest that a step allows, and damping ratio of a constraint."""
    return 2.0 * settings.step_s, damping_ratio


def _joint_friction(settings: WorldSettings) -> tuple[float, float]:
    """As of `_stiffness`, such that friction of joints stops them within a step, and no more."""
    return 2.0 * settings.step_s / _LARGEST_IMPEDANCE, 1.0


def _add_ground(spec: mujoco.MjSpec, settings: WorldSettings) -> None:
    """Add the plane, and the terrain's shapes, which do not move."""
    surface = _surface(settings, settings.friction * settings.link_friction)
    surface["priority"] = _GROUND_PRIORITY
    if settings.ground:
        plane = mujoco.mjtGeom.mjGEOM_PLANE
        spec.worldbody.add_geom(type=plane, size=(0.0, 0.0, 1.0), **surface)
    if settings.terrain is not None:
        for shape in terrain_shapes(settings.terrain):
            _add_shape(spec, spec.worldbody, shape, surface)


def _surface(settings: WorldSettings, friction: float) -> dict[str, object]:
    return {
        "condim": 3,
        "friction": (friction, 0.0, 0.0),
        "solref": _stiffness(settings, _LANDING),
    }


def _add_character(
    spec: mujoco.MjSpec, prefix: str, character: Character, settings: WorldSettings
) -> None:
    bodies = _add_body(spec, prefix, character.links, settings)
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
                solref=_stiffness(settings),
            )


def _mimic(mimic: Mimic) -> FloatArray:
    """A coupling as MuJoCo has it: a polynomial in the leader's position."""
    data = np.zeros(mujoco.mjNEQDATA)
    data[:2] = mimic.offset, mimic.multiplier
    return data


def _add_body(
    spec: mujoco.MjSpec, prefix: str, links: Sequence[Link], settings: WorldSettings
) -> list[mujoco.MjsBody]:
    """Add links with their shapes and the limits of their joints."""
    surface = _surface(settings, settings.link_friction * settings.link_friction)
    bodies = add_links(spec, links, prefix)
    for link, body in zip(links, bodies, strict=True):
        for joint in body.joints:
            joint.solref_friction = _joint_friction(settings)
            if np.isfinite(link.joint.lower):
                joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
                joint.range = (link.joint.lower, link.joint.upper)
                joint.solref_limit = _stiffness(settings, _LANDING)
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
