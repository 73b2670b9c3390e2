"""The last durations of something that happens again and again, and what is typical of them."""

import math
from array import array
from collections.abc import Iterable

import numpy as np

_MAX_DURATIONS = 1 << 15


class Durations:
    """A ring of the last durations in s."""

    def __init__(self) -> None:
        self._ring = array("d")
        self._count = 0

    def add(self, duration: float) -> None:
        """Keep a duration in s, in place of the oldest once the ring is full."""
        if len(self._ring) < _MAX_DURATIONS:
            self._ring.append(duration)
        else:
            self._ring[self._count % _MAX_DURATIONS] = duration
        self._count += 1

    def mean(self) -> float | None:
        """Their mean in s; None without any."""
        return math.fsum(self._ring) / len(self._ring) if self._ring else None

    def percentiles_us(self, name: str, percentiles: Iterable[float]) -> dict[str, float]:
        """Percentiles in microseconds, under `NAME_us_pP`; nothing without any duration."""
        if not self._ring:
            return {}
        of = list(percentiles)
        values = 1e6 * np.percentile(np.array(self._ring), of)
        return {f"{name}_us_p{p:g}": round(float(v), 1) for p, v in zip(of, values, strict=True)}
