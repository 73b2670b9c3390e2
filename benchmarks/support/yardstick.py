"""A piece of work to measure others by: Python and numpy on small arrays, as this package is."""

import time

import numpy as np

_ROUNDS = 7  # the best one counts, which others on the machine disturbed the least
_CALLS = 2000


def yardstick_us() -> float:
    """Processor time of one call of the yardstick, µs; about 10 on a machine of 2020."""
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
