"""Sums and products of arrays whose additions have one order, from the first index to the last.

The last bits of a sum depend on the order of its additions. numpy chooses that of `sum`, `dot`, `@`
and `einsum` by what the processor and its BLAS offer, and a newer numpy may choose another. A
result must depend on neither, so whatever lies between a message and the next state adds up here:
`accumulate` keeps every partial sum, which leaves a single order.
"""

import numpy as np

from msgs_config.arrays import FloatArray

_FEW_ADDENDS = 8  # addends, up to which whole columns are added: `accumulate` would go row by row

_NEXT_AXIS, _AXIS_AFTER_NEXT = np.array((1, 2, 0)), np.array((2, 0, 1))  # the axes' cycle


def total(values: FloatArray, axis: int = -1) -> FloatArray:
    """The sum of values along an axis; zero along one that is empty."""
    addends = values.shape[axis]
    if not addends:
        return np.zeros(tuple(np.delete(values.shape, axis)))
    if axis == -1 and 1 < addends <= _FEW_ADDENDS:
        columns = values[..., 0] + values[..., 1]
        for addend in range(2, addends):
            columns = columns + values[..., addend]
        return columns
    whole: FloatArray = np.add.accumulate(values, axis=axis).take(-1, axis=axis)
    return whole


def mean(values: FloatArray, axis: int = -1) -> FloatArray:
    """The mean of values along an axis, which is not empty."""
    average: FloatArray = total(values, axis) / values.shape[axis]
    return average


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Scalar products (...) of vectors (..., m), broadcast against each other."""
    return total(a * b)


def norm(vectors: FloatArray) -> FloatArray:
    """Euclidean lengths (...) of vectors (..., m)."""
    lengths: FloatArray = np.sqrt(total(vectors * vectors))
    return lengths


def apply(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Each vector (..., m) multiplied by its matrix (..., k, m): (..., k)."""
    return total(matrices * vectors[..., np.newaxis, :])


def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Matrix products (..., i, k) of matrices (..., i, j) and (..., j, k)."""
    return total(a[..., np.newaxis] * b[..., np.newaxis, :, :], axis=-2)


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Vector products `a x b` (..., 3) of vectors (..., 3), broadcast against each other."""
    crossed: FloatArray = a.take(_NEXT_AXIS, axis=-1) * b.take(_AXIS_AFTER_NEXT, axis=-1)
    crossed -= a.take(_AXIS_AFTER_NEXT, axis=-1) * b.take(_NEXT_AXIS, axis=-1)
    return crossed


def powers(bases: FloatArray, count: int) -> FloatArray:
    """The powers (..., count) of bases (...) to the exponents 0, 1, ... count - 1."""
    factors = np.repeat(bases[..., np.newaxis], count, axis=-1)
    factors[..., 0] = 1.0
    products: FloatArray = np.multiply.accumulate(factors, axis=-1)
    return products


def solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """The X (k, m) of `A X = B` of a small matrix (k, k), by Gauss and Jordan's elimination.

    The rows are exchanged so that the largest of a column divides: Golub and Van Loan 2013, "Matrix
    Computations", section 3.4.

    Raises:
        ZeroDivisionError: the matrix has no inverse.
    """
    table = np.column_stack((matrix, right))
    size = len(table)
    for i in range(size):
        pivot = i + int(np.abs(table[i:, i]).argmax())
        if pivot != i:
            table[[i, pivot]] = table[[pivot, i]]
        if table[i, i] == 0.0:
            raise ZeroDivisionError("the matrix has no inverse")
        factors = table[:, i] / table[i, i]
        factors[i] = 0.0
        table -= factors[:, np.newaxis] * table[i]
    solution: FloatArray = table[:, size:] / table.diagonal()[:, np.newaxis]
    return solution
