"""Linear feedback from balance to the hips and ankles of what is tracked. It has no memory.

What a walker deviates in from its motion, its balance features, is turned into a response: rotation
vectors that are added to the tracking errors of hips and ankles. That of the leg that swings places
the foot elsewhere, that of the leg that stands holds the root upright and shifts the pressure below
the sole. Which leg swings, the motion says.

Sources: Yin, Loken and van de Panne 2007, "SIMBICON" (the foot's placement); Liu, van de Panne and
Yin 2016, "Guided Learning of Control Graphs" (feedback linear in such features, fitted to samples).
"""

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Protocol, TypeAlias

import numpy as np

from controller_node.feedback_gains import FeedbackGains
from controller_node.references.base import Reference, ReferenceState
from msgs_config import rotations
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character import Character, Joint
from msgs_config.dynamics import DynamicsModel
from msgs_config.errors import CharacterError
from msgs_config.geometry import fixed_order
from msgs_config.joint_layout import JointType

_LIFTED = 0.06  # m by which one foot is above the other when it alone swings
_LARGEST = 0.6  # rad
_LEG = [JointType.SPHERICAL, JointType.REVOLUTE, JointType.SPHERICAL]

Numbers: TypeAlias = list[float]


@dataclass(frozen=True)
class _Balance:
    """What the features are made of, in the world unless said otherwise."""

    centre: Numbers  # (3,) m
    velocity: Numbers  # (3,) m/s
    feet: list[Numbers]  # (2, 3) m
    root_xyzw: Numbers  # (4,)
    spin: Numbers  # (3,) in the base frame, rad/s


@dataclass(frozen=True)
class _Wanted:
    """The motion at a time, as the features are measured against it."""

    balance: _Balance
    swings: tuple[float, float]  # how much each leg swings, the rest of it stands
    cosine: float  # of the root's heading
    sine: float
    shares: FloatArray  # (2, 2, 1): how much each leg stands; how much it swings
    arm: tuple[float, float]  # of the centre of mass from the foot that stands, m

    def ahead_and_left(self, x: float, y: float) -> tuple[float, float]:
        """A horizontal vector of the world as the root sees it."""
        return self.cosine * x + self.sine * y, self.cosine * y - self.sine * x


