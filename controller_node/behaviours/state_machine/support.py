"""The effort of a character that stands on its feet: inverse dynamics with the ground's reaction.

The ground can only press on the soles, which rest. So the accelerations of the root's rotation and
height may be chosen, those of the joints of no leg that stands, and the centre of pressure; how the
body then moves over the ground follows, as of an inverted pendulum.

Sources: Featherstone 2008, "Rigid Body Dynamics Algorithms", chapter 8 (a foot that rests has no
acceleration: `J v' + J' v = 0`) and section 9.5 (floating bases); Pratt et al. 2001, "Virtual Model
Control", and Coros, Beaudoin and van de Panne 2010, "Generalized Biped Walking Control" (forces on
the body by the Jacobian's transpose of the legs that stand).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller_node.behaviours.state_machine.legs.leg import Leg
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.geometry import fixed_order
from msgs_config.geometry.scalars import (
    Quaternion,
    Vector,
    add,
    cross,
    norm,
    rotate,
    scale,
    subtract,
)

_STRAIGHT = 1e-3  # damps the joints of a leg that is nearly straight, m^2


@dataclass(frozen=True)
class FootContact:
    """A foot that carries a share of the load, at a centre of pressure."""

    side: str
    leg: Leg
    share: float  # share of the load; those of all feet add up to 1
    pressure: Vector  # m, world


@dataclass(frozen=True)
class Bounds:
    """What a ground can bear."""

    friction: float = 0.4  # horizontal force over vertical force
    spin: float = 0.02  # m: moment about z over vertical force
    least: float = 0.2  # least vertical force, in weights
    most: float = 2.0
    sole: float = 0.6  # share of half a sole, within which the centre of pressure is


@dataclass(frozen=True, eq=False)
class Resting:
    """The accelerations of a body whose feet rest, by that of its root."""

    by_root: FloatArray  # (n, 6)
    free: FloatArray  # (n,), where the root does not accelerate

    def of(self, root: FloatArray) -> FloatArray:
        """The accelerations (n,) at an acceleration (6,) of the root."""
        return fixed_order.apply(self.by_root, root) + self.free


def resting(model: DynamicsModel, acceleration: FloatArray, legs: Sequence[Leg]) -> Resting:
    """How a body moves on legs that stand; its other joints have accelerations (n,).

    A leg has a joint more than its foot needs: its knee keeps the way that it faces.
    """
    by_root, free = np.zeros((len(acceleration), 6)), acceleration.copy()
    by_root[:6] = np.eye(6)
    free[:6] = 0.0
    for leg in legs:
        foot = model.link_jacobian(leg.foot_link)
        thigh = model.link_jacobian(leg.thigh_link)[3:]
        rows = np.vstack((foot, fixed_order.apply(thigh.T, np.array(_line(model, leg)))))
        joints = rows[:, leg.entries]
        drift = np.array((*model.link_drift(leg.foot_link), 0.0))
        right = -np.column_stack((rows[:, :6], drift))
        square = fixed_order.product(joints.T, joints) + _STRAIGHT * np.eye(len(leg.entries))
        found = fixed_order.solve(square, fixed_order.product(joints.T, right))
        by_root[leg.entries], free[leg.entries] = found[:, :6], found[:, 6]
    return Resting(by_root, free)


def _line(model: DynamicsModel, leg: Leg) -> Vector:
    """The direction from hip to ankle, world axes."""
    (hip, ankle), _ = model.link_frames(np.array((leg.thigh_link, leg.foot_link)))
    x, y, z = (ankle - hip).tolist()
    return scale(1.0 / norm((x, y, z)), (x, y, z))


def bounded(force: Vector, spin: float, bounds: Bounds, weight: float) -> tuple[Vector, float]:
    """The nearest force and moment about z that the ground can bear: friction gives way first."""
    up = min(max(force[2], bounds.least * weight), bounds.most * weight)
    across = math.sqrt(force[0] * force[0] + force[1] * force[1])
    share = min(1.0, bounds.friction * up / max(across, 1e-9))
    most = bounds.spin * up
    return (share * force[0], share * force[1], up), min(max(spin, -most), most)


def support_effort(
    model: DynamicsModel,
    acceleration: FloatArray,  # (n,) that is wanted; horizontally the root's does not count
    contacts: Sequence[FootContact],  # their shares add up to 1
    bounds: Bounds,
    root: tuple[Vector, Quaternion],  # its place in m, and its orientation
) -> FloatArray:
    """The effort (n,) of the joints; `model` has the present state. The root's is zero.

    Where the bounds allow it, the root turns and rises as wanted; if not, what the ground does not
    bear the body as a whole does not get. Joints of no leg that stands move as wanted all the same.
    """
    move = resting(model, acceleration, [contact.leg for contact in contacts])
    inertia = fixed_order.product(model.mass_matrix()[:6], move.by_root)
    needed = model.inverse_dynamics(move.of(acceleration[:6]))[:6]
    force, spin = _wrench_wanted(inertia, needed, contacts, root)
    borne, borne_spin = bounded(force, spin, bounds, model.weight)
    pressed = np.zeros(len(acceleration))
    for contact in contacts:
        share, place = contact.share, np.array(contact.pressure)
        jacobian = model.point_jacobian(contact.leg.foot_link, place)
        wrench = np.array((*scale(share, borne), 0.0, 0.0, share * borne_spin))
        pressed += fixed_order.apply(jacobian.T, wrench)
    falling = model.inverse_dynamics(move.free)[:6]
    gained = fixed_order.solve(inertia, (pressed[:6] - falling)[:, np.newaxis])[:, 0]
    effort = model.inverse_dynamics(move.of(gained)) - pressed
    effort[:6] = 0.0
    return effort


def _wrench_wanted(
    inertia: FloatArray,  # (6, 6): the root's wrench by its acceleration
    needed: FloatArray,  # (6,): its wrench where it does not accelerate horizontally
    contacts: Sequence[FootContact],
    root: tuple[Vector, Quaternion],
) -> tuple[Vector, float]:
    """Force (N) at the centre of pressure, and moment about z there (N m).

    A force has no moment about horizontal axes through the centre of pressure: the root accelerates
    horizontally so that there is none.
    """
    if not contacts:
        return (0.0, 0.0, 0.0), 0.0
    place, root_xyzw = root
    pressure: Vector = (0.0, 0.0, 0.0)
    for contact in contacts:
        pressure = add(pressure, scale(contact.share, contact.pressure))

    def there(wrench: FloatArray) -> tuple[Vector, Vector]:
        fx, fy, fz, mx, my, mz = wrench.tolist()
        force: Vector = (fx, fy, fz)
        moment = rotate(root_xyzw, (mx, my, mz))
        return force, add(moment, cross(subtract(place, pressure), force))

    (_, start), (_, by_x), (_, by_y) = there(needed), there(inertia[:, 0]), there(inertia[:, 1])
    tipping = np.array(((by_x[0], by_y[0]), (by_x[1], by_y[1])))
    across = fixed_order.solve(tipping, np.array(((-start[0],), (-start[1],))))[:, 0]
    force, moment = there(needed + fixed_order.apply(inertia[:, :2], across))
    return force, moment[2]
