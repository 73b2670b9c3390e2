"""Sparse mass matrices: the lower triangle along the tree of the links, as MuJoCo stores it.

Row k has the entries of the degrees of freedom above k on the way to the base, then the diagonal.
Source: Featherstone 2008, "Rigid Body Dynamics Algorithms", sections 6.4 and 6.5.
"""

from typing import NamedTuple

from controller_node.planner.compiled.decorator import compiled
from msgs_config.arrays import FloatArray, IntArray


class Tree(NamedTuple):
    """Where the entries of a mass matrix are."""

    starts: IntArray  # (n,) of each row among the entries
    lengths: IntArray  # (n,) of each row
    columns: IntArray  # (e,) of each entry


@compiled
def factorise(entries: FloatArray, inverse_diagonal: FloatArray, tree: Tree) -> None:
    """Replace the entries (e,) of M by those of L in `M = L' D L`; write 1 / D (n,)."""
    for k in range(len(tree.starts) - 1, -1, -1):
        start, last = tree.starts[k], tree.lengths[k] - 1
        inverse = 1.0 / entries[start + last]
        inverse_diagonal[k] = inverse
        for i in range(last - 1, -1, -1):
            above = tree.starts[tree.columns[start + i]]
            factor = entries[start + i] * inverse
            for j in range(i + 1):
                entries[above + j] -= factor * entries[start + j]
            entries[start + i] = factor


@compiled
def solve(entries: FloatArray, inverse_diagonal: FloatArray, tree: Tree, x: FloatArray) -> None:
    """Replace x (n,) by the solution y of `L' D L y = x`."""
    n = len(tree.starts)
    for k in range(n - 1, -1, -1):
        start = tree.starts[k]
        for i in range(tree.lengths[k] - 1):
            x[tree.columns[start + i]] -= entries[start + i] * x[k]
    for k in range(n):
        x[k] *= inverse_diagonal[k]
    for k in range(n):
        start = tree.starts[k]
        for i in range(tree.lengths[k] - 1):
            x[k] -= entries[start + i] * x[tree.columns[start + i]]


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
