"""Forces that a character's joints have of themselves: damping, and the soft limits of ball joints.

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

import numpy as np

from msgs_config import rotations
from msgs_config.arrays import FloatArray
from msgs_config.character import Character
from msgs_config.geometry import fixed_order
from sim_node.mass_matrix import MassMatrix, yielding

_TINY = 1e-150  # keeps 0 / 0 away
_SWEEPS = 30


class PassiveForces:
    """The passive forces of one character, for an engine that adds them at each of its steps.

    `active` says whether there are any, `notes` what the user should know of them.
    """

    def __init__(self, character: Character, step_s: float, mobility: FloatArray) -> None:
        """For engine steps of `step_s`; `mobility` (n, n) is the inverse mass matrix at rest."""
        joints = [joint for joint in character.moving_joints if joint.soft_limit is not None]
        limits = [joint.soft_limit for joint in joints if joint.soft_limit is not None]
        slices = [character.layout.joint(joint.name).entries for joint in joints]
        rows = [np.arange(part.start, part.stop) for part in slices]
        self._step_s = step_s
        self._entries = np.array(rows, dtype=np.intp).reshape(-1, 3)
        self._lower = np.array([limit.lower for limit in limits]).reshape(-1, 3)
        self._upper = np.array([limit.upper for limit in limits]).reshape(-1, 3)
        self._stiffness = np.array([[limit.stiffness] * 3 for limit in limits]).reshape(-1, 3)
        self._damper = np.array([[limit.damping] * 3 for limit in limits]).reshape(-1, 3)
        self._mass_matrix = MassMatrix(character)
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
        if self._near(position[self._entries], velocity[self._entries]):
            self._hold(effort, position, velocity)
        return effort

    def _near(self, turns: FloatArray, velocity: FloatArray) -> bool:
        """Whether any rotation vector (b, 3) may be beyond a bound by the end of the step.

        Up to two thirds of a turn it is less than twice as fast as the angular velocity (b, 3).
        """
        room = np.minimum(turns - self._lower, self._upper - turns)
        farthest = 2.0 * self._step_s * np.sqrt(np.einsum("ij,ij->i", velocity, velocity))
        return bool((room < farthest[:, np.newaxis]).any())

    def _hold(self, effort: FloatArray, position: FloatArray, velocity: FloatArray) -> None:
        """Add the torques of the soft limits to an effort (n,)."""
        step = self._step_s
        turns = self._nearer_way(position[self._entries])
        jacobian = rotations.right_jacobian_inverse(turns)
        rates = fixed_order.apply(jacobian, velocity[self._entries])
        outward = np.copysign(1.0, 2.0 * (turns + step * rates) - self._lower - self._upper)
        excess = outward * (turns - np.where(outward > 0.0, self._upper, self._lower))
        rates = outward * rates
        explicit = self._stiffness * (excess + step * rates) + self._damper * rates
        beyond = (np.maximum(excess, excess + step * rates) > 0.0) & (explicit > 0.0)
        if not beyond.any():
            return
        count = int(beyond.sum())
        rows = np.zeros((count, len(effort)))
        joints = np.nonzero(beyond)[0]
        rows[np.arange(count)[:, np.newaxis], self._entries[joints]] = (
            outward[beyond][:, np.newaxis] * jacobian[beyond]
        )
        forces = held(
            explicit[beyond],
            step * (self._stiffness * step + self._damper)[beyond],
            yielding(self._mass_matrix.at(position), rows),
        )
        effort -= np.einsum("mn,m->n", rows, forces)

    def _nearer_way(self, turns: FloatArray) -> FloatArray:
        """Of rotation vectors (b, 3) and the longer way round those nearer to the bounds."""
        angles = np.sqrt(np.einsum("ij,ij->i", turns, turns))[:, np.newaxis]
        long_way = turns - turns * (2.0 * np.pi / np.maximum(angles, _TINY))
        beyond = [
            way - np.minimum(np.maximum(way, self._lower), self._upper) for way in (turns, long_way)
        ]
        here, there = (np.einsum("ij,ij->i", excess, excess) for excess in beyond)
        return np.where((there < here)[:, np.newaxis], long_way, turns)


def held(explicit: FloatArray, implicit: FloatArray, mobility: FloatArray) -> FloatArray:
    """Forces (m,) that hold bounds without drawing: `f = max(0, explicit - implicit A f)` of each.

    `explicit` (m,) are the forces if nothing yielded, `implicit` (m,) what of them a unit of
    acceleration takes away, and `mobility` (m, m) is A, symmetrical: the acceleration that a unit
    of each force leads to. Solved from zero by sweeps of projected Gauss-Seidel (Jourdan et al.
    1998, for contacts).
    """
    forces = [0.0] * len(explicit)
    wanted, taken, coupling = explicit.tolist(), implicit.tolist(), mobility.tolist()
    for _ in range(_SWEEPS):
        before = forces.copy()
        for i, row in enumerate(coupling):
            others = sum(a * f for a, f in zip(row, forces, strict=True)) - row[i] * forces[i]
            forces[i] = max(0.0, (wanted[i] - taken[i] * others) / (1.0 + taken[i] * row[i]))
        if forces == before:
            break  # nothing changes any more
    return np.array(forces)


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
