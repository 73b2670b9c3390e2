"""Which degrees of freedom efforts drive, and what efforts do to the character as a whole."""

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.geometry import rotations


def describe_actuation(actuators: int, degrees_of_freedom: int) -> dict[str, int | bool]:
    """The numbers for JSON; fully actuated is what has an effort for any acceleration."""
    return {
        "actuators": actuators,
        "degrees_of_freedom": degrees_of_freedom,
        "fully_actuated": actuators >= degrees_of_freedom,
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
