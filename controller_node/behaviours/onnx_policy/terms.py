"""The terms of an observation: what each is made of, as pure functions, and by name.

The names are those of Isaac Lab, mjlab and rsl_rl's exporters, where these have one. The base's
frame is that of the root's link in the URDF.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from controller_node.behaviours.onnx_policy.motion import Pose, TrackedMotion
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.geometry import rotations, scalars

QUATERNIONS = ("xyzw", "wxyz")
"""The orders that the entries of a quaternion can have."""
_DOWN = (0.0, 0.0, -1.0)
_XYZ = ("x", "y", "z")
_EACH_JOINT = ("{}",)


class Situation(NamedTuple):
    """What terms are computed of; m joints of the policy, in its order."""

    time: float  # s since the episode's first state
    position: FloatArray  # (n,)
    velocity: FloatArray  # (n,)
    entries: IntArray  # (m,) those of the joints among n
    default: FloatArray  # (m,) rad or m
    last_action: FloatArray  # (m,), zero before the first one
    command: tuple[float, float, float]  # m/s ahead, m/s and rad/s to the left
    motion: TrackedMotion
    anchor: Pose | None = None  # where the body is that a motion's anchor is to be


class TermOptions(NamedTuple):
    """What some terms must be told."""

    period: float = 0.0  # s, of a gait
    quaternion: str = ""  # order of a quaternion's entries, of `QUATERNIONS`


Computed: TypeAlias = Callable[[Situation, TermOptions], FloatArray]


@dataclass(frozen=True)
class Term:
    """A part of an observation, before clip, scale and history."""

    name: str
    compute: Computed
    axes: tuple[str, ...]  # what its entries are of, but for those of joints
    joints: tuple[str, ...]  # what as many entries as there are joints are of: `{}` is the name
    unit: str
    frame: str  # empty where it has none
    needs_base: bool = False  # that floats
    needs_period: bool = False
    needs_quaternion: bool = False
    needs_command: bool = False  # that steers
    needs_motion: bool = False  # whose poses are followed
    needs_anchor: bool = False  # that is a body of both the character and the motion

    def labels(self, joints: tuple[str, ...], options: TermOptions) -> list[str]:
        """What each of its entries is of: an axis, or a joint."""
        axes = options.quaternion if self.needs_quaternion else self.axes
        return [*axes, *(text.format(joint) for text in self.joints for joint in joints)]


TERMS: dict[str, Term] = {}


def _term(
    name: str,
    unit: str,
    *,
    axes: tuple[str, ...] = (),
    joints: tuple[str, ...] = (),
    frame: str = "",
    **needs: bool,
) -> Callable[[Computed], Computed]:
    """Decorate the function of a term."""

    def add(compute: Computed) -> Computed:
        TERMS[name] = Term(name, compute, axes, joints, unit, frame, **needs)
        return compute

    return add


def base_xyzw(position: FloatArray) -> scalars.Quaternion:
    """The orientation of the base in the world, of a position (n,)."""
    return scalars.exp(position[3:6].tolist())


def in_base(position: FloatArray, vector: tuple[float, float, float]) -> FloatArray:
    """A vector of the world in the frame of the base (3,)."""
    return np.array(scalars.rotate(scalars.conjugate(base_xyzw(position)), vector))


@_term("base_lin_vel", "m/s", axes=_XYZ, frame="base", needs_base=True)
def _base_lin_vel(seen: Situation, options: TermOptions) -> FloatArray:
    x, y, z = seen.velocity[:3].tolist()
    return in_base(seen.position, (x, y, z))


@_term("base_ang_vel", "rad/s", axes=_XYZ, frame="base", needs_base=True)
def _base_ang_vel(seen: Situation, options: TermOptions) -> FloatArray:
    return seen.velocity[3:6]  # a root's turn is in its own frame


@_term("projected_gravity", "1", axes=_XYZ, frame="base", needs_base=True)
def _projected_gravity(seen: Situation, options: TermOptions) -> FloatArray:
    return in_base(seen.position, _DOWN)


@_term("base_quat", "1", axes=tuple("xyzw"), frame="world", needs_base=True, needs_quaternion=True)
def _base_quat(seen: Situation, options: TermOptions) -> FloatArray:
    x, y, z, w = base_xyzw(seen.position)
    return np.array((x, y, z, w) if options.quaternion == "xyzw" else (w, x, y, z))


@_term("base_height", "m", axes=("z",), frame="world", needs_base=True)
def _base_height(seen: Situation, options: TermOptions) -> FloatArray:
    return seen.position[2:3]


@_term(
    "velocity_commands",
    "m/s, m/s, rad/s",
    axes=("ahead", "left", "turn"),
    frame="heading",
    needs_base=True,
    needs_command=True,
)
def _velocity_commands(seen: Situation, options: TermOptions) -> FloatArray:
    return np.array(seen.command)


@_term("gait_phase", "1", axes=("sine", "cosine"), needs_period=True)
def _gait_phase(seen: Situation, options: TermOptions) -> FloatArray:
    angle = math.tau * (seen.time % options.period / options.period)
    return np.array((math.sin(angle), math.cos(angle)))


@_term("joint_pos_rel", "rad or m", joints=_EACH_JOINT)
def _joint_pos_rel(seen: Situation, options: TermOptions) -> FloatArray:
    return seen.position[seen.entries] - seen.default


@_term("joint_pos_abs", "rad or m", joints=_EACH_JOINT)
def _joint_pos_abs(seen: Situation, options: TermOptions) -> FloatArray:
    return seen.position[seen.entries]


@_term("joint_vel_rel", "rad/s or m/s", joints=_EACH_JOINT)
def _joint_vel_rel(seen: Situation, options: TermOptions) -> FloatArray:
    return seen.velocity[seen.entries]


@_term("last_action", "1", joints=_EACH_JOINT)
def _last_action(seen: Situation, options: TermOptions) -> FloatArray:
    return seen.last_action


@_term("motion_joint_pos", "rad or m", joints=_EACH_JOINT, needs_motion=True)
def _motion_joint_pos(seen: Situation, options: TermOptions) -> FloatArray:
    return seen.motion.position


@_term("motion_joint_vel", "rad/s or m/s", joints=_EACH_JOINT, needs_motion=True)
def _motion_joint_vel(seen: Situation, options: TermOptions) -> FloatArray:
    return seen.motion.velocity


@_term(
    "motion_command",
    "rad or m, rad/s or m/s",
    joints=("position of {}", "velocity of {}"),
    needs_motion=True,
)
def _motion_command(seen: Situation, options: TermOptions) -> FloatArray:
    wanted = (_motion_joint_pos(seen, options), _motion_joint_vel(seen, options))
    return np.concatenate(wanted)


@_term("motion_anchor_pos_b", "m", axes=_XYZ, frame="anchor", needs_motion=True, needs_anchor=True)
def _motion_anchor_pos_b(seen: Situation, options: TermOptions) -> FloatArray:
    return _anchor(seen).position


@_term(
    "motion_anchor_ori_b",
    "1",
    axes=tuple(f"{of} of the motion's {axis}" for of in "xyz" for axis in "xy"),
    frame="anchor",
    needs_motion=True,
    needs_anchor=True,
)
def _motion_anchor_ori_b(seen: Situation, options: TermOptions) -> FloatArray:
    """The first two columns of a matrix, row by row (Zhou et al. 2019)."""
    return rotations.matrix(_anchor(seen).xyzw)[:, :2].ravel()


def _anchor(seen: Situation) -> Pose:
    """The motion's anchor in the frame of the character's."""
    assert seen.motion.anchor is not None and seen.anchor is not None
    return seen.motion.anchor.seen_from(seen.anchor)
