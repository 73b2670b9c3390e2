"""Sparse mass matrices: the lower triangle along the tree of the links, as MuJoCo stores it.

Row k has the entries of the degrees of freedom above k on the way to the base, then the diagonal.
Source: Featherstone 2008, "Rigid Body Dynamics Algorithms", sections 6.4 and 6.5.
"""

from typing import NamedTuple

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled.decorator import compiled
from msgs_config.compiled.mujoco_functions import factorise_mass, solve_mass


class Tree(NamedTuple):
    """Where the entries of a mass matrix are."""

    starts: IntArray  # (n,) where each row begins among the entries
    lengths: IntArray  # (n,) number of entries in each row
    columns: IntArray  # (e,) the column of each entry
    diagonal: IntArray  # (n,) where the diagonal is among the entries


class MassMatrix(NamedTuple):
    """A mass matrix that MuJoCo factorises, and solves with, along the tree."""

    model: int  # MuJoCo's model and data, by their addresses
    data: int
    entries: FloatArray  # (e,)


@compiled
def factorise(matrix: MassMatrix) -> None:
    """Take the entries as they are, for `solve`."""
    factorise_mass(matrix.model, matrix.data)


@compiled
def solve(matrix: MassMatrix, force: FloatArray, acceleration: FloatArray) -> None:
    """Write the acceleration (n,) that a force (n,) leads to."""
    out, right = acceleration.ctypes.data, force.ctypes.data
    solve_mass(matrix.model, matrix.data, out, right, 1)


@compiled
def base_momentum(
    entries: FloatArray, tree: Tree, velocity: FloatArray, momentum: FloatArray
) -> None:
    """Write the first six entries (6,) of `M v`, the momentum of the floating base's coordinates.

    Those of the translation are the whole momentum in N s, world axes; those of the rotation the
    angular momentum in N m s about the base's origin, in the base frame.
    """
    momentum[:] = 0.0
    for k in range(len(tree.starts)):
        start, last = tree.starts[k], tree.lengths[k] - 1
        for i in range(last + 1):
            column = tree.columns[start + i]
            if column < 6:
                momentum[column] += entries[start + i] * velocity[k]
            if k < 6 and i < last:
                momentum[k] += entries[start + i] * velocity[column]
