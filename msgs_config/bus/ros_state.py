"""States and efforts from and to rclpy's own JointState messages, matched by name."""

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.joint_state import JointArrays, state_in_layout
from msgs_config.messages.state import StampedState


def read_state(layout: JointLayout, message: JointState) -> StampedState:
    """The state that a message of `joint_states` carries, in the layout's order.

    Raises:
        LayoutError: a name is unknown, or a degree of freedom is missing.
        MessageError: an array's length is not that of the names.
    """
    stamp = message.header.stamp
    arrays = JointArrays(
        stamp_ns=stamp.sec * NANOSECONDS_PER_SECOND + stamp.nanosec,
        names=tuple(message.name),
        position=np.array(message.position, dtype=float),
        velocity=np.array(message.velocity, dtype=float),
        effort=np.array(message.effort, dtype=float),
    )
    return state_in_layout(layout, arrays)


def effort_message(
    layout: JointLayout, answered: Header, effort: FloatArray, commanded: BoolArray
) -> JointState:
    """The message for `joint_torques` with the commanded entries of an effort (n,).

    Args:
        layout: Names the entries.
        answered: Header of the state's message: its stamp and session are repeated.
        effort: N and N m.
        commanded: Which entries (n,) are sent.
    """
    message = JointState()
    message.header.stamp = answered.stamp
    message.header.frame_id = answered.frame_id
    message.name = [
        name for name, is_sent in zip(layout.dof_names, commanded, strict=True) if is_sent
    ]
    message.effort = effort[commanded].tolist()
    return message
