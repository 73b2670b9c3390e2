"""Where episodes begin: anywhere in the references, and more often shortly before they are lost.

What is hard is a small part of most motions, such as a landing, or a step back; if all moments were
as likely, most of what is tried would be what the policy can do already (adaptive sampling, as in
Liao et al. 2025, "BeyondMimic").
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray, IntArray

_BIN_S = 0.5  # s, of what counts as one moment
_HARD = 0.5  # share of episodes that begin where it is hard
_BEFORE = (0.5, 0.3, 0.2)  # how much a fall tells of its own moment, and of the ones before
_KEEPS = 0.99  # of what was counted, a trace
_FEW = 20.0  # decisions for which a moment counts as hard as the mean, as little is known


@dataclass(frozen=True)
class Stretch:
    """Rows of a table in which episodes of one reference may begin."""

    first: int
    count: int
    wraps: bool  # whether the rows after them are the same motion again

    @property
    def rows(self) -> IntArray:
        """All of them."""
        return np.arange(self.first, self.first + self.count, dtype=np.intp)


class Starts:
    """Draws rows; each reference is as likely as the others, but for what is hard in it."""

    def __init__(self, stretches: Sequence[Stretch], rate_hz: int) -> None:
        """Divide them into moments."""
        self._stretches = stretches
        self._counts = [max(round(each.count / (_BIN_S * rate_hz)), 1) for each in stretches]
        edges = [
            each.first + each.count * np.arange(count + 1) // count
            for each, count in zip(stretches, self._counts, strict=True)
        ]
        self._lows = np.concatenate([each[:-1] for each in edges])
        self._sizes = np.concatenate([np.diff(each) for each in edges])
        self._firsts = np.array([each.first for each in stretches], dtype=np.intp)
        shares = [self._sizes[part] / self._sizes[part].sum() for part in self._parts()]
        self._even: FloatArray = np.concatenate(shares) / len(stretches)
        self._weights = self._even
        self._falls, self._visits = np.zeros(len(self._lows)), np.zeros(len(self._lows))

    def draw(self, count: int, rng: np.random.Generator) -> IntArray:
        """So many rows."""
        bounds = np.cumsum(self._weights)
        moments = np.searchsorted(bounds, bounds[-1] * rng.random(count), side="right")
        moments = np.minimum(moments, len(bounds) - 1)
        offsets = (rng.random(count) * self._sizes[moments]).astype(np.intp)
        rows: IntArray = self._lows[moments] + offsets
        return rows

    def learn(self, rows: IntArray, fell: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> None:
        """Take from the rows of decisions, and whether they ended in a fall, what is hard."""
        moments, size = self._moments(rows.ravel()), len(self._lows)
        self._visits *= _KEEPS
        self._falls *= _KEEPS
        self._visits += np.bincount(moments, minlength=size)
        self._falls += np.bincount(moments[fell.ravel()], minlength=size)
        total = self._falls.sum()
        if not total:
            return
        usual = total / self._visits.sum()
        rates = (self._falls + _FEW * usual) / (self._visits + _FEW)
        hard = self._even * np.concatenate(
            [
                _told_before(rates[part], each.wraps)
                for part, each in zip(self._parts(), self._stretches, strict=True)
            ]
        )
        self._weights = (1.0 - _HARD) * self._even + _HARD * hard / hard.sum()

    def _parts(self) -> list[slice]:
        """The moments of each reference."""
        ends = np.cumsum(self._counts).tolist()
        return [slice(end - count, end) for end, count in zip(ends, self._counts, strict=True)]

    def _moments(self, rows: IntArray) -> IntArray:
        """The moment that each row is of; what follows the last one counts as that one."""
        which = np.searchsorted(self._firsts, rows, side="right") - 1
        found = np.empty(len(rows), np.intp)
        for number, (part, each) in enumerate(zip(self._parts(), self._stretches, strict=True)):
            own = which == number
            off = rows[own] - each.first
            off = off % each.count if each.wraps else np.minimum(off, each.count - 1)
            lows = self._lows[part] - each.first
            found[own] = part.start + np.searchsorted(lows, off, side="right") - 1
        return found


def _told_before(rates: FloatArray, wraps: bool) -> FloatArray:
    """What falls (m,) of moments tell of those and the ones before, of one reference."""
    told = np.zeros_like(rates)
    for later, share in enumerate(_BEFORE):
        ahead = np.arange(len(rates)) + later
        told += share * rates[ahead % len(rates) if wraps else np.minimum(ahead, len(rates) - 1)]
    return told
