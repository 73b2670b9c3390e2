"""Error measures of states against their reference, and of efforts against limits.

Positions are those of a layout, (r, n) of r states and n degrees of freedom; a vector is one of its
b physical vectors: a hinge, slider or ball joint, the root's translation or its rotation.
"""

from typing import NamedTuple

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointLayout, JointType
from msgs_config.character.model import Character
from msgs_config.geometry import fixed_order

FARTHEST = 0.6
"""How far the centre of mass may be from the reference's until the motion is lost, m."""

AT_LIMIT = 1.0 - 1e-9
"""Share of its limit from which on an effort is at the limit: it was clipped in its direction."""

_CONVERSION_ERROR = 1e-12  # m or rad: more than what conversions of rotations round
_LOST_HEIGHT = 0.5  # share of the height of the reference's centre of mass
_BLOCK = 8192  # rows that are worked on together, so that long recordings need no more memory


class VectorKinds(NamedTuple):
    """The kinds of the b vectors of a layout."""

    rotating: BoolArray  # (b,) hinges and ball joints
    sliding: BoolArray  # (b,) sliders
    units: tuple[str, ...]  # (b,) "rad" or "m", of the position

    @property
    def actuated(self) -> BoolArray:
        """The vectors (b,) of joints: all but the root's."""
        return self.rotating | self.sliding


def vector_kinds(layout: JointLayout) -> VectorKinds:
    """The kinds of a layout's vectors, in its order."""
    types = [joint.type for joint in layout.joints for _ in joint.vectors]
    sliding = np.array([each is JointType.PRISMATIC for each in types], dtype=np.bool_)
    of_root = np.array([each is JointType.FLOATING for each in types], dtype=np.bool_)
    is_first = np.arange(len(types)) == 0  # the first vector of a root is its translation
    units = tuple("m" if each else "rad" for each in sliding | of_root & is_first)
    return VectorKinds(~(sliding | of_root), sliding, units)


def differences(layout: JointLayout, start: FloatArray, end: FloatArray) -> FloatArray:
    """From one position to another (r, n), rad and m; rotations are compared as rotations."""
    result = np.empty_like(start)
    for first in range(0, len(start), _BLOCK):
        rows = slice(first, first + _BLOCK)
        result[rows] = layout.difference(
            layout.configuration(start[rows]), layout.configuration(end[rows])
        )
    return result


def different_bits(one: FloatArray, other: FloatArray) -> BoolArray:
    """Where two arrays of one shape are not the same doubles: -0.0 is not 0.0, NaN is NaN."""
    bits = (np.ascontiguousarray(values).view(np.int64) for values in (one, other))
    different: BoolArray = np.not_equal(*bits) & ~(np.isnan(one) & np.isnan(other))
    return different


def distances(layout: JointLayout, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distance (r, b) of each vector between two positions (r, n), rad or m."""
    if not layout.size:
        return np.zeros((len(start), 0))
    return layout.norms(differences(layout, start, end))


def joint_errors(layout: JointLayout, position: FloatArray, desired: FloatArray) -> FloatArray:
    """Angle (r, j) in rad between positions and desired ones (r, n), for each of j joints.

    The joints are the layout's hinges and balls, in its order; NaN where nothing was desired.
    """
    return distances(layout, position, desired)[:, vector_kinds(layout).rotating]


def effort_sizes(layout: JointLayout, efforts: FloatArray) -> FloatArray:
    """Length (t, b) of each vector of efforts (t, n), N m or N."""
    return layout.norms(efforts) if layout.size else np.zeros((len(efforts), 0))


def limit_shares(sizes: FloatArray, limits: FloatArray) -> FloatArray:
    """Sizes of efforts (t, b) over limits (b,); 0 if a limit is infinite, 1 if it is 0."""
    shares = np.divide(sizes, limits, out=np.ones_like(sizes), where=limits > 0.0)
    shares[np.isnan(sizes)] = np.nan
    return shares


def follows_state(
    errors: FloatArray, moved: FloatArray, before: BoolArray, begins: BoolArray
) -> BoolArray:
    """Where (r, b) a reference is made of the state that it should judge.

    It is the state, though that has moved: nothing that is controlled is exact as it moves. Where
    the state rests, it is as it was before or is afterwards.

    Args:
        errors: Distance of each vector from its reference, rad or m; NaN without a reference.
        moved: Distance of each vector from where it was a tick before, rad or m.
        before: Whether each vector (b,) followed in the tick before the first.
        begins: Where (r,) an episode begins, into which nothing has moved.
    """
    exact = errors <= _CONVERSION_ERROR
    follows: BoolArray = exact & (moved > _CONVERSION_ERROR) & ~begins[:, np.newaxis]
    resting = exact & ~follows
    if resting.any() and (before.any() or follows.any()):
        rows = range(len(follows))
        for row in rows:
            if not begins[row]:
                follows[row] |= resting[row] & (follows[row - 1] if row else before)
        for row in reversed(rows[:-1]):
            if not begins[row + 1]:
                follows[row] |= resting[row] & follows[row + 1]
    return follows


def centre_path(character: Character, positions: FloatArray) -> FloatArray:
    """Centre of mass (r, 3) in the world at positions (r, n), m."""
    model = DynamicsModel(character)
    return np.array([model.centre_of_mass_at(row) for row in positions]).reshape(-1, 3)


def is_lost(centre: FloatArray, desired: FloatArray) -> bool:
    """Whether a centre of mass (3,) is so far from the desired one (3,) that the motion is lost.

    It is beyond 0.6 m, or below half of the desired height.
    """
    is_far = fixed_order.norm(centre - desired) > FARTHEST
    return bool(is_far or centre[2] < _LOST_HEIGHT * desired[2])
