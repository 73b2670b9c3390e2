"""The numbers that a program hands over, as the arrays that simulation and controller need."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError
from msgs_config.messages.state import StampedState
from msgs_config.plain_values import as_plain, finite_numbers


def finite_state(state: StampedState, size: int) -> StampedState:
    """A state whose position and velocity are arrays (size,) of finite numbers.

    Raises:
        ConfigurationError: they are not.
    """
    position, velocity = (
        finite_numbers(f"a state's {what}", numbers, size, ConfigurationError)
        for what, numbers in (("position", state.position), ("velocity", state.velocity))
    )
    return replace(state, position=position, velocity=velocity)


def has_arrays(state: StampedState, size: int) -> bool:
    """Whether a state's position and velocity are arrays (size,) of finite doubles."""
    position, velocity = state.position, state.velocity
    are_arrays = isinstance(position, np.ndarray) and isinstance(velocity, np.ndarray)
    if not (are_arrays and position.shape == velocity.shape == (size,)):
        return False
    are_doubles = position.dtype == velocity.dtype == np.float64
    return are_doubles and is_finite(position) and is_finite(velocity)


def is_finite(numbers: FloatArray) -> bool:
    """Whether all of some doubles (n,) are finite; in a microsecond, as each tick asks for it."""
    # A sum of squares is finite only where all are; where it overflows it says nothing.
    return math.isfinite(numbers.dot(numbers)) or bool(np.isfinite(numbers).all())


def real_array(what: str, numbers: Sequence[float] | FloatArray) -> FloatArray:
    """Real numbers as an array of their shape, finite or not.

    Raises:
        ConfigurationError: they are none.
    """
    if isinstance(numbers, np.ndarray) and numbers.dtype == np.float64:
        return numbers
    try:
        return np.asarray(as_plain(numbers)).astype(np.float64, casting="same_kind")
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f"{what} must be an array of real numbers: {error}") from None


def is_same_first(state: StampedState, last: StampedState) -> bool:
    """Whether an episode's first state, without effort, is the same as the last state."""
    return (
        last.effort is None
        and state.stamp_ns == last.stamp_ns
        and np.array_equal(state.position, last.position)
        and np.array_equal(state.velocity, last.velocity)
    )
