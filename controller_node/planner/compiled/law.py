"""Stable PD (`controller_node.control_laws.stable_pd_effort`) in compiled code, within its limits.

The same equation as the controller's: what is foreseen is what the controller will do.
"""

import math
from typing import NamedTuple

from controller_node.planner.compiled.decorator import compiled
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled import mass_matrix
from msgs_config.compiled.mass_matrix import MassMatrix, Tree
from msgs_config.compiled.rotations import quaternion, turn_between


class Joints(NamedTuple):
    """Where the joints but the floating base are in MuJoCo's positions and velocities."""

    ball_positions: IntArray  # (k,) where each ball joint's quaternion begins
    ball_velocities: IntArray  # (k,) where its angular velocity begins
    scalar_positions: IntArray  # (h,) of hinges and sliders
    scalar_velocities: IntArray  # (h,)


class LawGains(NamedTuple):
    """Gains and limits of the law; the root's are zero."""

    period: float  # s, of control and of simulation
    stiffness: FloatArray  # (n,)
    damping: FloatArray  # (n,)
    passive_damping: FloatArray  # (n,) of the joints themselves
    limits: FloatArray  # (b,) of each physical vector's norm, N m or N
    vector_starts: IntArray  # (b,)
    vector_lengths: IntArray  # (b,)


class Room(NamedTuple):
    """Room for what the law works out."""

    error: FloatArray  # (n,)
    known: FloatArray  # (n,)
    force: FloatArray  # (n,)
    acceleration: FloatArray  # (n,)
    implicit: MassMatrix  # mass matrix with the law's damping over a period


@compiled
def add_errors(error: FloatArray, position: FloatArray, target: FloatArray, joints: Joints) -> None:
    """Add what leads the joints from a position to a target, both MuJoCo's, to an error (n,)."""
    for k in range(len(joints.ball_positions)):
        start = joints.ball_positions[k]
        turn = turn_between(quaternion(position, start), quaternion(target, start))
        for i in range(3):
            error[joints.ball_velocities[k] + i] += turn[i]
    for k in range(len(joints.scalar_positions)):
        entry = joints.scalar_positions[k]
        error[joints.scalar_velocities[k]] += target[entry] - position[entry]


@compiled
def stable_pd(
    effort: FloatArray,
    velocity: FloatArray,
    target_velocity: FloatArray,
    bias: FloatArray,
    mass: FloatArray,
    tree: Tree,
    law: LawGains,
    room: Room,
) -> None:
    """Write the effort (n,) against the errors in `room`, reference at the period's end.

    Args:
        effort: The result (n,), N m or N.
        velocity: Of the state (n,).
        target_velocity: Of the reference (n,).
        bias: Coriolis, centrifugal and gravity (n,), without the joints' passive damping.
        mass: Entries (e,) of the mass matrix.
        tree: Where they are.
        law: Gains and limits.
        room: The errors (n,), and room for the rest.
    """
    period, matrix = law.period, room.implicit
    matrix.entries[:] = mass
    for i in range(len(velocity)):
        stiffness, damping = law.stiffness[i], law.damping[i]
        room.known[i] = stiffness * (room.error[i] - period * velocity[i]) + damping * (
            target_velocity[i] - velocity[i]
        )
        room.force[i] = room.known[i] - (bias[i] + law.passive_damping[i] * velocity[i])
        diagonal = tree.starts[i] + tree.lengths[i] - 1
        matrix.entries[diagonal] += period * (law.passive_damping[i] + damping)
    mass_matrix.factorise(matrix)
    mass_matrix.solve(matrix, room.force, room.acceleration)
    for i in range(len(velocity)):
        effort[i] = room.known[i] - law.damping[i] * period * room.acceleration[i]
    _clip(effort, law)


@compiled
def _clip(effort: FloatArray, law: LawGains) -> None:
    """Shorten each physical vector to its limit."""
    for vector in range(len(law.limits)):
        first = law.vector_starts[vector]
        last = first + law.vector_lengths[vector]
        square = 0.0
        for i in range(first, last):
            square += effort[i] * effort[i]
        norm = math.sqrt(square)
        if norm > law.limits[vector]:
            for i in range(first, last):
                effort[i] *= law.limits[vector] / norm
