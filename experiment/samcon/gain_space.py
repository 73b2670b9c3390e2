"""The feedback's gains that are fitted, and as a vector of numbers that are about 1."""

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np

from controller_node.feedback_gains import OUTPUTS
from msgs_config.arrays import FloatArray

Gains: TypeAlias = Mapping[str, float]
"""Gains of the feedback by name."""

_USUAL = {"centre_vx": 0.2, "centre_vy": 0.2, "centre_vz": 0.2, "one": 0.1, "side": 0.1}
_SPIN = 0.2
_DIGITS = 3  # of gains, for who reads them

# what has something to do with what: about x it leans sideways, about y it turns, about z ahead
_SIDEWAYS = ("centre_y", "centre_vy", "arm_y", "tilt_x", "spin_x", "one", "side")
_AHEAD = ("centre_x", "centre_vx", "arm_x", "tilt_z", "spin_z", "one")
_CANDIDATES = {
    "hip_x": _SIDEWAYS,
    "hip_y": ("centre_y", "tilt_y", "spin_y", "one", "side"),
    "hip_z": _AHEAD,
    "knee": ("centre_z", "centre_vz", "centre_vx", "one"),
    "ankle_x": _SIDEWAYS,
    "ankle_y": ("tilt_y", "spin_y", "one"),
    "ankle_z": _AHEAD,
}


def names() -> tuple[str, ...]:
    """The gains that are fitted."""
    assert set(_CANDIDATES) == set(OUTPUTS)
    return tuple(
        f"{leg}.{output}.{feature}"
        for leg in ("stance", "swing")
        for output, features in _CANDIDATES.items()
        if leg == "stance" or not output.startswith("ankle")
        for feature in features
    )


class GainSpace:
    """Gains as vectors whose entries are about 1 where they are usual."""

    def __init__(self, given: Gains) -> None:
        """Beside those that are always fitted, those that are given are."""
        self._names = tuple(dict.fromkeys((*names(), *given)))
        self._usual = np.array([_usual(name) for name in self._names])

    def vector(self, gains: Gains) -> FloatArray:
        """The vector of gains."""
        vector: FloatArray = np.array([gains.get(name, 0.0) for name in self._names]) / self._usual
        return vector

    def gains(self, vector: FloatArray) -> Gains:
        """The gains of a vector, rounded to what is worth reading."""
        values = (vector * self._usual).tolist()
        return {
            name: float(f"{value:.{_DIGITS}g}")
            for name, value in zip(self._names, values, strict=True)
        }


def _usual(name: str) -> float:
    feature = name.rpartition(".")[2]
    return _USUAL.get(feature, _SPIN if feature.startswith("spin") else 1.0)
