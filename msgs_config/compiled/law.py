"""Stable PD in compiled code, for controller, planner and batches: one equation, the same doubles.

`controller_node.control_laws.stable_pd_effort` has the equation and its source; the sums here are
its own, entry by entry.
"""

import math
from typing import NamedTuple

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled import mass_matrix
from msgs_config.compiled.decorator import compiled
from msgs_config.compiled.mass_matrix import MassMatrix


class LawGains(NamedTuple):
    """Gains and limits of the law."""

    period: float  # s, of control
    stiffness: FloatArray  # (n,) N m/rad or N/m
    damping: FloatArray  # (n,) N m s/rad or N s/m
    passive_damping: FloatArray  # (n,) of the joints themselves
    limits: FloatArray  # (b,) of each physical vector's norm, N m or N
    vector_starts: IntArray  # (b,)
    vector_lengths: IntArray  # (b,)


@compiled
def add_known(
    known: FloatArray,
    error: FloatArray,
    velocity: FloatArray,
    target_velocity: FloatArray,
    stiffness: FloatArray,
    damping: FloatArray,
    period: float,
) -> None:
    """Add to a feedforward or to zero (n,) the effort without what follows of the acceleration.

    Errors (n,) are those of the reference at the period's end against the state.
    """
    for i in range(len(velocity)):
        known[i] = (
            known[i]
            + stiffness[i] * (error[i] - period * velocity[i])
            + damping[i] * (target_velocity[i] - velocity[i])
        )


@compiled
def subtract_implicit(
    effort: FloatArray,
    bias: FloatArray,
    velocity: FloatArray,
    damping: FloatArray,
    passive_damping: FloatArray,
    period: float,
    matrix: MassMatrix,
    diagonal: IntArray,
    acceleration: FloatArray,
) -> None:
    """Take from an effort (n,), which is what is known of it, what the acceleration takes.

    Args:
        effort: What is known; the result.
        bias: Coriolis, centrifugal and gravity (n,), without the joints' passive damping; room.
        velocity: Of the state (n,).
        damping: The law's (n,).
        passive_damping: The joints' own (n,).
        period: s.
        matrix: The mass matrix in the state, which stays; it is factorised with the damping.
        diagonal: Where its entries have the diagonal (n,).
        acceleration: Room (n,).
    """
    without = acceleration
    for i in range(len(effort)):
        without[i] = matrix.entries[diagonal[i]]
        implicit = period * passive_damping[i] + damping[i] * period
        matrix.entries[diagonal[i]] = without[i] + implicit
        bias[i] = effort[i] - (bias[i] + passive_damping[i] * velocity[i])
    mass_matrix.factorise(matrix)
    for i in range(len(effort)):
        matrix.entries[diagonal[i]] = without[i]
    mass_matrix.solve(matrix, bias, acceleration)
    for i in range(len(effort)):
        effort[i] -= damping[i] * period * acceleration[i]


@compiled
def clip(effort: FloatArray, limits: FloatArray, starts: IntArray, lengths: IntArray) -> None:
    """Shorten each physical vector of an effort (n,) to its limit (b,): `JointLayout.clipped`."""
    for vector in range(len(limits)):
        first = starts[vector]
        last = first + lengths[vector]
        norm = _norm(effort, first, last, 1.0)
        if norm == math.inf:  # too large to be squared: measured in its own largest entry
            largest = 0.0
            for i in range(first, last):
                largest = max(largest, abs(effort[i]))
            norm = largest * _norm(effort, first, last, largest)
        if norm > limits[vector]:
            scale = limits[vector] / norm
            for i in range(first, last):
                effort[i] *= scale


@compiled
def _norm(entries: FloatArray, first: int, last: int, unit: float) -> float:
    square = 0.0
    for i in range(first, last):
        square += (entries[i] / unit) * (entries[i] / unit)
    return math.sqrt(square)
