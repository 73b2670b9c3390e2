"""Which degrees of freedom efforts drive, and what efforts do to the character as a whole."""

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.geometry import scalars

_ZERO_VECTOR = (0.0, 0.0, 0.0)


def describe_actuation(actuators: int, degrees_of_freedom: int) -> dict[str, int | bool]:
    """The numbers for JSON; fully actuated is what has an effort for any acceleration."""
    return {
        "actuators": actuators,
        "degrees_of_freedom": degrees_of_freedom,
        "fully_actuated": actuators >= degrees_of_freedom,
    }


def net_wrench(
    layout: JointLayout, position: FloatArray, effort: FloatArray
) -> tuple[scalars.Vector, scalars.Vector]:
    """Force in N and torque in N m of all efforts (n,) on the character as a whole, at (n,).

    World axes, the torque about the base link's origin. A joint's torque acts on the child and its
    opposite on the parent, so all joints together give nothing; what remains is the root's force
    and torque.
    """
    if not layout.has_floating_base:
        return _ZERO_VECTOR, _ZERO_VECTOR
    fx, fy, fz, *torque_in_base = effort[:6].tolist()
    turn = scalars.axes(scalars.exp(position[3:6].tolist()))
    return (fx, fy, fz), scalars.to_parent(turn, torque_in_base)
