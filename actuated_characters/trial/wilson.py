"""The interval in which a share lies of which so many samples were seen."""

import math

CONFIDENCE_95 = 1.959963984540054
"""The normal distribution's quantile at 0.975: two-sided 95 %."""


def wilson_interval(count: int, total: int, quantile: float = CONFIDENCE_95) -> tuple[float, float]:
    """The interval, from 0 to 1, of the share of which `count` of `total` samples were seen.

    Without samples it is all of [0, 1].

    Source: Wilson 1927, "Probable Inference, the Law of Succession, and Statistical Inference",
    without correction for continuity.

    Raises:
        ValueError: there are more than all, or less than none.
    """
    if not 0 <= count <= total:
        raise ValueError(f"{count} of {total}")
    if total == 0:
        return (0.0, 1.0)
    share, square = count / total, quantile * quantile
    scale = 1.0 / (1.0 + square / total)
    middle = scale * (share + square / (2.0 * total))
    variance = share * (1.0 - share) / total + square / (4.0 * total * total)
    half = scale * quantile * math.sqrt(variance)
    # at the ends the two terms are the same, but for the last bit
    low = 0.0 if count == 0 else middle - half
    return (low, 1.0 if count == total else middle + half)
