"""Passive forces of a character's joints: soft limits of ball joints, and `joint_resistance`.

A soft limit is a spring and a damper outside of bounds on the components of a joint's rotation
vector r. With e the excess of a component over its bound, the force against it is
`f = k e + c de/dt`, and never one that draws it further out. As `dr/dt = J w`, with w the angular
velocity in the child frame and J the inverse of the right Jacobian of SO(3), its torque in the
child frame is `-J^T f`. The spring's potential is `V = k/2 e^2`; the damper only takes energy.

A limb is light, and a spring that stops it in a few degrees is far too stiff to be explicit. So e
and de/dt are those at the end of the engine's step h, with the velocity that the forces lead to:
`f = k (e + h u) + c u`, `u = de/dt - h A f`, where `A = J M^-1 J^T` of all bounds together. That is
stable for any k and c at any h (implicit Euler; as Tan, Liu and Turk 2011 do it for control), and
as h goes to zero it is the law above. Other forces on the limb are not foreseen.

Of the two rotation vectors of a turn, r and the longer way round, the one nearer to the bounds
counts, so that nothing jumps where r does, at an angle of pi.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character, SoftLimit
from msgs_config.geometry import fixed_order, rotations, scalars
from msgs_config.geometry.scalars import Vector
from sim_node.physics.joint_resistance import JointResistance
from sim_node.physics.wrenches import ExternalWrench

_MOST_PIVOTS = 50
_COUPLING_ERROR = 1e-9  # rad or m that a follower may be off without a correction
_FORCE_ROUNDING = 1e-12  # share of a force that may be wrong without consequence


class PassiveForces:
    """The passive forces of one character, for an engine that adds them at each of its steps.

    `active` is true if there are any.
    """

    def __init__(self, character: Character, step_s: float, gravity: float) -> None:
        """For engine steps of `step_s`, and a gravity in m/s^2 along -z."""
        self._step_s, self._coupling = step_s, character.coupling
        self._has_floating_base = character.layout.has_floating_base
        self._rotation_entries = character.layout.rotation_entries[self._has_floating_base :]
        limited = [
            (character.layout.joint(joint.name).entries, joint.soft_limit)
            for joint in character.moving_joints
            if joint.soft_limit is not None
        ]
        # Each joint and its limit, with the bounds beside them, which each step asks for.
        self._limits = [(joint, *joint[1].lower, *joint[1].upper) for joint in limited]
        self.resistance = JointResistance(character, step_s)
        self.active = bool(self._limits or self.resistance.active)
        self._model = DynamicsModel(character, gravity) if self.active else None

    def effort(
        self,
        position: FloatArray,
        velocity: FloatArray,
        applied: FloatArray,
        pushes: Sequence[ExternalWrench] = (),
    ) -> FloatArray:
        """The passive effort (n,) in a state, message form; N m or N.

        `applied` (n,) is the effort of all motors in the coming step, which begins with `pushes`.
        """
        effort: FloatArray = np.zeros(len(velocity))
        bounds, rows = [], []
        turns, spins = position.tolist(), velocity.tolist()
        for entries, limit in self._near_limits(turns, spins):
            for bound in passed_bounds(limit, turns[entries], spins[entries], self._step_s):
                bounds.append(bound)
                rows.append(np.zeros(len(effort)))
                rows[-1][entries] = bound.row
        resists = self.resistance.active
        if self._model is None or not (bounds or resists):
            return effort
        self._model.update(position, velocity)
        if bounds:
            jacobian = np.array(rows)
            forces = complementary_forces(bounds, self._model.delassus_matrix(jacobian))
            effort -= fixed_order.apply(jacobian.T, forces)
        if resists:
            known = applied + effort + self._pushed(pushes)
            effort = effort + self.resistance.effort(self._model, position, velocity, known)
        return effort

    def couple(self, position: FloatArray, velocity: FloatArray) -> bool:
        """Change a state, each (n,), that a step has led to, so that followers follow; if it did.

        The engine's iterative solver leaves a rest where contacts press on light links. It is taken
        away by impulses between leaders and followers, and by what they would have moved.
        """
        moved, rate = self._coupling.violation(position), self._coupling.violation_rate(velocity)
        if max(np.abs(moved).max(), self._step_s * np.abs(rate).max()) <= _COUPLING_ERROR:
            return False
        assert self._model is not None
        self._model.update(position, velocity)
        correction = self._model.coupling_correction(moved, self._step_s)
        # The base stays where it is: the correction hardly alters its place.
        correction[: 6 * self._has_floating_base] = 0.0
        entries = self._rotation_entries
        turns = rotations.exp(position[entries])
        position += correction
        turned = rotations.multiply(turns, rotations.exp(correction[entries]))
        position[entries] = rotations.log(turned)
        velocity += self._model.coupling_correction(rate, self._step_s)
        return True

    def _pushed(self, pushes: Sequence[ExternalWrench]) -> FloatArray | float:
        """The generalised force (n,) of pushes, N m or N."""
        assert self._model is not None
        force: FloatArray | float = 0.0
        for push in pushes:
            origins, axes = self._model.link_frames(np.array([push.link]))
            point = origins[0] + fixed_order.apply(axes[0], push.point)
            jacobian = self._model.point_jacobian(push.link, point)
            force = force + fixed_order.apply(jacobian.T, push.wrench)
        return force

    def _near_limits(
        self, turns: Sequence[float], spins: Sequence[float]
    ) -> list[tuple[slice, SoftLimit]]:
        """The limits that some component of a rotation vector is beyond, or within reach of.

        Of all joints' rotation vectors (n,) in rad and angular velocities (n,) in rad/s.
        """
        # up to two thirds of a turn a rotation vector is less than twice as fast as its joint
        near, twice_step, root = [], 2.0 * self._step_s, math.sqrt
        for joint, ax, ay, az, bx, by, bz in self._limits:
            entries = joint[0]
            u, v, w = spins[entries]
            reach = twice_step * root(u * u + v * v + w * w)
            x, y, z = turns[entries]
            below = x < ax + reach or y < ay + reach or z < az + reach
            if below or x > bx - reach or y > by - reach or z > bz - reach:
                near.append(joint)
        return near


class PassedBound(NamedTuple):
    """A bound of a soft limit that a joint is beyond, or is about to pass."""

    row: Vector  # row of J, outwards: `de/dt = row . w`, w the angular velocity in the child frame
    explicit: float  # N m, the force if nothing yielded
    implicit: float  # N m s^2/rad, what each rad/s^2 of yielding takes away of it


def passed_bounds(
    limit: SoftLimit, turn: Sequence[float], spin: Sequence[float], step_s: float
) -> Iterator[PassedBound]:
    """The bounds that a joint is beyond, or will be in a step, and that push it back.

    Its rotation vector (3,) in rad, its angular velocity (3,) in the child frame in rad/s.
    """
    turn = closest_rotation_vector(turn, limit)
    jacobian = scalars.right_jacobian_inverse(turn)
    rates = scalars.to_parent(jacobian, spin)
    for part, rate, row, lower, upper in zip(
        turn, rates, jacobian, limit.lower, limit.upper, strict=True
    ):
        outward = math.copysign(1.0, 2.0 * (part + step_s * rate) - lower - upper)
        excess = outward * (part - (upper if outward > 0.0 else lower))
        following = excess + step_s * outward * rate
        explicit = limit.stiffness * following + limit.damping * outward * rate
        if max(excess, following) > 0.0 and explicit > 0.0:
            across, along, about = row
            yield PassedBound(
                (outward * across, outward * along, outward * about),
                explicit,
                step_s * (limit.stiffness * step_s + limit.damping),
            )


def closest_rotation_vector(turn: Sequence[float], limit: SoftLimit) -> Sequence[float]:
    """Of a rotation vector (3,) and the longer way round the one nearer to a limit's bounds."""
    x, y, z = turn
    angle = math.sqrt(x * x + y * y + z * z)
    if not angle:
        return turn
    factor = 1.0 - 2.0 * math.pi / angle
    long_way = (factor * x, factor * y, factor * z)
    return long_way if _squared_excess(long_way, limit) < _squared_excess(turn, limit) else turn


