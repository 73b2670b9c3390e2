"""Gains for joints that have none: critically damped at one frequency, by the mass matrix at rest.

A joint of inertia m about its axis, all others locked, with `kp = m w^2` and `kd = 2 m w`, comes to
its target without overshoot; `w / 2 pi` is the frequency. For an arm, m is the diagonal entry of
the mass matrix: what hangs on the joint. Of a floating base the coupling with the base is taken
off, which moves as well.

A joint between the base and a link on the ground moves the rest of the body over that link, whose
m may be a hundred times as large. Stable PD knows no contacts: it takes the joint for a free one,
and divides the effort by `1 + kd h / m`, so that gains for the body would weaken themselves. Such
a joint has those of the body as far as `kp h^2 <= m` and `kd h <= 2 m` with its own m. Stable
PD does not count with passive damping d either: at those bounds a joint is unstable from
`d h = 0.77 m` on, a chain of fingers from less; so h is one and a half ticks where there is any.
Passive damping that is larger already leaves a joint its own gains.
"""

import math

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character, Gains
from msgs_config.geometry import fixed_order, rotations

_ROOT_ENTRIES = 6
_PERIOD = 1.0 / 240.0  # s, a tick's, for which stiffness and damping of supporting joints are bound
_DAMPED_PERIOD = 1.5 * _PERIOD  # s, the same for joints with passive damping
_NEAR_GROUND = 0.01  # m over the lowest point, within which a link stands on the ground


def automatic_gains(
    character: Character, model: DynamicsModel, frequency_hz: float, heights: FloatArray
) -> dict[str, Gains]:
    """The gains of each actuated joint.

    Args:
        character: The character.
        model: Its model at rest, whose mass matrix counts.
        frequency_hz: The frequency at which each joint alone is critically damped.
        heights: Height (links,) of each link's lowest point in the rest pose, m.
    """
    mass_matrix, speed = model.mass_matrix(), 2.0 * math.pi * frequency_hz
    alone = _inertia_alone(character, mass_matrix)
    bearing = _bearing_links(character, heights)
    gains = {}
    for index, link in enumerate(character.links):
        if link.joint.type in (JointType.FIXED, JointType.FLOATING) or link.joint.mimic is not None:
            continue
        entries = character.layout.joint(link.joint.name).entries
        own = float(alone[entries].max())
        stiffness, damping = own * speed * speed, 2.0 * own * speed
        if index in bearing:
            motions = _motions_of_base(character, model, index)
            whole = fixed_order.dot(
                fixed_order.apply(mass_matrix[:_ROOT_ENTRIES, :_ROOT_ENTRIES], motions), motions
            )
            borne = float((whole - np.diag(mass_matrix)[entries]).max())
            period = _DAMPED_PERIOD if link.joint.damping else _PERIOD
            most = float(alone[entries].min()) / period
            if link.joint.damping < most:
                stiffness = max(stiffness, min(borne * speed * speed, most / period))
                damping = max(damping, min(2.0 * borne * speed, 2.0 * most))
        damping = max(damping - link.joint.damping, 0.0)
        gains[link.joint.name] = Gains(stiffness=stiffness, damping=damping)
    return gains


def _inertia_alone(character: Character, mass_matrix: FloatArray) -> FloatArray:
    """The inertia (n,) of each entry: over a fixed base all others locked, else the base free.

    A leader moves its followers as well.
    """
    if not character.layout.has_floating_base:
        return np.diag(_coupled(character, mass_matrix))
    freed = mass_matrix.copy()
    for entry in range(_ROOT_ENTRIES):  # eliminated one by one, which leaves the Schur complement
        row = freed[entry].copy()
        if row[entry] > 0.0:
            freed -= row[:, np.newaxis] * row / row[entry]
    return np.diag(_coupled(character, freed))


def _coupled(character: Character, inertia: FloatArray) -> FloatArray:
    """The inertia G^T M G (n, n) of a matrix M where followers move with their leaders."""
    if not character.coupling:
        return inertia
    matrix = character.coupling.matrix(len(inertia))
    return fixed_order.product(fixed_order.product(matrix.T, inertia), matrix)


def describe_weak_joints(character: Character, model: DynamicsModel) -> tuple[str, ...]:
    """A warning if the effort limits of a fixed character do not hold its model's pose, at rest."""
    if character.layout.has_floating_base:
        return ()
    needed = character.layout.norms(character.coupling.effort(model.gravity_force()))
    weak = [
        f"{name} ({need:.3g} of at most {limit:.3g})"
        for name, need, limit in zip(
            character.vector_names, needed, character.effort_limits(), strict=True
        )
        if need > limit
    ]
    return (f"effort limits too low to hold the rest pose: {', '.join(weak)}",) if weak else ()


def _bearing_links(character: Character, heights: FloatArray) -> set[int]:
    """Links on the way from a floating base to those that stand on the ground, but the base."""
    bearing: set[int] = set()
    lowest = heights.min()
    if not character.layout.has_floating_base or not np.isfinite(lowest):
        return bearing
    for index in np.flatnonzero(heights <= lowest + _NEAR_GROUND).tolist():
        while index > 0:
            bearing.add(index)
            index = character.links[index].parent
    return bearing


def _motions_of_base(character: Character, model: DynamicsModel, index: int) -> FloatArray:
    """Velocities (k, 6) of a base that turns about, or moves along, each axis of a link's joint."""
    joint = character.links[index].joint
    origins, turns_xyzw = model.link_poses()
    axes = np.eye(3) if joint.type is JointType.SPHERICAL else np.array([joint.axis_in_child])
    axes = rotations.rotate(turns_xyzw[index], axes)
    if joint.type is JointType.PRISMATIC:
        return np.concatenate((axes, np.zeros_like(axes)), axis=1)
    velocities = fixed_order.cross(axes, origins[0] - origins[index])
    in_base = rotations.rotate(rotations.conjugate(turns_xyzw[0]), axes)
    return np.concatenate((velocities, in_base), axis=1)
