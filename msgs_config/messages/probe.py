"""A probe of the simulator: what its engine makes of one state, for a controller to compare."""

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.errors import MessageError

_LARGEST = sys.float_info.max
_ARRAYS = ("position", "velocity", "effort", "acceleration")


@dataclass(frozen=True)
class DynamicsSample:
    """One state in free space, an effort, and what the engine makes of them; message form."""

    position: FloatArray  # (n,) rad or m
    velocity: FloatArray  # (n,) rad/s or m/s
    effort: FloatArray  # (n,) N m or N
    kinetic_energy: float  # J
    acceleration: FloatArray  # (n,) of the velocities, rad/s^2 or m/s^2

    def content(self) -> dict[str, Any]:
        """The probe as JSON can say it."""
        arrays = {name: getattr(self, name).tolist() for name in _ARRAYS}
        return {**arrays, "kinetic_energy": self.kinetic_energy}


def read_probe(content: object, size: int) -> DynamicsSample:
    """The probe that JSON says, of `size` degrees of freedom.

    Raises:
        MessageError: it is not one.
    """
    if not isinstance(content, dict):
        raise MessageError("a probe that is no mapping")
    arrays = {name: _numbers(name, content.get(name), size) for name in _ARRAYS}
    (energy,) = _numbers("kinetic_energy", [content.get("kinetic_energy")], 1).tolist()
    return DynamicsSample(kinetic_energy=energy, **arrays)


def _numbers(name: str, values: object, size: int) -> FloatArray:
    if isinstance(values, list) and len(values) == size and all(map(_is_finite, values)):
        return np.array(values, dtype=float)
    raise MessageError(f"a probe whose '{name}' is not {size} finite numbers")


def _is_finite(value: object) -> bool:
    # compared, not converted: a whole number may be larger than every float
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        return False
    return -_LARGEST <= value <= _LARGEST
