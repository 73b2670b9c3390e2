"""Normal numbers that depend on nothing but their key: random words, and Box and Muller's way."""

import math

import numpy as np

from controller_node.planner.compiled.decorator import compiled
from msgs_config.arrays import FloatArray
from msgs_config.random_words import random_words

_STEP = 2.0**-53


def normal_draws(key: tuple[int, int], counter: tuple[int, int], count: int) -> FloatArray:
    """Standard normal numbers (count,) of a key and a counter.

    Source: Box and Muller 1958, "A Note on the Generation of Random Normal Deviates".
    """
    raw = random_words(key, (0, 0, *counter), count + count % 2)
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
