"""The effort of a character that stands on its feet: inverse dynamics with the ground's reaction.

The ground can only press on the soles. So the accelerations of the root's rotation and height, and
of the joints, may be chosen, and the centre of pressure; how the body then moves over the ground
follows, as of an inverted pendulum.

Sources: Featherstone 2008, "Rigid Body Dynamics Algorithms", section 9.5 (floating bases); Pratt et
al. 2001, "Virtual Model Control", and Coros, Beaudoin and van de Panne 2010, "Generalized Biped
Walking Control" (forces on the body by the Jacobian's transpose of the legs that stand).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.geometry import fixed_order
from msgs_config.geometry.single_rotations import (
    QuaternionXyzw,
    Vector,
    add,
    cross,
    rotate,
    scale,
    subtract,
)

_LEAST_HEIGHT = 0.1  # m, of the centre of mass above the soles


@dataclass(frozen=True)
class Contact:
    """A foot that carries a share of the load, at a centre of pressure."""

    side: str
    link: int
    share: float  # of 1
    pressure: Vector  # m, world


@dataclass(frozen=True)
class Bounds:
    """What a ground can bear."""

    friction: float = 0.4  # horizontal force over vertical force
    spin: float = 0.02  # m: moment about z over vertical force
    least: float = 0.2  # weights: vertical force
    most: float = 2.0
    sole: float = 0.6  # of half a sole's length and width: how far out the centre of pressure is


def ground_wrench(
    root_wrench: tuple[Vector, Vector],  # force (N) and moment about the root (N m), world
    root: Vector,
    centre: Vector,  # of mass, m
    pressure: Vector,  # centre of pressure, m
    mass: float,
) -> tuple[Vector, float, tuple[float, float]]:
    """Force (N) at the centre of pressure, moment about z there (N m), horizontal acceleration.

    `root_wrench` is what the accelerations wanted need, of a root without horizontal acceleration.
    A force has no moment about horizontal axes through the centre of pressure; the acceleration
    (m/s^2) of the whole body that is missing for it is what it gets.
    """
    force, moment = root_wrench
    moment = add(moment, cross(subtract(root, pressure), force))
    arm = subtract(centre, pressure)
    height = max(arm[2], _LEAST_HEIGHT)
    ahead, left = -moment[1] / (mass * height), moment[0] / (mass * height)
    spin = moment[2] + mass * (arm[0] * left - arm[1] * ahead)
    return (force[0] + mass * ahead, force[1] + mass * left, force[2]), spin, (ahead, left)


def bounded(force: Vector, spin: float, bounds: Bounds, weight: float) -> tuple[Vector, float]:
    """The nearest force and moment about z that the ground can bear: friction gives way first."""
    up = min(max(force[2], bounds.least * weight), bounds.most * weight)
    across = math.sqrt(force[0] * force[0] + force[1] * force[1])
    share = min(1.0, bounds.friction * up / max(across, 1e-9))
    most = bounds.spin * up
    return (share * force[0], share * force[1], up), min(max(spin, -most), most)


def support_effort(
    model: DynamicsModel,
    acceleration: FloatArray,  # (n,) wanted; horizontally none of the root
    contacts: Sequence[Contact],  # whose shares are 1 together
    bounds: Bounds,
    state: tuple[Vector, QuaternionXyzw, Vector],  # root, its orientation xyzw, centre of mass
) -> FloatArray:
    """The effort (n,) of the joints; `model` has the present state. The root's is zero."""
    root, root_xyzw, centre = state
    needed = model.inverse_dynamics(acceleration)
    fx, fy, fz, mx, my, mz = needed[:6].tolist()
    pressure: Vector = (0.0, 0.0, 0.0)
    for contact in contacts:
        pressure = add(pressure, scale(contact.share, contact.pressure))
    weight = model.weight
    mass = model.mass
    force, spin, across = ground_wrench(
        ((fx, fy, fz), rotate(root_xyzw, (mx, my, mz))), root, centre, pressure, mass
    )
    acceleration = acceleration.copy()
    acceleration[:2] = across
    borne, borne_spin = bounded(force, spin, bounds, weight)
    pressed = np.zeros(len(acceleration))
    for contact in contacts:
        jacobian = model.point_jacobian(contact.link, np.array(contact.pressure))
        wrench = np.array((*scale(contact.share, borne), 0.0, 0.0, contact.share * borne_spin))
        pressed += fixed_order.apply(jacobian.T, wrench)
    effort = model.inverse_dynamics(acceleration)
    # what the ground does not bear, the body as a whole does not get
    inertia = model.mass_matrix()[:, :6]
    missing = solve_symmetric(inertia[:6], pressed[:6] - effort[:6])
    effort += fixed_order.apply(inertia, np.array(missing)) - pressed
    effort[:6] = 0.0
    return effort


def solve_symmetric(matrix: FloatArray, right: FloatArray) -> list[float]:
    """The x of `A x = b` of a symmetric positive definite matrix, by Cholesky's method."""
    rows, size = matrix.tolist(), len(right)
    solution: list[float] = right.tolist()
    for i in range(size):
        for j in range(i + 1):
            value = rows[i][j]
            for k in range(j):
                value -= rows[i][k] * rows[j][k]
            rows[i][j] = math.sqrt(value) if i == j else value / rows[j][j]
    for i in range(size):
        for k in range(i):
            solution[i] -= rows[i][k] * solution[k]
        solution[i] /= rows[i][i]
    for i in reversed(range(size)):
        for k in range(i + 1, size):
            solution[i] -= rows[k][i] * solution[k]
        solution[i] /= rows[i][i]
    return solution
