"""Numbers of the hidden cases: drawn from a seed, the same on every machine."""

from msgs_config.random_words import random_words

_SEED = 105
_UNIT = 2.0**-53


def uniform(lab: int, case: int, *ranges: tuple[float, float]) -> list[float]:
    """A number of each range for a case of a lab."""
    words = random_words((_SEED, lab), (case, 0, 0, 0), len(ranges)).tolist()
    return [
        low + (high - low) * (word >> 11) * _UNIT
        for word, (low, high) in zip(words, ranges, strict=True)
    ]
