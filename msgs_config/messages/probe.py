"""A sample of the simulator's dynamics in one state, for a controller to compare its model with."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.errors import MessageError
from msgs_config.mappings import MappingReader

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
        """The sample as JSON can say it."""
        arrays = {name: getattr(self, name).tolist() for name in _ARRAYS}
        return {**arrays, "kinetic_energy": self.kinetic_energy}


def read_probe(content: object, size: int) -> DynamicsSample:
    """The sample that JSON says, of `size` degrees of freedom.

    Raises:
        MessageError: a number is missing or not finite; names it.
    """
    if not isinstance(content, dict):
        raise MessageError("a probe that is no mapping")
    reader = MappingReader("a probe", content, MessageError)
    arrays = {name: np.array(reader.numbers(name, size)) for name in _ARRAYS}
    return DynamicsSample(kinetic_energy=reader.number("kinetic_energy"), **arrays)
