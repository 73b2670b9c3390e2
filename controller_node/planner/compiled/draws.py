"""Random numbers that depend on nothing but their key: numpy's Philox, and Box and Muller's way.

A generator's normal draws may change with numpy; its raw words do not.
"""

import math

import numpy as np

from controller_node.planner.compiled.decorator import compiled
from msgs_config.arrays import FloatArray

_STEP = 2.0**-53
_MASK = 2**64 - 1


def normal_draws(key: tuple[int, int], counter: tuple[int, int], count: int) -> FloatArray:
    """Standard normal numbers (count,) of a key and a counter.

    Source: Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3" (Philox); Box and
    Muller 1958, "A Note on the Generation of Random Normal Deviates".
    """
    words = [word & _MASK for word in (0, 0, *counter)]
    generator = np.random.Philox(counter=words, key=[word & _MASK for word in key])
    raw = generator.random_raw(count + count % 2)
    return _normal((raw >> np.uint64(11)).astype(float))[:count]


@compiled
def _normal(words: FloatArray) -> FloatArray:
    """Standard normal numbers of words (2 m,), whole numbers from 0 to 2^53 - 1."""
    numbers = np.empty(len(words))
    for i in range(0, len(words), 2):
        radius = math.sqrt(-2.0 * math.log((words[i] + 1.0) * _STEP))
        angle = 2.0 * math.pi * _STEP * words[i + 1]
        numbers[i], numbers[i + 1] = radius * math.cos(angle), radius * math.sin(angle)
    return numbers
