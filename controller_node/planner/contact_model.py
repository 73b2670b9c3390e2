"""The model of the world that the planner looks ahead in: MuJoCo with ground, contact and limits.

It is built from the same description as everything else. Its law, its passive damping and its soft
limits are those of controller and simulator (`controller_node.planner.compiled`). Its contacts are
softer than any world's, so what is foreseen is not quite what will be; or they are those of engine
MuJoCo's world.
"""

from collections.abc import Iterator, Sequence
from itertools import product

import mujoco
import numpy as np

from controller_node.control_laws import GainArrays
from controller_node.ground import FELT, ground_shapes
from controller_node.planner.compiled.features import FeatureLayout, Watched
from controller_node.planner.compiled.law import Joints
from controller_node.planner.compiled.rollout import EngineBuffers, RolloutModel
from controller_node.planner.settings import OWN_CONTACTS, PlannerParameters
from msgs_config.arrays import FloatArray
from msgs_config.character.extents import farthest
from msgs_config.character.model import Character, Link, Shape
from msgs_config.character.mujoco_model import (
    add_links,
    ancestors,
    compile_for_contacts,
    geometry,
    quaternion_starts,
)
from msgs_config.character.mujoco_world import Contacts, add_character, add_ground, set_options
from msgs_config.character.terrain import is_plane
from msgs_config.compiled.data_layout import data_fields, raw_data
from msgs_config.compiled.law import LawGains
from msgs_config.compiled.mass_matrix import MassMatrix, Tree
from msgs_config.compiled.soft_limits import SoftLimits, make_soft_limits
from msgs_config.geometry import rotations
from msgs_config.shared_parameters import LINK_FRICTION

_SOLVER_ITERATIONS = 6
_CONTACT = (0.015, 3.0)  # time constant in s and damping ratio: what lands stays, as in the world
_LIMIT = (0.01, 1.0)  # time constant in s and damping ratio of the limits of hinges and sliders

_UNUSED_PARTS = ("AUTORESET", "ISLAND", "SPRING", "DAMPER", "ACTUATION", "SENSOR")  # MuJoCo's parts

_STANDS = 0.05  # of the weight, upwards on a foot that stands, at least

