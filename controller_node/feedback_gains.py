"""The gains of the balance feedback: by name in files, as matrices where they are used."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError, one_of

FEATURES = (
    "centre_x",  # of the centre of mass from the motion's, m; x ahead and y to the left of the root
    "centre_y",
    "centre_z",
    "centre_vx",  # m/s
    "centre_vy",
    "centre_vz",
    "arm_x",  # of the centre of mass from the foot that stands, beside the motion's, m
    "arm_y",
    "tilt_x",  # of the root from the motion's, rotation vector in the base frame, rad
    "tilt_y",
    "tilt_z",
    "spin_x",  # rad/s
    "spin_y",
    "spin_z",
    "one",  # always 1
    "side",  # 1 for the left leg, -1 for the right one
)
"""What the feedback looks at."""

OUTPUTS = ("hip_x", "hip_y", "hip_z", "knee", "ankle_x", "ankle_y", "ankle_z")
"""What it moves, of each leg: rotation vectors in the child frames and the knee's angle, rad."""

_LEGS = ("stance", "swing")
_LARGEST_GAIN = 100.0  # rad a rad, a m, a rad/s or a m/s


@dataclass(frozen=True)
class FeedbackGains:
    """Matrices (7, 16) from `FEATURES` to `OUTPUTS`: of the leg that stands, and that swings."""

    stance: FloatArray
    swing: FloatArray

    @classmethod
    def of(cls, gains: Mapping[str, float]) -> "FeedbackGains":
        """Gains by name, such as `swing.hip_z.centre_vx`; what is not named is zero.

        Raises:
            ConfigurationError: a name is unknown, or a gain no number.
        """
        matrices = {leg: np.zeros((len(OUTPUTS), len(FEATURES))) for leg in _LEGS}
        for name, gain in checked_gains(gains).items():
            leg, output, feature = name.split(".")
            matrices[leg][OUTPUTS.index(output), FEATURES.index(feature)] = gain
        return cls(**matrices)


def checked_gains(gains: Mapping[str, object]) -> dict[str, float]:
    """Gains by name as numbers.

    Raises:
        ConfigurationError: a name is unknown, or a gain no number.
    """
    checked = {}
    for name, gain in gains.items():
        parts = str(name).split(".")
        choices = (_LEGS, OUTPUTS, FEATURES)
        if len(parts) != len(choices):
            raise ConfigurationError(
                f"gain {name!r} must be LEG.OUTPUT.FEATURE, such as swing.hip_z.centre_vx"
            )
        for what, part, known in zip(("leg", "output", "feature"), parts, choices, strict=True):
            if part not in known:
                raise ConfigurationError(f"gain {name!r}: {one_of(what, part, list(known))}")
        is_number = isinstance(gain, (int, float)) and not isinstance(gain, bool)
        value = float(gain) if isinstance(gain, (int, float)) else 0.0
        if not is_number or not abs(value) <= _LARGEST_GAIN:  # NaN is not
            raise ConfigurationError(
                f"gain {name!r} is {gain!r}; it must be a number from -{_LARGEST_GAIN:g} to "
                f"{_LARGEST_GAIN:g}"
            )
        checked[str(name)] = value
    return checked
