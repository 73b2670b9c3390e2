"""Offsets from the motion's inverse dynamics, around which a search draws its samples.

The efforts of a motion follow from its accelerations once the ground's forces are known: those of
least norm on the feet that are down which, together, drive the root. Stable PD control does not
foresee contact, and takes most of an offset's effect away where little inertia moves (the foot on
the ground). So the offset of an effort is the one with which the law gives just that effort.

Sources: Featherstone 2008, "Rigid Body Dynamics Algorithms", section 9.5 (a floating base's inverse
dynamics); the law is that of Tan, Liu and Turk 2011 (`controller_node/control_laws.py`).
"""

import numpy as np

from controller_node.laws import GainArrays
from controller_node.references.base import Reference
from msgs_config.arrays import FloatArray
from msgs_config.character import Character
from msgs_config.dynamics import DynamicsModel
from msgs_config.geometry import fixed_order

_APART = 0.05  # s from a time, between which its acceleration is measured: clips have 30 frames/s
_DOWN, _UP = 0.07, 0.15  # m of a foot's origin, at which it bears all of its share, and nothing
_LEVER = 0.05  # m, about a foot's size: what a moment on it counts beside a force
_SLIGHT = 1e-6  # against division by zero, where no foot bears


class Feedforward:
    """The offsets of a motion's inverse dynamics, a function of time."""

    def __init__(
        self, character: Character, motion: Reference, gains: GainArrays, period: float
    ) -> None:
        """`gains` are the control law's, its period is in s."""
        self._layout = character.layout
        self._model = DynamicsModel(character)
        names = [link.name for link in character.links]
        self._feet = [names.index(foot) for foot in character.feet]
        self._motion, self._gains, self._period = motion, gains, period
        self._no_damping = np.zeros(character.layout.size)

    def offset(self, times: tuple[float, ...]) -> FloatArray:
        """The mean offset (n,) over times in s, rad or m; the root's is zero."""
        mean: FloatArray = np.mean([self._offset_at(time) for time in times], axis=0)
        return mean

    def _offset_at(self, time: float) -> FloatArray:
        motion, model, gains = self._motion, self._model, self._gains
        state = motion.sample(time)
        before, after = max(time - _APART, 0.0), time + _APART
        change = motion.sample(after).velocity - motion.sample(before).velocity
        acceleration = change / (after - before)
        model.update(state.configuration.position, state.velocity)
        effort = self._effort(acceleration)
        free = model.solve(effort - model.bias_force(), self._no_damping, 0.0)  # as the law sees it
        known = effort + gains.damping * self._period * (free - acceleration)
        offset = np.zeros(self._layout.size)
        np.divide(known, gains.stiffness, out=offset, where=gains.stiffness > 0.0)
        if self._layout.has_floating_base:
            offset[:6] = 0.0
        return offset

    def _effort(self, acceleration: FloatArray) -> FloatArray:
        """The joints' efforts (n,) of an acceleration (n,) in the state taken over."""
        model = self._model
        effort = model.inverse_dynamics(acceleration)
        if not self._layout.has_floating_base:
            return effort
        if self._feet:
            effort = effort - self._ground(effort[:6])
        effort[:6] = 0.0
        return effort

    def _ground(self, needed: FloatArray) -> FloatArray:
        """The generalised force (n,) of the ground that comes closest to a root's force (6,)."""
        heights = self._model.link_frames(np.array(self._feet))[0][:, 2]
        shares = np.clip((_UP - heights) / (_UP - _DOWN), 0.0, 1.0)
        jacobians = np.vstack([self._model.link_jacobian(foot) for foot in self._feet])
        kinds = np.repeat([1.0, _LEVER * _LEVER], 3)
        weights = np.multiply.outer(shares, kinds).ravel()
        roots = jacobians[:, :6]
        mobility = np.einsum("wi,w,wj->ij", roots, weights, roots) + _SLIGHT * np.eye(6)
        rows = np.vstack((weights[:, np.newaxis] * roots, needed))
        # W J M^-1 needed is its last column; a LAPACK's last bits would be the processor's
        wrenches = _delassus(mobility, rows)[:-1, -1]
        return fixed_order.apply(jacobians.T, wrenches)


def _delassus(matrix: FloatArray, rows: FloatArray) -> FloatArray:
    """`J M^-1 J^T` (m, m) of a mass matrix (n, n) and rows J (m, n): what each row's force moves.

    By elimination of M from the bordered matrix (M, J^T; J, 0), whose Schur complement it is but
    for its sign; M is positive definite, so no pivots are looked for.
    """
    size, count = len(matrix), len(rows)
    bordered = np.zeros((size + count, size + count))
    bordered[:size, :size] = matrix
    bordered[:size, size:], bordered[size:, :size] = rows.T, rows
    for pivot in range(size):
        rest = bordered[pivot + 1 :, pivot + 1 :]
        column = bordered[pivot + 1 :, pivot]
        rest -= column[:, np.newaxis] * (bordered[pivot, pivot + 1 :] / bordered[pivot, pivot])
    schur: FloatArray = -bordered[size:, size:]
    return schur
