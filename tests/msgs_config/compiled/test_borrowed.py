"""What is borrowed is the same memory, and counts no owner."""

import sys
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.compiled.borrowed import borrow
from msgs_config.compiled.decorator import compiled


class Inner(NamedTuple):
    rows: FloatArray
    number: int


class Outer(NamedTuple):
    column: FloatArray
    inner: Inner


@compiled
def double(held: Outer) -> float:
    lent = borrow(held)
    lent.inner.rows[1] *= 2.0
    return lent.column[1:].sum() + lent.inner.number


def test_what_is_borrowed_is_the_same_memory() -> None:
    column, rows = np.arange(3.0), np.ones((2, 2))
    held = Outer(column, Inner(rows, 4))
    before = sys.getrefcount(column), sys.getrefcount(rows)

    results = [double(held) for _ in range(100)]

    assert results == [7.0] * 100
    assert rows.tolist() == [[1.0, 1.0], [2.0**100, 2.0**100]]
    assert (sys.getrefcount(column), sys.getrefcount(rows)) == before
