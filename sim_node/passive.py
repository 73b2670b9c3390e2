"""Forces that a character's joints have of themselves: damping, and the soft limits of ball joints.

A soft limit is a spring and a damper outside of bounds on the components of a joint's rotation
vector r. With e the excess of r over the bounds, the spring's potential is `V = k/2 e^2`, and the
damper's force `-c dr/dt` is there where e is not zero. As `dr/dt = J w`, with w the angular
velocity in the child frame and J the inverse of the right Jacobian of SO(3), their torque in the
child frame is `-J^T (k e + c dr/dt)`. The damper's power, `-c (dr/dt)^2`, is never positive.

Of the two rotation vectors of a turn, r and the longer way round, the one nearer to the bounds
counts, so that nothing jumps where r does, at an angle of pi.
"""

import numpy as np

from msgs_config import rotations
from msgs_config.arrays import FloatArray
from msgs_config.character import Character, SoftLimit
from msgs_config.errors import ConfigurationError

_TINY = 1e-150  # keeps 0 / 0 away


class PassiveForces:
    """The passive forces of one character, for an engine that adds them explicitly.

    `active` says whether there are any, `notes` what the user should know of them.
    """

    def __init__(self, character: Character, step_s: float, mobility: FloatArray) -> None:
        """For engine steps of `step_s`; `mobility` (n, n) is the inverse mass matrix at rest.

        Raises:
            ConfigurationError: a soft limit is unstable at such steps; says which and why.
        """
        joints = [joint for joint in character.moving_joints if joint.soft_limit is not None]
        limits = [joint.soft_limit for joint in joints if joint.soft_limit is not None]
        slices = [character.layout.joint(joint.name).entries for joint in joints]
        for joint, limit, part in zip(joints, limits, slices, strict=True):
            _check_stable(joint.name, limit, mobility[part, part], step_s)
        rows = [np.arange(part.start, part.stop) for part in slices]
        self._entries = np.array(rows, dtype=np.intp).reshape(-1, 3)
        self._lower = np.array([limit.lower for limit in limits]).reshape(-1, 3)
        self._upper = np.array([limit.upper for limit in limits]).reshape(-1, 3)
        self._stiffness = np.array([limit.stiffness for limit in limits]).reshape(-1, 1)
        self._damper = np.array([limit.damping for limit in limits]).reshape(-1, 1)
        wanted = character.passive_damping()
        self._damping = bounded_damping(wanted, mobility, step_s)
        self.active = bool(limits or wanted.any())
        self.notes = tuple(
            f"the passive damping of '{name}' is kept at {kept:.3g} of {asked:.3g}: more would be "
            f"unstable at engine steps of {1e3 * step_s:.3g} ms, substeps make them shorter"
            for name, asked, kept in zip(
                character.layout.dof_names, wanted, self._damping, strict=True
            )
            if kept < asked
        )

    def effort(self, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """The passive effort (n,) in a state, message form; N m or N."""
        effort: FloatArray = -self._damping * velocity
        turns = position[self._entries]
        excess = self._excess(turns)
        if excess.any():
            effort[self._entries] += self._torques(turns, excess, velocity[self._entries])
        return effort

    def _excess(self, turns: FloatArray) -> FloatArray:
        """How far rotation vectors (b, 3) are outside of their bounds, rad."""
        nearest: FloatArray = np.minimum(np.maximum(turns, self._lower), self._upper)
        return turns - nearest

    def _torques(self, turns: FloatArray, excess: FloatArray, velocity: FloatArray) -> FloatArray:
        """Torques (b, 3) of the soft limits in the child frames, N m."""
        angles = np.sqrt(np.einsum("ij,ij->i", turns, turns))[:, np.newaxis]
        long_way = turns - turns * (2.0 * np.pi / np.maximum(angles, _TINY))
        other = self._excess(long_way)
        nearer = (other * other).sum(axis=1) < (excess * excess).sum(axis=1)
        turns = np.where(nearer[:, np.newaxis], long_way, turns)
        excess = np.where(nearer[:, np.newaxis], other, excess)
        jacobian = rotations.right_jacobian_inverse(turns)
        rates = np.where(excess == 0.0, 0.0, rotations.apply(jacobian, velocity))
        force = self._stiffness * excess + self._damper * rates
        return -rotations.apply(np.swapaxes(jacobian, -1, -2), force)


def bounded_damping(damping: FloatArray, mobility: FloatArray, step_s: float) -> FloatArray:
    """Damping (n,) no larger than an explicit damper may have.

    An explicit damper is unstable where it takes more than twice the velocity away in one step,
    `h d / m > 2`. Where it would take more than all of it, as seen at the rest pose, it is made as
    much weaker: d becomes d / R where `R = h sum_j sqrt(d_i d_j) |inverse of M|_ij` is above 1. No
    eigenvalue of `h inverse(M) D` is above 1 then (Gershgorin 1931), and the other half is left to
    poses in which the inertia is less.
    """
    roots = np.sqrt(damping)
    taken: FloatArray = step_s * roots * np.einsum("ij,j->i", np.abs(mobility), roots)
    bounded: FloatArray = damping / np.maximum(taken, 1.0)
    return bounded


def _check_stable(name: str, limit: SoftLimit, mobility: FloatArray, step_s: float) -> None:
    """Explicit PD on an inertia I is stable for `k h^2 + 2 c h < 4 I`.

    At an angle a, J makes both `((a/2) / sin(a/2))^2` times as large.
    """
    corner = np.maximum(np.abs(limit.lower), np.abs(limit.upper))
    half = 0.5 * min(float(np.linalg.norm(corner)), np.pi)
    steepest = 1.0 / float(np.sinc(half / np.pi)) ** 2
    taken = steepest * (limit.stiffness * step_s**2 + 2.0 * limit.damping * step_s)
    share = 0.25 * taken * float(np.abs(mobility).sum(axis=1).max())
    if share >= 1.0:
        raise ConfigurationError(
            f"the soft limit of '{name}' has {share:.2g} times the stiffness and damping that are "
            f"stable at engine steps of {1e3 * step_s:.3g} ms; substeps make them shorter"
        )
