"""Noise of a sensor: a function of seed, sensor and tick, however often the sensor was read."""

import hashlib
import math
from functools import lru_cache, partial

from msgs_config.character.sensors import Noise
from msgs_config.geometry import scalars
from msgs_config.random_words import random_words

_WORDS = 4  # random words that three normal numbers are made of
_STEP = 2.0**-53
_WHITE, _BIAS, _WALK = range(3)  # the kinds of numbers that are drawn
_PATH = 256  # drawn numbers of the walk that are remembered; a tick needs about 40


class NoiseSource:
    """The noise of one measured vector."""

    def __init__(self, noise: Noise, seed: int, name: str, tick_s: float) -> None:
        """`name` is of the sensor and the vector; no two in a simulation may have the same."""
        name_key = hashlib.sha256(name.encode()).digest()[:8]
        self._key = (seed, int.from_bytes(name_key, "little"))
        self._noise = noise
        self._walk_per_tick = _scale(math.sqrt(tick_s), noise.bias_walk)
        drawn = self._draw(_BIAS, 0)
        self._bias = _add(noise.bias, _multiply(noise.bias_stddev, drawn))
        # Remembered, because the tick before mostly had the same numbers.
        self._walk_step = lru_cache(maxsize=_PATH)(partial(self._draw, _WALK))

    def at(self, tick: int) -> scalars.Vector:
        """What is added to the vector at a tick."""
        value = self._bias
        if any(self._noise.stddev):
            value = _add(value, _multiply(self._noise.stddev, self._draw(_WHITE, tick)))
        if any(self._walk_per_tick):
            value = _add(value, _multiply(self._walk_per_tick, self._walk(tick)))
        return value

    def _walk(self, tick: int) -> scalars.Vector:
        """A random walk of unit steps at a tick, found without those before.

        Between two known ticks a walk has normal distribution about their mean, with a quarter of
        their distance for variance in the middle (Lévy's construction of Brownian motion).
        """
        high, at_high = 1, self._walk_step(1)
        low, at_low = 0, (0.0, 0.0, 0.0)
        while high < tick:  # each step is to the next power of two, as far away as 0 is
            low, at_low = high, at_high
            high, at_high = 2 * low, _add(at_low, _scale(math.sqrt(low), self._walk_step(2 * low)))
        while tick < high:
            middle = (low + high) // 2
            if middle == low:
                return at_low
            mean = _scale(0.5, _add(at_low, at_high))
            deviation = 0.5 * math.sqrt(high - low)
            at_middle = _add(mean, _scale(deviation, self._walk_step(middle)))
            if tick < middle:
                high, at_high = middle, at_middle
            else:
                low, at_low = middle, at_middle
        return at_high

    def _draw(self, what: int, tick: int) -> scalars.Vector:
        """Three standard normal numbers.

        Source: Box and Muller 1958, "A Note on the Generation of Random Normal Deviates".
        """
        words = random_words(self._key, (0, 0, tick, what), _WORDS).tolist()
        a, b, c, d = (word >> 11 for word in words)
        radius = math.sqrt(-2.0 * math.log((a + 1.0) * _STEP))
        angle = 2.0 * math.pi * _STEP * b
        third = math.sqrt(-2.0 * math.log((c + 1.0) * _STEP)) * math.cos(2.0 * math.pi * _STEP * d)
        return (radius * math.cos(angle), radius * math.sin(angle), third)


def _add(a: scalars.Vector, b: scalars.Vector) -> scalars.Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _scale(factor: float, values: scalars.Vector) -> scalars.Vector:
    return (factor * values[0], factor * values[1], factor * values[2])


def _multiply(a: scalars.Vector, b: scalars.Vector) -> scalars.Vector:
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])
