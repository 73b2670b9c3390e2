"""How long the calls of a method take, and a piece of work to measure others by."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np

_ROUNDS = 7  # the best one counts, which others on the machine disturbed the least
_CALLS = 2000


@contextmanager
def timed(owner: type, method: str) -> Iterator[list[float]]:
    """Durations in s of a method's calls within the block, in a list that grows."""
    durations: list[float] = []
    function = getattr(owner, method)

    def timing(*arguments: Any, **options: Any) -> Any:
        started = time.perf_counter()
        result = function(*arguments, **options)
        durations.append(time.perf_counter() - started)
        return result

    with patch.object(owner, method, timing):
        yield durations


def yardstick_us() -> float:
    """Processor time of one call of the yardstick, µs; about 10 on a machine of 2020.

    It is Python and numpy on small arrays, as this package is.
    """
    matrix = np.linspace(-1.0, 1.0, 34 * 34).reshape(34, 34)
    durations = []
    for _ in range(_ROUNDS):
        vector = np.linspace(0.0, 1.0, 34)
        started = time.process_time()
        for _ in range(_CALLS):
            vector = np.tanh(matrix @ vector + 0.5)
            vector = np.where(vector > 0.0, vector, -vector)
            vector /= 1.0 + float(np.abs(vector).max())
        durations.append(time.process_time() - started)
    return 1e6 * min(durations) / _CALLS