def _squared_excess(turn: Sequence[float], limit: SoftLimit) -> float:
    """The squared distance in rad^2 of a rotation vector (3,) from a limit's bounds."""
    square = 0.0
    for part, lower, upper in zip(turn, limit.lower, limit.upper, strict=True):
        beyond = max(part - upper, lower - part, 0.0)
        square += beyond * beyond
    return square


def complementary_forces(bounds: Sequence[PassedBound], delassus: FloatArray) -> FloatArray:
    """Forces (m,) in N m that push at bounds and never draw: `f = max(0, explicit - implicit A f)`.

    `delassus` (m, m) is A, symmetrical: the accelerations that a unit of each force leads to. With
    all bounds pushing it is one linear system. A bound that would draw leaves it, one that lacks a
    push enters, the first such one at a time: that finds the one solution (Murty 1974, "Note on a
    Bard-type Scheme for Solving the Complementarity Problem").
    """
    coupling = [
        [bound.implicit * entry for entry in row]
        for bound, row in zip(bounds, delassus.tolist(), strict=True)
    ]
    pushing = [True] * len(bounds)
    forces = [0.0] * len(bounds)
    for _ in range(_MOST_PIVOTS):
        forces = _forces_of(bounds, coupling, pushing)
        for number, bound in enumerate(bounds):
            if pushing[number]:
                wrong = forces[number] < 0.0
            else:
                yielded = _dot(coupling[number], forces)
                wrong = bound.explicit - yielded > _FORCE_ROUNDING * bound.explicit
            if wrong:
                pushing[number] = not pushing[number]
                break
        else:
            break
    return np.maximum(forces, 0.0)


def _forces_of(
    bounds: Sequence[PassedBound], coupling: Sequence[Sequence[float]], pushing: Sequence[bool]
) -> list[float]:
    """The forces of the bounds that push, `(1 + coupling) f = explicit`; the others' are zero.

    By elimination; the matrix is similar to a positive definite one, so no pivots are looked for.
    """
    chosen = [number for number, pushes in enumerate(pushing) if pushes]
    rows = [[coupling[i][j] + (i == j) for j in chosen] + [bounds[i].explicit] for i in chosen]
    for place, row in enumerate(rows):
        for other in rows[place + 1 :]:
            share = other[place] / row[place]
            for column in range(place + 1, len(row)):
                other[column] -= share * row[column]
    forces = [0.0] * len(bounds)
    for place in range(len(chosen) - 1, -1, -1):
        row = rows[place]
        known = row[-1]
        for later in range(place + 1, len(chosen)):
            known -= row[later] * forces[chosen[later]]
        forces[chosen[place]] = known / row[place]
    return forces


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    product = 0.0
    for one, other in zip(a, b, strict=True):
        product += one * other
    return product
