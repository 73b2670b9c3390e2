"""Two controllers share one humanoid: the one moves arms and trunk, the other the legs.

The simulator takes a step when every motor has its command, from any publisher. So neither
controller needs to know the other, and the result does not depend on which one is faster. In three
terminals, in any order:

    .venv/bin/sim_node --ros-args -p character:=humanoid -p rate:=500 -p gravity:=0.0 \
        -p terrain:=none
    .venv/bin/python examples/two_controllers.py --part arms
    .venv/bin/python examples/two_controllers.py --part legs

The humanoid floats in space, where it needs no support. All torques are internal, so its centre of
mass stays where it is, and yet the trunk turns against the limbs.

This is explicit PD. On an inertia I it is stable only for `kp h^2 + 2 kd h < 4 I` with the period h
of the ticks, and the foot's least inertia is 0.001 kg m^2. That is why the rate is 500 Hz and the
gains are small. (`controller_node` has stable PD, which takes ten times as much at 240 Hz.)
"""

import argparse

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import JointState

# joint: target (an angle, or a rotation vector: forward, up, to the right; rad), damping N m s/rad
GOALS = {
    "arms": {
        "chest": ([0.0, 0.3, 0.0], 4.0),
        "neck": ([0.0, 0.5, 0.0], 2.0),
        "right_shoulder": ([-1.2, 0.0, 0.6], 2.0),
        "right_elbow": ([1.0], 1.0),
        "left_shoulder": ([1.2, 0.0, 0.6], 2.0),
        "left_elbow": ([1.0], 1.0),
    },
    "legs": {
        "right_hip": ([-0.2, 0.0, 1.2], 4.0),
        "right_knee": ([-1.5], 2.0),
        "right_ankle": ([0.0, 0.0, 0.3], 0.4),
        "left_hip": ([0.2, 0.0, 1.2], 4.0),
        "left_knee": ([-1.5], 2.0),
        "left_ankle": ([0.0, 0.0, 0.3], 0.4),
    },
}
STIFFNESS_OVER_DAMPING = 10.0  # 1/s


def quaternion(rotation_vector):
    """Unit quaternion (x, y, z, w) of a rotation vector in rad."""
    angle = np.linalg.norm(rotation_vector)
    # sinc(x) is sin(pi x) / (pi x), which is 1 at an angle of zero
    vector = 0.5 * np.sinc(0.5 * angle / np.pi) * np.asarray(rotation_vector)
    return np.append(vector, np.cos(0.5 * angle))


def product(a, b):
    """Hamilton product of quaternions (x, y, z, w): turn by b first, then by a."""
    vector = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.append(vector, a[3] * b[3] - a[:3] @ b[:3])


def rotation_error(current, target):
    """The rotation from one rotation vector to another, `rotvec(q^-1 q_target)`, child frame.

    A difference of components would be wrong: rotations do not add up like vectors.
    """
    q = quaternion(current)
    error = product(q * [-1, -1, -1, 1], quaternion(target))
    error *= np.copysign(1.0, error[3])  # q and -q are one rotation; this is the shorter way
    sine = np.linalg.norm(error[:3])
    angle = 2.0 * np.arctan2(sine, error[3])
    return error[:3] * (angle / sine if sine > 0.0 else 2.0)


class PartController(Node):
    """Draws some joints of the humanoid to their targets by PD control."""

    def __init__(self, part):
        super().__init__(f"{part}_controller")
        self.goals = GOALS[part]
        self.torques = self.create_publisher(JointState, "joint_torques", 10)
        self.create_subscription(JointState, "joint_states", self.on_state, 10)

    def on_state(self, state):
        """Publish the torques of this part's joints."""
        entry = {name: index for index, name in enumerate(state.name)}
        torque = JointState()
        torque.header.stamp = state.header.stamp
        for joint, (target, damping) in self.goals.items():
            is_ball = joint not in entry
            names = [f"{joint}_{axis}" for axis in "xyz"] if is_ball else [joint]
            q = np.array([state.position[entry[name]] for name in names])
            v = np.array([state.velocity[entry[name]] for name in names])
            error = rotation_error(q, target) if is_ball else target - q
            torque.name += names
            torque.effort.extend(damping * (STIFFNESS_OVER_DAMPING * error - v))
        self.torques.publish(torque)


parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--part", choices=GOALS, required=True, help="the joints to control")
rclpy.init()
try:
    node = PartController(parser.parse_args(remove_ros_args()[1:]).part)
    while rclpy.ok():
        rclpy.spin_once(node, timeout_sec=0.5)  # rclpy.spin may sleep through a SIGTERM
except (KeyboardInterrupt, ExternalShutdownException):
    pass
except RuntimeError:  # rcl's own, where a signal comes just before a wait
    if rclpy.ok():
        raise
finally:
    rclpy.try_shutdown()
