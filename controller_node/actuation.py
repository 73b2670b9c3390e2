"""What the controller's efforts can do, and what they do to the character as a whole."""

from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.geometry import rotations


@dataclass(frozen=True)
class Actuation:
    """How many degrees of freedom there are, and how many an actuator drives."""

    actuators: int
    degrees_of_freedom: int

    @property
    def is_full(self) -> bool:
        """Whether there is an effort for any acceleration in any state."""
        return self.actuators >= self.degrees_of_freedom

    def content(self) -> dict[str, int | bool]:
        """What JSON says of it."""
        return {
            "actuators": self.actuators,
            "degrees_of_freedom": self.degrees_of_freedom,
            "fully_actuated": self.is_full,
        }


def net_wrench(
    layout: JointLayout, configuration: GeneralizedPosition, effort: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Force (3,) in N and torque (3,) in N m of all efforts (n,) on the character as a whole.

    World axes, the torque about the base link's origin. A joint's torque acts on the child and its
    opposite on the parent, so all joints together give nothing; what remains is the root's force
    and torque.
    """
    if not layout.has_floating_base:
        return np.zeros(3), np.zeros(3)
    return effort[:3].copy(), rotations.rotate(configuration.orientations_xyzw[0], effort[3:6])