_GROUND = "ground"
_DOWN = np.array((0.0, 0.0, -1.0))
_PLANE = {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": (0.0, 0.0, 1.0)}
_BY_PAIRS = {"contype": 0, "conaffinity": 0}  # explicit pairs say which shapes may touch
_TERRAIN, _ON_TERRAIN = {"contype": 1, "conaffinity": 0}, {"contype": 0, "conaffinity": 1}
_TERRAIN_PRIORITY = 1  # MuJoCo takes friction and stiffness of the shape with the higher one


class ContactModel:
    """A character with a floating base on the ground, simulated step by step.

    Positions are MuJoCo's (q,): rotations as quaternions wxyz; velocities (n,) are the layout's.
    """

    def __init__(
        self,
        character: Character,
        *,
        period_s: float,
        gravity: float,
        friction: float,
        contact: str = OWN_CONTACTS,
        terrain: Sequence[Shape] = (),
        plane_each: bool = False,
    ) -> None:
        """Build the model; `friction` is that of a contact, the product of both surfaces'.

        Without the shapes of a terrain the ground is the plane z = 0, which `put_planes` puts
        elsewhere for each foot if there is a plane for each.
        """
        self._character = character
        self._period_s = period_s
        self._has_own_contacts = contact == OWN_CONTACTS
        own_planes = [character.links[each].name for each in _feet(character) if plane_each]
        world = (character, period_s, gravity, friction, terrain)
        self._model = (
            _compile(*world, own_planes) if self._has_own_contacts else _compile_world(*world)
        )
        self._planes = [self._model.geom(_plane_of(foot)).id for foot in own_planes]
        self.put_planes(np.zeros(len(own_planes)))
        self._looked_at = mujoco.MjData(self._model)
        self._data: list[mujoco.MjData] = []
        self._identity = np.zeros(self._model.nq)
        self._identity[quaternion_starts(self._model)] = 1.0
        self.left = _left_axis(character)
        """The root's axis (3,), in its frame, that points to the left while it stands."""
        self._tree = Tree(
            self._model.M_rowadr.astype(np.intp),
            self._model.M_rownnz.astype(np.intp),
            self._model.M_colind.astype(np.intp),
            (self._model.M_rowadr + self._model.M_rownnz - 1).astype(np.intp),
        )
        self._joints = self._find_joints()
        self._limits = self._find_limits()

    @classmethod
    def of(
        cls, character: Character, given: PlannerParameters, step_ticks: int = 1
    ) -> "ContactModel":
        """The model that a planner's parameters say, whose step is so many ticks."""
        return cls(
            character,
            period_s=step_ticks / given.rate_hz,
            gravity=given.gravity,
            friction=given.friction,
            contact=given.contact,
            terrain=ground_shapes(given.terrain),
            plane_each=given.terrain == FELT,
        )

    def put_planes(self, heights: FloatArray) -> None:
        """Put the plane of each foot, if it has one, at a height (f,) in m.

        Nothing may be rolled out meanwhile.
        """
        if self._planes:
            self._model.geom_pos[self._planes, 2] = heights

    def soles(self, position: FloatArray, contacts: FloatArray) -> FloatArray:
        """Heights (f,) of the soles that stand in a position (q,), m; NaN of others.

        `contacts` are the net wrenches (links, 6) that act on the links, N and N m, world axes.
        """
        data = self._looked_at
        data.qpos[:] = position
        mujoco.mj_kinematics(self._model, data)
        weight = self._character.mass * -self._model.opt.gravity[2]
        heights = []
        for index in _feet(self._character):
            turn = rotations.xyzw_from_wxyz(data.xquat[index + 1])
            shapes = self._character.links[index].collision_shapes
            below = max((farthest(each, turn, _DOWN) for each in shapes), default=0.0)
            stands = contacts[index, 2] > _STANDS * weight
            heights.append(data.xpos[index + 1, 2] - below if stands else np.nan)
        return np.array(heights)

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model."""
        return self._model

    @property
    def feature_layout(self) -> FeatureLayout:
        """Where the parts of features are."""
        return FeatureLayout(self._character.layout.size - 6, len(self._character.end_effectors))

    @property
    def feature_count(self) -> int:
        """Length f of a row of `write_features`."""
        return self.feature_layout.size

    def position_of(self, position: FloatArray) -> FloatArray:
        """A position (n,), message form, as MuJoCo has it (q,)."""
        found: FloatArray = self._identity.copy()
        mujoco.mj_integratePos(self._model, found, position, 1.0)
        return found

    def message_position(self, position: FloatArray) -> FloatArray:
        """A position (n,), message form, of what MuJoCo has (q,)."""
        found = np.zeros(self._model.nv)
        mujoco.mj_differentiatePos(self._model, found, 1.0, self._identity, position)
        return found

    def body(self, gains: GainArrays) -> RolloutModel:
        """What rollouts need of the character and its gains; the root's do not count."""
        layout = self._character.layout
        actuated = np.arange(layout.size) >= 6
        law = LawGains(
            self._period_s,
            np.where(actuated, gains.stiffness, 0.0),
            np.where(actuated, gains.damping, 0.0),
            self._character.passive_damping(),
            gains.effort_limits.astype(float),
            layout.vector_starts,
            layout.vector_lengths,
        )
        watched = Watched(
            np.array(self._character.end_effectors, dtype=np.intp) + 1, self._character.mass
        )
        own = self._has_own_contacts
        return RolloutModel(self._tree, self._joints, self._limits, law, watched, own)

    def engine(self) -> EngineBuffers:
        """Something that simulates it, for one thread."""
        data, law = mujoco.MjData(self._model), mujoco.MjData(self._model)
        self._data += [data, law]  # they must outlive what points into them
        model = self._model._address
        return EngineBuffers(
            model,
            data._address,
            data.qpos,
            data.qvel,
            data.qacc_warmstart,
            data.qfrc_applied,
            data.qfrc_bias,
            MassMatrix(model, data._address, data.M),
            MassMatrix(model, law._address, law.M),
            data.xpos,
            data.subtree_com,
            data.qacc_smooth,
            data_fields(),
            raw_data(data),
        )

    def _find_joints(self) -> Joints:
        model = self._model
        balls = np.flatnonzero(model.jnt_type == int(mujoco.mjtJoint.mjJNT_BALL))
        scalars = np.flatnonzero(model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE))
        return Joints(
            model.jnt_qposadr[balls].astype(np.intp),
            model.jnt_dofadr[balls].astype(np.intp),
            model.jnt_qposadr[scalars].astype(np.intp),
            model.jnt_dofadr[scalars].astype(np.intp),
        )

    def _find_limits(self) -> SoftLimits:
        model = self._model
        limited = [
            (model.joint(joint.name), joint.soft_limit)
            for joint in self._character.moving_joints
            if joint.soft_limit is not None
        ]
        return make_soft_limits(
            [limit for _, limit in limited],
            [joint.qposadr[0] for joint, _ in limited],
            [joint.dofadr[0] for joint, _ in limited],
        )


