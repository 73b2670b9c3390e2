"""A reference corrected window by window: what sampling-based motion control finds.

A correction is an offset of each joint from the pose of the motion below it: added to a hinge's or
slider's coordinate, and for a ball joint a rotation vector in the child frame, `q exp(o)`. It is
constant over a window of about 0.1 s, and stands in the desired pose that the control law tracks.

Source: Liu, Yin, van de Panne, Shao and Xu 2010, "Sampling-based Contact-rich Motion Control".
"""

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np

from controller_node.references.base import Reference, ReferenceState
from msgs_config import rotations
from msgs_config.arrays import FloatArray
from msgs_config.geometry import elementary
from msgs_config.joint_layout import Configuration, JointLayout

_TINY = 1e-150  # keeps 0 / 0 away


@dataclass(frozen=True)
class Corrections:
    """Offsets of the desired pose; window w is the time `(ends[w - 1], ends[w]]`, from 0 on.

    At its first moment a window still has the offset of the one before: a state's effort looks at
    the time after it, and so the first state of a window is the first that the window moves.
    """

    ends: tuple[float, ...]  # (w,) s, rising
    offsets: FloatArray  # (w, n) rad or m; a rotation's in the child frame, the root's zero


class Offset:
    """One window's offset (n,), to be applied to the desired states in it.

    Every number comes from elementwise operations, so that a state gets the same doubles alone and
    among others.
    """

    def __init__(self, layout: JointLayout, offset: FloatArray) -> None:
        self._added = offset.copy()
        self._added[layout.rotation_entries] = 0.0
        vectors = offset[layout.rotation_entries]
        self._rows = np.flatnonzero(vectors.any(axis=1))
        self._entries = layout.rotation_entries[self._rows].T.copy()  # (3, r)
        turns = rotations.exp(vectors[self._rows])
        self._turns = turns.T.copy()  # (4, r)
        self._axes = rotations.matrix(turns).T.copy()  # (3, 3, r), transposed: back to the child

    def applied(self, states: ReferenceState) -> ReferenceState:
        """A state, or a table of them, with the offset.

        Velocities are the same motion's, in the turned frames.
        """
        position = states.configuration.position + self._added
        orientations = states.configuration.orientations_xyzw
        if not len(self._rows):
            configuration = Configuration(position, orientations)
            return ReferenceState(configuration, states.velocity, states.acceleration)
        orientations = orientations.copy()
        turned = _product(orientations[..., self._rows, :], self._turns)
        for component, values in enumerate(turned):
            orientations[..., self._rows, component] = values
        for entries, values in zip(self._entries, _rotation_vector(*turned), strict=True):
            position[..., entries] = values
        velocity, acceleration = self._turned(states.velocity), self._turned(states.acceleration)
        return ReferenceState(Configuration(position, orientations), velocity, acceleration)

    def _turned(self, motion: FloatArray) -> FloatArray:
        """Velocities or accelerations (..., n) in the turned child frames."""
        turned: FloatArray = motion.copy()
        x, y, z = (motion[..., entries] for entries in self._entries)
        for row, (ax, ay, az) in zip(self._entries, self._axes, strict=True):
            turned[..., row] = ax * x + ay * y + az * z
        return turned


def _product(q_xyzw: FloatArray, turns: FloatArray) -> tuple[FloatArray, ...]:
    """The components of the products of quaternions (..., r, 4) and turns (4, r)."""
    ax, ay, az, aw = (q_xyzw[..., component] for component in range(4))
    bx, by, bz, bw = turns
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _rotation_vector(
    x: FloatArray, y: FloatArray, z: FloatArray, w: FloatArray
) -> tuple[FloatArray, ...]:
    """The components of `rotations.log`."""
    sine = np.sqrt(x * x + y * y + z * z)
    angle = 2.0 * elementary.arctan2(sine, np.abs(w))
    factor = np.copysign(angle / np.maximum(sine, _TINY), w)
    return x * factor, y * factor, z * factor


class CorrectedReference:
    """A motion with corrections; after the last window it is the motion itself."""

    def __init__(self, layout: JointLayout, motion: Reference, corrections: Corrections) -> None:
        self._motion = motion
        self._ends = corrections.ends
        self._offsets = [Offset(layout, offset) for offset in corrections.offsets]

    def sample(self, time: float) -> ReferenceState:
        """The desired state `time` seconds after the motion began."""
        state = self._motion.sample(time)
        window = bisect_left(self._ends, time)
        if time <= 0.0 or window == len(self._ends):
            return state
        return self._offsets[window].applied(state)
