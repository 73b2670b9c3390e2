"""The gains of the window feedback: what stands in files, and as matrices where they are used."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError
from msgs_config.geometry import fixed_order

BALANCE_FEATURES = 12
"""Of the centre of mass (3), its velocity (3), the root's tilt (3) and spin (3)."""

_LARGEST_GAIN = 1e4  # rad a m, a m/s, a rad or a rad/s
_MOST_WINDOWS = 1000
_KEYS = ("dofs", "largest", "constants", "gains")


@dataclass(frozen=True)
class WindowGains:
    """What is added to the tracking errors in each window of a cycle, linear in its first state.

    Window w of a run has row `w mod p`: `constants + gains s`, held within `largest`. The features
    s (12 + 2 m) are those of `Deviations`.
    """

    dofs: tuple[str, ...]  # (m,) that are moved
    largest: FloatArray  # (m,) rad
    constants: FloatArray  # (p, m) rad
    gains: FloatArray  # (p, m, 12 + 2 m) rad a m, a m/s, a rad or a rad/s

    @property
    def windows(self) -> int:
        """Windows (p) of a cycle."""
        return len(self.constants)

    def offset(self, window: int, features: FloatArray) -> FloatArray:
        """The response (m,) in rad of a run's window to features (12 + 2 m) at its beginning."""
        row = window % self.windows
        wish = self.constants[row] + fixed_order.apply(self.gains[row], features)
        bounded: FloatArray = np.minimum(np.maximum(wish, -self.largest), self.largest)
        return bounded

    def content(self) -> dict[str, Any]:
        """The gains as JSON has them."""
        numbers = {name: getattr(self, name).tolist() for name in _KEYS[1:]}
        return {"dofs": list(self.dofs), **numbers}


def window_gains(content: object) -> WindowGains:
    """The gains that JSON's content says, such as `WindowGains.content` gives it.

    Raises:
        ConfigurationError: something is missing, of another shape, or no number within reason.
    """
    if not isinstance(content, dict) or any(name not in content for name in _KEYS):
        raise ConfigurationError(f"window feedback must have {', '.join(_KEYS)}")
    dofs = content["dofs"]
    if not isinstance(dofs, list) or not dofs or not all(isinstance(dof, str) for dof in dofs):
        raise ConfigurationError("window feedback: dofs must be names of degrees of freedom")
    count = len(dofs)
    largest = _numbers("largest", content["largest"], (count,))
    constants = _numbers("constants", content["constants"], (None, count))
    windows = len(constants)
    if not 1 <= windows <= _MOST_WINDOWS:
        raise ConfigurationError(
            f"window feedback has {windows} windows a cycle; it must have 1 to {_MOST_WINDOWS}"
        )
    gains = _numbers("gains", content["gains"], (windows, count, BALANCE_FEATURES + 2 * count))
    if not (largest >= 0.0).all():
        raise ConfigurationError("window feedback: largest must be 0 rad or more")
    return WindowGains(tuple(dofs), largest, constants, gains)


def _numbers(name: str, content: object, shape: Sequence[int | None]) -> FloatArray:
    """Numbers of a shape, in which None is any length."""
    try:
        numbers: FloatArray = np.array(content, dtype=float)
        if np.array(content).dtype.kind not in "fiu":  # texts would become numbers
            raise TypeError
    except (ValueError, TypeError, OverflowError) as error:
        raise ConfigurationError(f"window feedback: {name} must be rows of numbers") from error
    fits = numbers.ndim == len(shape) and all(
        wanted in (None, found) for wanted, found in zip(shape, numbers.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if length is None else str(length) for length in shape)
        raise ConfigurationError(
            f"window feedback: {name} are {numbers.shape}; they must be ({wanted})"
        )
    if not (np.abs(numbers) <= _LARGEST_GAIN).all():  # NaN is not
        raise ConfigurationError(
            f"window feedback: one of {name} is not finite, or over {_LARGEST_GAIN:g}"
        )
    return numbers
