"""What a tick takes, how long the calls of a method, and a piece of work to measure others by."""

import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

import numpy as np

from msgs_config.arrays import FloatArray
from sim_node.physics.engine import make_world
from sim_node.physics.settings import WorldSettings

_ROUNDS = 7  # the best one counts, which others on the machine disturbed the least
_CALLS = 2000


@dataclass(frozen=True)
class TickTimes:
    """What one tick, or one round trip, takes."""

    p50_us: float  # median of the wall time
    p99_us: float  # its 99th percentile
    per_second: float
    processor_us: float  # mean of all processes' processor time; NaN: not measured

    @classmethod
    def of(cls, durations: FloatArray, processor_s: float = float("nan")) -> "TickTimes":
        """Of durations (ticks,) in s, and the processor time in s of all together."""
        p50, p99 = np.percentile(1e6 * durations, (50, 99))
        processor_us = 1e6 * processor_s / len(durations)
        return cls(float(p50), float(p99), float(1.0 / durations.mean()), processor_us)


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


def timed_engine() -> AbstractContextManager[list[float]]:
    """Durations in s of the steps of the default engine's worlds within the block, likewise."""
    with make_world(WorldSettings()) as world:
        return timed(type(world), "step")


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
