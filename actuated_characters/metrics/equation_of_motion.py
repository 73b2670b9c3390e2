"""The residual of the equation of motion, tick by tick.

    M (v' - v) / h + C = f + J^T w + J^T p

is the lecture's equation (GAMES 105, lecture 9) as the engine steps it: M, C and every J are those
of the state that a tick begins with, v' is the velocity that it ends with, h its length, f the
effort that was applied, w the contacts' wrenches on the links and p the pushes. All of these are
on the topics, and with them the equation holds to rounding. The residual is what no topic carries:
the effort of a joint's limit that has been reached, on that joint's entry, and the torque of
rolling and spinning friction, where a URDF asks for it.

It holds for one substep: with more, a tick has a state in between for each.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from sim_node.physics.passive_forces import PassiveForces
from sim_node.physics.wrenches import ExternalWrench

_MAX_RESIDUAL = 1e-4
"""rad or m from a limit at which it may act: the engine's solver is iterative."""


@dataclass(frozen=True)
class MotionResidual:
    """The parts of the equation of one tick, generalised forces (n,): N or N m an entry."""

    inertial: FloatArray  # M (v' - v) / h
    bias: FloatArray  # C: Coriolis, centrifugal and gravity forces, less passive joint forces
    applied: FloatArray  # f
    contact: FloatArray  # J^T w
    pushed: FloatArray  # J^T p
    limited: BoolArray  # (n,) whether it is at its limit at the tick's end, rubs or is coupled

    @property
    def residual(self) -> FloatArray:
        """The residual (n,): `M (v' - v) / h + C - f - J^T w - J^T p`."""
        return self.inertial + self.bias - self.applied - self.contact - self.pushed

    @property
    def limits(self) -> FloatArray:
        """The part of the residual (n,) that is the effort of joint limits."""
        return np.where(self.limited, self.residual, 0.0)

    @property
    def largest(self) -> float:
        """Norm of the largest part."""
        parts = (self.inertial, self.bias, self.applied, self.contact, self.pushed)
        return max(float(np.linalg.norm(part)) for part in parts)

    @property
    def relative(self) -> float:
        """Norm of the residual, without limits, over that of the largest part; 0 if all are 0."""
        return float(np.linalg.norm(self.residual - self.limits)) / (self.largest or 1.0)


class EquationOfMotion:
    """The equation of one character's ticks."""

    def __init__(self, character: Character, gravity: float, rate_hz: int) -> None:
        """For a gravity in m/s^2 along -z, and `rate_hz` ticks of one engine step a second."""
        self._layout = character.layout
        self._period = 1.0 / rate_hz
        self._model = DynamicsModel(character, gravity)
        self._damping = character.passive_damping()
        self._lower, self._upper = character.position_bounds()
        self._passive = PassiveForces(character, self._period, gravity)
        self._constrained = _constrained(character)
        poses = [link.inertial_pose for link in character.links]
        self._offsets = np.array([pose.position for pose in poses])  # (links, 3) m, link frames

    def balance(
        self,
        position: FloatArray,  # (n,) of the state that the tick begins with, message form
        velocity: FloatArray,  # (n,)
        effort: FloatArray,  # (n,) applied: `effort` of the state that the tick leads to
        next_velocity: FloatArray,  # (n,) of the state that the tick leads to
        contacts: FloatArray,  # (links, 6) N, N m; world axes, at the centres of mass
        pushes: Sequence[ExternalWrench] = (),
    ) -> MotionResidual:
        """The parts of the equation of one tick."""
        model = self._model
        model.update(position, velocity)
        acceleration = self._acceleration(position, velocity, next_velocity)
        # the simulator's own passive forces: damping and friction are implicit, limits soft
        passive = self._passive.effort(position, velocity, effort, pushes)
        # The position at the tick's end, of hinges and sliders; of the others it does not count.
        reached = position + self._period * next_velocity
        return MotionResidual(
            inertial=model.mass_matrix() @ acceleration,
            bias=model.bias_force() - self._damping * velocity - passive,
            applied=effort,
            contact=self._generalised(contacts),
            pushed=self._generalised(self._at_centres(pushes)),
            limited=(reached < self._lower + _MAX_RESIDUAL)
            | (reached > self._upper - _MAX_RESIDUAL)
            | self._constrained,
        )

    def _acceleration(
        self, position: FloatArray, velocity: FloatArray, next_velocity: FloatArray
    ) -> FloatArray:
        """The acceleration (n,) at the begin of a tick that has led to a velocity at its end.

        It is the difference quotient, but where a floating base's centre of mass is off its origin
        by c: the engine adds `h a` to the velocity `v + w x c` of the centre, and c turns
        meanwhile. With `w' - w = h b` the origin's own acceleration is
        `((v' + w' x c') - (v + w x c)) / h - b x c - w x (w x c)`.
        """
        period = self._period
        acceleration = (next_velocity - velocity) / period
        offset = self._offsets[0]
        if not (self._layout.has_floating_base and offset.any()):
            return acceleration
        turn = rotations.matrix(rotations.exp(position[3:6]))
        spin, next_spin = turn @ velocity[3:6], turn @ next_velocity[3:6]
        # the base turns by the new angular velocity, which the turn does not change
        turned = rotations.exp(period * next_velocity[3:6])
        centre, next_centre = turn @ offset, turn @ rotations.rotate(turned, offset)
        change = np.cross(next_spin, next_centre) - np.cross(spin, centre)
        acceleration[:3] += change / period
        acceleration[:3] -= np.cross((next_spin - spin) / period, centre)
        acceleration[:3] -= np.cross(spin, np.cross(spin, centre))
        return acceleration

    def _at_centres(self, pushes: Sequence[ExternalWrench]) -> FloatArray:
        """The wrenches (links, 6) of pushes, moved to the links' centres of mass."""
        wrenches = np.zeros((len(self._offsets), 6))
        _, turns = self._model.link_poses()
        for push in pushes:
            arm = rotations.rotate(turns[push.link], push.point - self._offsets[push.link])
            wrenches[push.link] += push.wrench
            wrenches[push.link, 3:] += np.cross(arm, push.wrench[:3])
        return wrenches

    def _generalised(self, wrenches: FloatArray) -> FloatArray:
        """The generalised force (n,) of wrenches (links, 6) at the links' centres of mass."""
        force = np.zeros(self._layout.size)
        for link in np.flatnonzero(wrenches.any(axis=1)).tolist():
            force += self._model.link_jacobian(link).T @ wrenches[link]
        return force


def _constrained(character: Character) -> BoolArray:
    """Which entries (n,) have friction or a coupling, by which the engine answers to contacts."""
    joints, coupling = character.moving_joints, character.coupling
    mask = character.layout.mask(joint.name for joint in joints if joint.friction)
    mask[coupling.followers] = mask[coupling.leaders] = True
    return mask
