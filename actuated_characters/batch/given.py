"""What a program tells a batch, as arrays that fit it; else a ConfigurationError."""

from collections.abc import Sequence

import numpy as np

from actuated_characters.given_arrays import is_finite, real_array
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.errors import ConfigurationError

_LARGEST_TICK = 10**9


def whole_number(what: str, number: object, least: int, most: int) -> int:
    """A whole number within bounds."""
    if not isinstance(number, int | np.integer) or not least <= number <= most:
        raise ConfigurationError(
            f"{what} is {number}; it must be a whole number from {least} to {most}"
        )
    return int(number)


def finite_array(what: str, given: object, shape: tuple[int, ...]) -> FloatArray:
    """Finite numbers of a shape."""
    numbers = real_array(what, given)  # type: ignore[arg-type]
    if numbers.shape != shape:
        raise ConfigurationError(f"{what} has shape {numbers.shape}; it must be {shape}")
    if not is_finite(numbers.ravel()):
        raise ConfigurationError(f"{what} has entries that are not finite")
    return numbers


def world_numbers(given: Sequence[int] | IntArray | BoolArray | None, count: int) -> IntArray:
    """Numbers (k,) of worlds, each once, that are given so, or as which ones (count,)."""
    if given is None:
        return np.arange(count)
    numbers = np.asarray(given)
    if numbers.dtype == np.bool_ and numbers.shape == (count,):
        return np.flatnonzero(numbers)
    if numbers.shape == (0,):
        return np.zeros(0, dtype=np.intp)
    is_whole = numbers.ndim == 1 and np.issubdtype(numbers.dtype, np.integer)
    if not is_whole or numbers.min() < 0 or numbers.max() >= count:
        raise ConfigurationError(
            f"worlds are {given}; they must be whole numbers from 0 to {count - 1}, or one truth "
            "value a world"
        )
    if len(np.unique(numbers)) < len(numbers):
        raise ConfigurationError(f"worlds are {given}; each may be there once")
    return numbers.astype(np.intp)


def reference_ticks(given: int | Sequence[int] | IntArray, count: int) -> list[int]:
    """Ticks of the reference, one for all or (count,)."""
    ticks = np.asarray(given)
    is_whole = np.issubdtype(ticks.dtype, np.integer) and ticks.shape in ((), (count,))
    if not is_whole or (ticks.size and not 0 <= ticks.min() <= ticks.max() <= _LARGEST_TICK):
        raise ConfigurationError(
            f"at is {given}; it must be a tick of the reference, from 0 on, or {count} of them"
        )
    return [int(tick) for tick in np.broadcast_to(ticks, (count,))]