def _left_axis(character: Character) -> FloatArray:
    """By the rest pose, which faces along x where no placement has turned it."""
    standing = rotations.exp(np.array(character.rest_position[3:6]))
    upright = rotations.multiply(rotations.about_z(-character.placement.yaw), standing)
    left: FloatArray = rotations.rotate(rotations.conjugate(upright), np.array((0.0, 1.0, 0.0)))
    return left


def _compile(
    character: Character,
    period_s: float,
    gravity: float,
    friction: float,
    terrain: Sequence[Shape],
    own_planes: Sequence[str],
) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False  # limits are in rad
    option = spec.option
    option.gravity = (0.0, 0.0, -gravity)
    option.timestep = period_s
    option.solver = mujoco.mjtSolver.mjSOL_PGS
    option.iterations = _SOLVER_ITERATIONS
    option.tolerance = 0.0  # always the same number of iterations
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.disableflags = sum(
        int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{part}")) for part in _UNUSED_PARTS
    )
    contact = {"condim": 3, "solref": _CONTACT}
    for shape in terrain:
        each = {**_plane_or(shape, spec), **contact, "friction": (friction, 0.0, 0.0)}
        spec.worldbody.add_geom(**each, priority=_TERRAIN_PRIORITY, **_TERRAIN)
    if not terrain:
        spec.worldbody.add_geom(**_PLANE, name=_GROUND, **_BY_PAIRS)
        for foot in own_planes:  # not in the world's own frame: MuJoCo would keep it there
            place = (0.0, 0.0, -1.0)
            spec.worldbody.add_geom(**_PLANE, pos=place, name=_plane_of(foot), **_BY_PAIRS)
    for link, body in zip(character.links, add_links(spec, character.links), strict=True):
        if np.isfinite(link.joint.lower):
            (joint,) = body.joints
            joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
            joint.range = (link.joint.lower, link.joint.upper)
            joint.solref_limit = _LIMIT
        for name, shape in zip(_names(link), link.collision_shapes, strict=True):
            touched = _ON_TERRAIN if terrain else _BY_PAIRS
            body.add_geom(name=name, **geometry(spec, shape), **touched)
    for one, other in _touching(character, () if terrain else (_GROUND,), own_planes):
        pair = spec.add_pair(geomname1=one, geomname2=other, **contact)
        pair.friction = (friction, friction, 0.0, 0.0, 0.0)
    return compile_for_contacts(spec, character.links)


def _plane_or(shape: Shape, spec: mujoco.MjSpec) -> dict[str, object]:
    """A terrain's shape as MuJoCo has it; what stands for a plane as a plane."""
    if not is_plane(shape):
        return geometry(spec, shape)
    turn = np.array(shape.pose.orientation_xyzw)
    top = np.array((0.0, 0.0, 0.5 * shape.size[2]))
    place = np.array(shape.pose.position) + rotations.rotate(turn, top)
    return {**_PLANE, "pos": place, "quat": rotations.wxyz_from_xyzw(turn)}


def _compile_world(
    character: Character,
    period_s: float,
    gravity: float,
    friction: float,
    terrain: Sequence[Shape],
) -> mujoco.MjModel:
    """As engine MuJoCo has it with its defaults, where a step is a tick."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False  # limits are in rad
    contacts = Contacts(period_s, friction, LINK_FRICTION * LINK_FRICTION)
    set_options(spec.option, contacts, gravity)
    add_ground(spec, contacts, plane=not terrain, shapes=terrain)
    add_character(spec, "", character, contacts)
    return compile_for_contacts(spec, character.links)


def _names(link: Link) -> list[str]:
    """Names of a link's shapes."""
    return [f"{link.name} {number}" for number in range(len(link.collision_shapes))]


def _feet(character: Character) -> list[int]:
    """The links of the feet, in the order of the end effectors."""
    links = character.links
    return [index for index in character.end_effectors if links[index].name in character.feet]


def _plane_of(foot: str) -> str:
    return f"{_GROUND} below {foot}"


def _touching(
    character: Character, ground: Sequence[str], own_planes: Sequence[str]
) -> Iterator[tuple[str, str]]:
    """Pairs of shapes that may touch: with the ground, and with those of links not above them."""
    links = character.links
    for index, link in enumerate(links):
        below = (_plane_of(link.name),) if link.name in own_planes else ground
        yield from product(_names(link), below)
        if character.loading.self_collision:
            above = ancestors(character, index)
            for other in (other for other in range(index) if other not in above):
                yield from product(_names(link), _names(links[other]))
