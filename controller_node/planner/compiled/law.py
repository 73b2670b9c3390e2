"""Stable PD in the world that is looked ahead in, by that world's own mass matrix and bias.

It is the controller's own equation (`msgs_config.compiled.law`), within its limits: what is
foreseen is what the controller will do.
"""

from typing import NamedTuple

from controller_node.planner.compiled.decorator import compiled
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled.law import LawGains, add_known, clip, subtract_implicit
from msgs_config.compiled.mass_matrix import MassMatrix, Tree
from msgs_config.compiled.rotations import quaternion, turn_between


class Joints(NamedTuple):
    """Where the joints but the floating base are in MuJoCo's positions and velocities."""

    ball_positions: IntArray  # (k,) where each ball joint's quaternion begins
    ball_velocities: IntArray  # (k,) where its angular velocity begins
    scalar_positions: IntArray  # (h,) of hinges and sliders
    scalar_velocities: IntArray  # (h,)


class Room(NamedTuple):
    """Room for what the law works out."""

    error: FloatArray  # (n,)
    bias: FloatArray  # (n,)
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
        law: Gains and limits; the root's gains are zero.
        room: The errors (n,), and room for the rest.
    """
    matrix, bias_room = room.implicit, room.bias
    matrix.entries[:] = mass
    bias_room[:] = bias
    effort[:] = 0.0
    add_known(effort, room.error, velocity, target_velocity, law.stiffness, law.damping, law.period)
    subtract_implicit(
        effort,
        bias_room,
        velocity,
        law.damping,
        law.passive_damping,
        law.period,
        matrix,
        tree.diagonal,
        room.acceleration,
    )
    clip(effort, law.limits, law.vector_starts, law.vector_lengths)
