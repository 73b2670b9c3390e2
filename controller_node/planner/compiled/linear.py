"""Products of matrices and small linear systems, their sums in one order on every processor.

Inner loops run along rows whose entries do not meet, which a compiler may do several at a time
without another result; a sum along a row has four parts, added up at the end.
"""

import math

import numpy as np

from controller_node.planner.compiled.decorator import compiled
from msgs_config.arrays import FloatArray


@compiled
def dot(a: FloatArray, b: FloatArray) -> float:
    """The scalar product of two vectors (m,)."""
    one, two, three, four = 0.0, 0.0, 0.0, 0.0
    whole = len(a) - len(a) % 4
    for i in range(0, whole, 4):
        one += a[i] * b[i]
        two += a[i + 1] * b[i + 1]
        three += a[i + 2] * b[i + 2]
        four += a[i + 3] * b[i + 3]
    for i in range(whole, len(a)):
        one += a[i] * b[i]
    return (one + two) + (three + four)


@compiled
def gram(rows: FloatArray) -> FloatArray:
    """The scalar products (r, r) of rows (r, m) with each other."""
    count = len(rows)
    products = np.empty((count, count))
    for i in range(count):
        for j in range(i + 1):
            products[i, j] = products[j, i] = dot(rows[i], rows[j])
    return products


@compiled
def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """The matrix product (i, k) of matrices (i, j) and (j, k)."""
    result = np.zeros((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            factor = a[i, j]
            for k in range(b.shape[1]):
                result[i, k] += factor * b[j, k]
    return result


@compiled
def solve(matrix: FloatArray, ridge: float, right: FloatArray) -> FloatArray:
    """The solution X (r, m) of `(A + ridge I) X = B`, A (r, r) positive semidefinite: Cholesky's.

    Without a ridge that makes it positive definite the result is not finite.
    """
    size = len(matrix)
    lower, solution = np.empty((size, size)), right.copy()
    for i in range(size):
        for j in range(i + 1):
            rest = matrix[i, j] - dot(lower[i, :j], lower[j, :j])
            lower[i, j] = math.sqrt(rest + ridge) if i == j else rest / lower[j, j]
    for i in range(size):
        for j in range(i):
            _subtract(solution[i], lower[i, j], solution[j])
        solution[i] /= lower[i, i]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            _subtract(solution[i], lower[j, i], solution[j])
        solution[i] /= lower[i, i]
    return solution


@compiled
def _subtract(row: FloatArray, factor: float, other: FloatArray) -> None:
    for k in range(len(row)):
        row[k] -= factor * other[k]