class Feedback:
    """The feedback of a character about a motion, a function of time and state."""

    def __init__(
        self, character: Character, motion: Reference, gains: FeedbackGains, *, known_ticks: int = 0
    ) -> None:
        """Find the legs: those of the two links that the character stands on.

        Of `known_ticks` the motion's features are kept, for who asks for them more than once.

        Raises:
            CharacterError: its base is fixed, or a leg is not a ball joint, a hinge, a ball joint.
        """
        if not character.layout.has_floating_base or len(character.feet) != 2:
            raise CharacterError(f"{character.file}: feedback needs a floating base and 'feet'")
        self._layout = character.layout
        self._model = DynamicsModel(character)
        names = [link.name for link in character.links]
        self._feet = np.array([names.index(foot) for foot in character.feet])
        self._entries = np.array([_leg(character, int(foot)) for foot in self._feet])  # (2, 7)
        self._sides = self._sides_at(np.array(character.rest_position))
        self._set(gains)
        self._motion = motion
        self._known = lru_cache(maxsize=known_ticks)(self._of_motion)

    def with_gains(self, gains: FeedbackGains) -> "Feedback":
        """The same with other gains; both share what they know of the motion."""
        other = copy(self)
        other._set(gains)
        return other

    def _set(self, gains: FeedbackGains) -> None:
        matrices = np.stack((gains.stance, gains.swing))
        self._gains = np.concatenate((gains.stance[:, :-1], gains.swing[:, :-1]))
        of_sides = np.multiply.outer(self._sides, matrices[:, :, -1])
        self._of_sides = of_sides.swapaxes(0, 1)  # (2, 2, 7)

    def begin_episode(self) -> None:
        """Nothing: it has no memory."""

    def response(self, time: float, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """What is added to the tracking errors (n,) of a state at a time in s, rad."""
        wanted, state = self._known(time), self._balance(position, velocity)
        motion = wanted.balance
        (cx, cy, cz), (vx, vy, vz) = state.centre, state.velocity
        (mx, my, mz), (ux, uy, uz) = motion.centre, motion.velocity
        arm_x, arm_y = wanted.ahead_and_left(*_arm(state, wanted.swings))
        features = np.array(
            (
                *wanted.ahead_and_left(cx - mx, cy - my),
                cz - mz,
                *wanted.ahead_and_left(vx - ux, vy - uy),
                vz - uz,
                arm_x - wanted.arm[0],
                arm_y - wanted.arm[1],
                *_turn(motion.root_xyzw, state.root_xyzw),
                *(spin - other for spin, other in zip(state.spin, motion.spin, strict=True)),
                1.0,
            )
        )
        outputs = fixed_order.apply(self._gains, features).reshape(2, -1)
        stance, swing = outputs[:, np.newaxis] + self._of_sides
        wish = wanted.shares[0] * stance + wanted.shares[1] * swing
        response = np.zeros(self._layout.size)
        response[self._entries] = np.minimum(np.maximum(wish, -_LARGEST), _LARGEST)
        return response

    def _sides_at(self, position: FloatArray) -> list[float]:
        """Which foot is on the left of the root in a position: 1, the other's is -1."""
        balance = self._balance(position, np.zeros(self._layout.size))
        heading = float(rotations.yaw(np.array(balance.root_xyzw)))
        left = [math.cos(heading) * y - math.sin(heading) * x for x, y, _ in balance.feet]
        return [1.0, -1.0] if left[0] > left[1] else [-1.0, 1.0]

    def _of_motion(self, time: float) -> _Wanted:
        state = self._motion.sample(time)
        balance = self._balance(state.configuration.position, state.velocity)
        lift = balance.feet[0][2] - balance.feet[1][2]
        share = min(max(0.5 + 0.5 * lift / _LIFTED, 0.0), 1.0)
        heading = float(rotations.yaw(np.array(balance.root_xyzw)))
        cosine, sine = math.cos(heading), math.sin(heading)
        swings = (share, 1.0 - share)
        shares = np.array(([1.0 - swing for swing in swings], swings))[..., np.newaxis]
        plain = _Wanted(balance, swings, cosine, sine, shares, (0.0, 0.0))
        arm = plain.ahead_and_left(*_arm(balance, plain.swings))
        return replace(plain, arm=arm)

    def _balance(self, position: FloatArray, velocity: FloatArray) -> _Balance:
        model = self._model
        model.update(position, velocity)
        points, _ = model.link_frames(self._feet)
        return _Balance(
            model.centre_of_mass().tolist(),
            model.centre_of_mass_velocity().tolist(),
            points.tolist(),
            _quaternion(position[3:6].tolist()),
            velocity[3:6].tolist(),
        )


class Responding(Protocol):
    """A feedback: a function of time and state, and of what it has seen of the episode."""

    def begin_episode(self) -> None:
        """Forget what was seen."""

    def response(self, time: float, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """What is added to the tracking errors (n,) of a state at a time in s, rad."""


class RespondingReference:
    """A reference with feedback: its desired states, and the response to the state it is in."""

    def __init__(self, reference: Reference, *feedbacks: Responding) -> None:
        """Responses of several feedbacks add up."""
        self._reference, self._feedbacks = reference, feedbacks

    def sample(self, time: float) -> ReferenceState:
        """The desired state."""
        return self._reference.sample(time)

    def begin_episode(self) -> None:
        """Have the feedbacks forget what they have seen."""
        for feedback in self._feedbacks:
            feedback.begin_episode()

    def response(self, time: float, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """What is added to the tracking errors (n,) of a state at a time in s, rad."""
        first, *others = (one.response(time, position, velocity) for one in self._feedbacks)
        for other in others:
            first = first + other
        return first


def responding(reference: Reference, feedbacks: Sequence[Responding]) -> Reference:
    """A reference with feedbacks; without any the reference itself."""
    return RespondingReference(reference, *feedbacks) if feedbacks else reference


def _arm(balance: _Balance, swings: tuple[float, float]) -> tuple[float, float]:
    """The centre of mass from the foot that stands, or from between both: x and y in m."""
    (rx, ry, _), (lx, ly, _) = balance.feet
    right, left = 1.0 - swings[0], 1.0 - swings[1]
    x, y, _ = balance.centre
    return x - right * rx - left * lx, y - right * ry - left * ly


def _quaternion(rotation_vector: Numbers) -> Numbers:
    """`rotations.exp` of one vector: in plain numbers it takes a fraction of the time."""
    x, y, z = rotation_vector
    half = 0.5 * math.sqrt(x * x + y * y + z * z)
    factor = 0.5 * math.sin(half) / half if half else 0.5
    return [x * factor, y * factor, z * factor, math.cos(half)]


def _turn(start_xyzw: Numbers, end_xyzw: Numbers) -> tuple[float, float, float]:
    """The rotation vector in rad that leads from one orientation to another, in the first's frame.

    As `rotations.log` of `q_start^-1 q_end`.
    """
    ax, ay, az, aw = start_xyzw
    bx, by, bz, bw = end_xyzw
    x = aw * bx - ax * bw - ay * bz + az * by
    y = aw * by + ax * bz - ay * bw - az * bx
    z = aw * bz - ax * by + ay * bx - az * bw
    w = aw * bw + ax * bx + ay * by + az * bz
    sine = math.sqrt(x * x + y * y + z * z)
    angle = 2.0 * math.atan2(sine, abs(w))
    factor = math.copysign(angle / sine, w) if sine else 0.0
    return x * factor, y * factor, z * factor


def _leg(character: Character, foot: int) -> IntArray:
    """The entries (7,) of the hip, the knee and the ankle above a foot."""
    chain: list[Joint] = []
    link = foot
    while link > 0:
        joint = character.links[link].joint
        if joint.type is not JointType.FIXED:
            chain.insert(0, joint)
        link = character.links[link].parent
    if [joint.type for joint in chain] != _LEG:
        raise CharacterError(
            f"{character.file}: feedback needs a hip, a knee and an ankle above "
            f"'{character.links[foot].name}': a ball joint, a hinge, a ball joint"
        )
    layout = character.layout
    entries: IntArray = np.concatenate([np.r_[layout.joint(joint.name).entries] for joint in chain])
    return entries
