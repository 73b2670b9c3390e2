"""Passive forces of a character's joints: soft limits of ball joints, and `joint_resistance`."""

from collections.abc import Sequence

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.geometry import fixed_order, rotations
from sim_node.physics.joint_resistance import JointResistance
from sim_node.physics.soft_limits import SoftLimitForces
from sim_node.physics.wrenches import ExternalWrench

_COUPLING_ERROR = 1e-9  # rad or m that a follower may be off without a correction


class PassiveForces:
    """The passive forces of one character, for an engine that adds them at each of its steps.

    `active` is true if there are any.
    """

    def __init__(
        self, character: Character, step_s: float, gravity: float, *, has_armature: bool = True
    ) -> None:
        """For engine steps of `step_s`, and a gravity in m/s^2 along -z.

        `has_armature` says whether the engine knows the armature of joints.
        """
        self._step_s, self._coupling = step_s, character.coupling
        self._has_floating_base = character.layout.has_floating_base
        self._rotation_entries = character.layout.rotation_entries[self._has_floating_base :]
        is_limited = any(joint.soft_limit is not None for joint in character.moving_joints)
        self._limits = SoftLimitForces(character, step_s) if is_limited else None
        self.resistance = JointResistance(character, step_s, has_armature=has_armature)
        self.active = is_limited or self.resistance.active
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
        is_beyond = self._limits is not None and self._limits.find(position, velocity)
        resists = self.resistance.active
        if self._model is None or not (is_beyond or resists):
            return np.zeros(len(velocity))
        self._model.update(position, velocity)
        effort: FloatArray = np.zeros(len(velocity))
        if self._limits is not None and is_beyond:
            effort = self._limits.effort(self._model)
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
