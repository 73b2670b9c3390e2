"""Damping, friction, coupling and limits of joints, solved for the end of an engine step.

With the velocity v' that they lead to at the end of a step h, and all other forces f on the joints,

    M (v' - v) / h + C = f - D v' + r + J^T m

where M has the armature of joints, of which Bullet knows nothing: to it that is a force as well;
r is friction, `|r_i| <= F_i`, which is F_i against a velocity and at rest whatever keeps it
there, with the force of a limit that is reached; and `J v' = -c (J q - b) / h` is the coupling
of followers, of forces m. It is implicit Euler, so it is stable at any D and F, for links of any
mass, and in the position that they are in. Which joints rest is found by trial: one that rests by
more than F slides, one that is driven by its friction rests (Murty 1974, as in `passive_forces`).

Contacts are not foreseen. What they do to friction and coupling is left to the rows of the engine's
own solver (`Body.set_friction`), which find nothing to do without contacts.
"""

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character

COUPLING_CORRECTION = 0.1
"""The share of a coupling's error in position that a step takes away."""
_LIMIT_CORRECTION = 0.2  # share of a limit's excess that a step corrects, as the engine's own do
_MOST_TRIALS = 20
_LOCKING_INERTIA = 1e9  # times its own inertia, added to a joint that rests: that keeps it there
_FORCE_ROUNDING = 1e-9  # share of a force that may be wrong without consequence


class JointResistance:
    """What resists the motion of one character's joints; `active` if anything does."""

    def __init__(self, character: Character, step_s: float, *, has_armature: bool = True) -> None:
        """For steps of `step_s` of an engine that knows the armature of joints, or does not."""
        joints, layout = character.moving_joints, character.layout
        self._step_s, self._coupling = step_s, character.coupling
        self._damping = character.passive_damping()
        self.friction: FloatArray = np.zeros(layout.size)  # (n,) N m or N
        for joint in joints:
            self.friction[layout.joint(joint.name).entries] = joint.friction
        self._armature = character.armature() * (not has_armature)
        """Armature (n,) that the engine does not know, kg m^2 or kg: it resists acceleration."""
        resists = self._damping.any() or self.friction.any() or self._armature.any()
        self.active = bool(resists or self._coupling)
        self._lower, self._upper = character.position_bounds()
        driven = layout.mask(name for name in layout.joint_names if name != "root")
        self._resisted = (driven | (self._armature > 0.0)) & self.active
        self.spare = self.friction.copy()
        """Friction (n,) that the last effort has left, for contacts: N m or N."""

    def effort(
        self, model: DynamicsModel, position: FloatArray, velocity: FloatArray, known: FloatArray
    ) -> FloatArray:
        """The effort (n,) of all resistance in a state, of which the model has been told.

        `known` (n,) is the generalised force of all others but gravity; N m or N.
        """
        step, bias = self._step_s, model.bias_force()
        heavy = _LOCKING_INERTIA * model.inertia_of_entries()
        rate = self._coupling.violation(position) * (-COUPLING_CORRECTION / (step * step))
        target, at_limit, side = self._limits(position, velocity)
        rests, slides = self._first_guess(velocity, heavy / _LOCKING_INERTIA)
        stopped = np.zeros(len(velocity), dtype=np.bool_)
        force = np.zeros(len(velocity))
        for _ in range(_MOST_TRIALS):
            locked = rests | stopped
            wanted = (np.where(stopped, target, 0.0) - velocity) / step
            given = known - bias + np.where(locked, heavy * wanted, slides)
            if self._coupling:
                rate_now = rate - self._coupling.violation_rate(velocity) / step
                acceleration = model.solve(given, np.where(locked, heavy, 0.0), step, rate_now)
            else:
                acceleration = model.solve(given, np.where(locked, heavy, 0.0), step)
            force = np.where(locked, heavy * (wanted - acceleration), slides)
            after = velocity + step * acceleration
            changed = self._switch(force, after, rests, slides, stopped)
            changed |= _switch_limits(force, after, target, at_limit, side, stopped, self.friction)
            if not changed:
                break
        self.spare = np.where(rests & ~stopped, np.maximum(self.friction - np.abs(force), 0.0), 0.0)
        whole = model.inverse_dynamics(acceleration) - self._damping * velocity - known
        if self._armature.any():
            whole = whole - self._armature * acceleration
        return np.where(self._resisted, whole, 0.0)

    def _first_guess(
        self, velocity: FloatArray, inertia: FloatArray
    ) -> tuple[BoolArray, FloatArray]:
        """Which joints rest by friction, and the friction (n,) of those that slide."""
        has_friction = self.friction > 0.0
        fast = np.abs(velocity) * inertia > self._step_s * self.friction
        return has_friction & ~fast, np.where(fast, -np.sign(velocity) * self.friction, 0.0)

    def _switch(
        self,
        force: FloatArray,
        after: FloatArray,
        rests: BoolArray,
        slides: FloatArray,
        stopped: BoolArray,
    ) -> bool:
        """Let joints slide whose friction is too small, and rest which it drives; if there are.

        One that a limit has stopped stays as it is: the force is the limit's.
        """
        lets_go = rests & ~stopped & (np.abs(force) > self.friction * (1.0 + _FORCE_ROUNDING))
        stops = (slides != 0.0) & (slides * after > 0.0) & ~stopped
        rests[:] = (rests & ~lets_go) | stops
        slides[:] = np.where(lets_go, np.copysign(self.friction, force), slides)
        slides[stops] = 0.0
        return bool(lets_go.any() or stops.any())

    def _limits(
        self, position: FloatArray, velocity: FloatArray
    ) -> tuple[FloatArray, BoolArray, FloatArray]:
        """Of limits that are reached: the velocity (n,) that is wanted; which; to which side."""
        below, above = self._lower - position, position - self._upper
        at_limit = (below >= 0.0) | (above >= 0.0)
        side = np.where(below >= 0.0, 1.0, -1.0)
        excess = np.where(at_limit, np.where(below >= 0.0, below, above), 0.0)
        return side * excess * _LIMIT_CORRECTION / self._step_s, at_limit, side


def _switch_limits(
    force: FloatArray,
    after: FloatArray,
    target: FloatArray,
    at_limit: BoolArray,
    side: FloatArray,
    stopped: BoolArray,
    friction: FloatArray,
) -> bool:
    """Stop joints that go on beyond a limit, and free those that it would draw; if there are."""
    stops = at_limit & ~stopped & (side * (after - target) < -_FORCE_ROUNDING)
    frees = stopped & (side * force < -friction)
    stopped[:] = (stopped & ~frees) | stops
    return bool(stops.any() or frees.any())
