"""Joint limits as the references obey them, and how an error speaks of them."""

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character

LARGEST_NUMBER = 1e6  # rad, m, s or their quotients; more is a mistake
SHORTEST_TIME = 1e-6  # s between two points of a motion

_LIMIT_ROUNDING = 1e-9  # rad or m


class JointLimits:
    """The limits of every degree of freedom; ball joints and the floating base have none."""

    def __init__(self, character: Character) -> None:
        self.lower, self.upper = character.position_bounds()
        self._units: list[str] = []
        for joint in character.layout.joints:
            slides = joint.type is JointType.PRISMATIC
            count = len(joint.dof_names)
            self._units += ["m" if slides else "rad"] * count
            if joint.type is JointType.FLOATING:
                self._units[-count:] = ["m"] * 3 + ["rad"] * 3

    def excess(self, positions: FloatArray) -> FloatArray:
        """How far positions (..., n) lie beyond the limits, in rad or m; zero within."""
        beyond = np.maximum(self.lower - positions, positions - self.upper)
        return np.where(beyond > _LIMIT_ROUNDING, beyond, 0.0)

    def unit(self, index: int) -> str:
        """The unit of a degree of freedom's position."""
        return self._units[index]

    def text(self, index: int) -> str:
        """The limits of a degree of freedom in words."""
        return f"{self.lower[index]:g} to {self.upper[index]:g} {self._units[index]}"
