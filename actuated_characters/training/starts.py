"""Where episodes begin: anywhere in the references, and more often around where others fell.

Some begin where runs do, in the first row: a clip may begin in the air, with a foot in the ground,
or faster than it is anywhere else, which a start anywhere hardly meets.

What is hard is a small part of most motions, such as a landing, or a step back; if all moments were
as likely, most of what is tried would be what the policy can do already (adaptive sampling, as in
Liao et al. 2025, "BeyondMimic").
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray

_BIN_S = 0.5  # s, about
_BEGINNINGS = 0.1  # share of episodes that begin in the first row of a reference
_HARD = 0.5  # share of episodes that begin by how often others fell
_KERNEL = (0.5, 0.3, 0.2)  # what a fall counts in its own bin, and in those before it
_KEEPS = 0.99  # of what was counted, a trace
_PRIOR = 20.0  # decisions of each bin, at the mean failure rate, that count beside those seen


@dataclass(frozen=True)
class StartRange:
    """Rows of a table in which episodes of one reference may begin."""

    first: int
    count: int
    wraps: bool  # whether the rows after them are the same motion again
    weight: float = 1.0  # how many begin in it, against others

    @property
    def rows(self) -> IntArray:
        """All of them."""
        return np.arange(self.first, self.first + self.count, dtype=np.intp)


class Starts:
    """Draws rows: references by their weights, and in one half of the starts by failure rates."""

    def __init__(self, ranges: Sequence[StartRange], rate_hz: int) -> None:
        """Divide each range into bins."""
        self._ranges = ranges
        numbers = [max(round(each.count / (_BIN_S * rate_hz)), 1) for each in ranges]
        edges = [
            each.first + each.count * np.arange(number + 1) // number
            for each, number in zip(ranges, numbers, strict=True)
        ]
        self._lows = np.concatenate([each[:-1] for each in edges])
        self._sizes = np.concatenate([np.diff(each) for each in edges])
        ends = np.cumsum(numbers).tolist()
        self._beginnings = np.repeat([each.first for each in ranges], numbers)
        self._parts = [slice(a - b, a) for a, b in zip(ends, numbers, strict=True)]  # of bins
        self._even = self._shared(self._sizes.astype(float))
        self._weights = self._even
        self._falls, self._visits = np.zeros(len(self._lows)), np.zeros(len(self._lows))

    def draw(self, count: int, rng: np.random.Generator) -> IntArray:
        """So many rows."""
        bounds = np.cumsum(self._weights)
        bins = np.searchsorted(bounds, bounds[-1] * rng.random(count), side="right")
        bins = np.minimum(bins, len(bounds) - 1)
        offsets = (rng.random(count) * self._sizes[bins]).astype(np.intp)
        begins = rng.random(count) < _BEGINNINGS
        rows: IntArray = np.where(begins, self._beginnings[bins], self._lows[bins] + offsets)
        return rows

    def learn(self, rows: IntArray, fell: BoolArray) -> None:
        """Take failure rates from the rows of decisions, and whether they ended in a fall."""
        bins, size = self._bins(rows.ravel()), len(self._lows)
        self._visits *= _KEEPS
        self._falls *= _KEEPS
        self._visits += np.bincount(bins, minlength=size)
        self._falls += np.bincount(bins[fell.ravel()], minlength=size)
        total = self._falls.sum()
        if not total:
            return
        usual = total / self._visits.sum()
        rates = (self._falls + _PRIOR * usual) / (self._visits + _PRIOR)
        smooth = [
            _smoothed(rates[part], each.wraps)
            for part, each in zip(self._parts, self._ranges, strict=True)
        ]
        hard = self._shared(self._even * np.concatenate(smooth))
        self._weights = (1.0 - _HARD) * self._even + _HARD * hard

    def _shared(self, weights: FloatArray) -> FloatArray:
        """Weights of bins, so that those of each range have its weight in sum, together one."""
        parts = [
            each.weight * weights[part] / weights[part].sum()
            for part, each in zip(self._parts, self._ranges, strict=True)
        ]
        shared: FloatArray = np.concatenate(parts) / sum(each.weight for each in self._ranges)
        return shared

    def _bins(self, rows: IntArray) -> IntArray:
        """The bin that each row is in; what follows the end of a range counts as its last row."""
        firsts = np.array([each.first for each in self._ranges], dtype=np.intp)
        which = np.searchsorted(firsts, rows, side="right") - 1
        found = np.empty(len(rows), np.intp)
        for number, (part, each) in enumerate(zip(self._parts, self._ranges, strict=True)):
            own = which == number
            off = rows[own] - each.first
            off = off % each.count if each.wraps else np.minimum(off, each.count - 1)
            lows = self._lows[part] - each.first
            found[own] = part.start + np.searchsorted(lows, off, side="right") - 1
        return found


def _smoothed(rates: FloatArray, wraps: bool) -> FloatArray:
    """Failure rates (m,) of a range's bins, spread to those before by the kernel.

    Where the motion ends, what would follow is as its last bin.
    """
    smooth = np.zeros_like(rates)
    for later, share in enumerate(_KERNEL):
        ahead = np.arange(len(rates)) + later
        smooth += share * rates[ahead % len(rates) if wraps else np.minimum(ahead, len(rates) - 1)]
    return smooth
