"""Mass and inertia of links as a URDF's text gives them; inertia tensors that no body can have.

Of a real body no principal moment of inertia is larger than the sum of the other two. The engine
takes a tensor that is otherwise for zero, without an error.
"""

import math
from dataclasses import dataclass
from itertools import combinations
from xml.etree import ElementTree

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Pose, Vector
from msgs_config.character.urdf.origin import read_origin
from msgs_config.geometry import fixed_order, rotations

ROUNDING = 1e-9
"""Of the largest moment of inertia: what a file's digits may leave of a zero."""
LEAST_MOMENT = 1e-15
"""Moments of inertia, kg m^2, that are rounding whatever the others are."""
LEAST_MASS = 1e-15
"""Masses, kg, that count as none: the engines divide by no smaller ones."""

_DIAGONAL_ENTRIES = ("ixx", "iyy", "izz")
_OFF_DIAGONAL_ENTRIES = (("ixy", 0, 1), ("ixz", 0, 2), ("iyz", 1, 2))
ENTRIES = (*_DIAGONAL_ENTRIES, *(name for name, _, _ in _OFF_DIAGONAL_ENTRIES))
"""The attributes of `<inertia>`."""
_DIGITS = 1e-20  # share of the largest entry: too little to alter a digit of another
_NO_POSE = Pose()
_WATER = 1000.0  # kg/m^3
_SWEEPS = 20  # each sweep of Jacobi's method doubles its digits


@dataclass(frozen=True)
class Inertial:
    """Mass and inertia of a link, in its own frame."""

    mass: float = 0.0  # kg
    pose: Pose = _NO_POSE
    tensor: tuple[Vector, Vector, Vector] = ((0.0, 0.0, 0.0),) * 3  # kg m^2, axes of `pose`

    @property
    def is_nothing(self) -> bool:
        """Whether the link has neither mass nor inertia."""
        return self.mass == 0.0 and not np.abs(self.tensor).max() > LEAST_MOMENT

    def in_link_axes(self) -> FloatArray:
        """The tensor (3, 3) about the centre of mass along the link's axes, kg m^2."""
        axes = rotations.matrix(np.array(self.pose.orientation_xyzw))
        return fixed_order.product(axes, fixed_order.product(np.array(self.tensor), axes.T))


def read_inertial(link: ElementTree.Element) -> Inertial:
    """What a link's `<inertial>` says; without one it has neither mass nor inertia."""
    inertial = link.find("inertial")
    if inertial is None:
        return Inertial()
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    tensor = np.zeros((3, 3))
    if inertia is not None:
        np.fill_diagonal(tensor, [float(inertia.get(name, "0")) for name in _DIAGONAL_ENTRIES])
        for name, row, column in _OFF_DIAGONAL_ENTRIES:
            tensor[row, column] = tensor[column, row] = float(inertia.get(name, "0"))
    rows = [(x, y, z) for x, y, z in tensor.tolist()]
    value = 0.0 if mass is None else float(mass.get("value", "0"))
    return Inertial(
        value if value > LEAST_MASS else 0.0,
        read_origin(inertial),
        (rows[0], rows[1], rows[2]),
    )


def write_moments(inertia: ElementTree.Element, moments: Vector) -> None:
    """Give an `<inertia>` these principal moments, kg m^2, and no products."""
    for name, moment in zip(_DIAGONAL_ENTRIES, moments, strict=True):
        inertia.set(name, repr(moment))
    for name, _, _ in _OFF_DIAGONAL_ENTRIES:
        inertia.set(name, "0")


def write_inertial(link: ElementTree.Element, mass: float, moment: float) -> None:
    """Give a link a mass in kg, and one moment in kg m^2 about each axis, at its origin."""
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value=repr(mass))
    write_moments(ElementTree.SubElement(inertial, "inertia"), (moment, moment, moment))


def ball_moment(mass: float) -> float:
    """Moment of inertia, kg m^2, of a ball of water of a mass, kg."""
    radius = math.cbrt(0.75 * mass / (math.pi * _WATER))
    return 0.4 * mass * radius * radius


def principal_axes(tensor: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Principal moments (3,) and axes (3, 3), as columns, of a symmetric tensor (3, 3).

    Jacobi's method, in plain numbers: the same bits on every processor, and, unlike the engine's
    own, exact (Golub and Van Loan 2013, "Matrix Computations", section 8.5).
    """
    a, axes = tensor.copy(), np.eye(3)
    nothing = _DIGITS * float(np.abs(tensor).max())
    for _ in range(_SWEEPS):
        for _, p, q in _OFF_DIAGONAL_ENTRIES:
            if abs(a[p, q]) <= nothing:
                continue
            theta = 0.5 * (a[q, q] - a[p, p]) / a[p, q]
            tangent = math.copysign(1.0 / (abs(theta) + math.sqrt(theta * theta + 1.0)), theta)
            cosine = 1.0 / math.sqrt(tangent * tangent + 1.0)
            turn = np.eye(3)
            turn[p, p] = turn[q, q] = cosine
            turn[p, q], turn[q, p] = tangent * cosine, -tangent * cosine
            a = fixed_order.product(turn.T, fixed_order.product(a, turn))
            a[p, q] = a[q, p] = 0.0
            axes = fixed_order.product(axes, turn)
    return np.diag(a).copy(), axes


def nearest_physical(moments: FloatArray) -> Vector:
    """The moments (3,) of a real body that are nearest to some (3,), by the sum of squares.

    A real body's are `(b + c, a + c, a + b)` of some a, b, c of at least 0, the second moments of
    its mass. Together with the axes they are the nearest tensor in the Frobenius norm.
    """
    best, least = [0.0, 0.0, 0.0], math.inf
    for count in range(4):
        for chosen in combinations(range(3), count):
            found = _sums(_least_squares(moments, chosen))
            error = _optimality_error(moments.tolist(), found)
            if error < least:
                best, least = found, error
    x, y, z = best
    # Physical to the last bit, because the engine compares so.
    x = min(x, y + z)
    y = min(y, x + z)
    return x, y, min(z, x + y)


def _least_squares(moments: FloatArray, chosen: tuple[int, ...]) -> list[float]:
    """The second moments, of which only those chosen are not zero, that fit some moments (3,).

    Each stands in two of the three moments, two of them together in one: so the normal equations'
    matrix is `1 + J` of all ones J, and its inverse `1 - J / (k + 1)`. One below 0 is 0.
    """
    x, y, z = moments.tolist()
    right = (y + z, x + z, x + y)
    shared = math.fsum(right[index] for index in chosen) / (len(chosen) + 1)
    return [max(right[i] - shared, 0.0) if i in chosen else 0.0 for i in range(3)]


def _optimality_error(moments: list[float], found: list[float]) -> float:
    """How far found moments are from the nearest ones; 0 there.

    Distances would differ by rounding alone. What is left must be at right angles to them, and
    point along no edge of the cone of bodies.
    """
    x, y, z = left = [m - f for m, f in zip(moments, found, strict=True)]
    along = math.fsum(a * b for a, b in zip(left, found, strict=True))
    return max(y + z, x + z, x + y, abs(along))


def _sums(second: list[float]) -> list[float]:
    a, b, c = second
    return [b + c, a + c, a + b]
