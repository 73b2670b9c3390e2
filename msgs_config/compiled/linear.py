"""Products of matrices and small linear systems, their sums in one order on every processor.

Inner loops run along rows whose entries do not meet, which a compiler may do several at a time
without another result; four rows are added at once. A scalar product has four parts, added up at
the end.
"""

import math

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.compiled.decorator import compiled


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
    count, length = rows.shape
    columns, products = rows.T.copy(), np.zeros((count, count))
    whole = length - length % 4
    for k in range(0, whole, 4):
        one, two, three, four = columns[k], columns[k + 1], columns[k + 2], columns[k + 3]
        for i in range(count):
            _add_four(
                products[i, : i + 1], one[i], one, two[i], two, three[i], three, four[i], four
            )
    for k in range(whole, length):
        for i in range(count):
            _subtract(products[i, : i + 1], -columns[k, i], columns[k])
    for i in range(count):
        products[:i, i] = products[i, :i]
    return products


@compiled
def _add_four(
    row: FloatArray,
    a: float,
    one: FloatArray,
    b: float,
    two: FloatArray,
    c: float,
    three: FloatArray,
    d: float,
    four: FloatArray,
) -> None:
    """Add `a one + b two + c three + d four`, entry by entry; they may be longer than the row."""
    for k in range(len(row)):
        row[k] += (a * one[k] + b * two[k]) + (c * three[k] + d * four[k])


@compiled
def times(a: FloatArray, b: FloatArray) -> FloatArray:
    """The product (i,) of a matrix (i, j) and a vector (j,)."""
    result = np.empty(len(a))
    for i in range(len(a)):
        result[i] = dot(a[i], b)
    return result


@compiled
def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """The matrix product (i, k) of matrices (i, j) and (j, k)."""
    result, length = np.zeros((a.shape[0], b.shape[1])), a.shape[1]
    whole = length - length % 4
    for i in range(a.shape[0]):
        row, factors = result[i], a[i]
        for j in range(0, whole, 4):
            f, g, h, s = factors[j], factors[j + 1], factors[j + 2], factors[j + 3]
            _add_four(row, f, b[j], g, b[j + 1], h, b[j + 2], s, b[j + 3])
        for j in range(whole, length):
            _subtract(row, -factors[j], b[j])
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
