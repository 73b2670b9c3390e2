"""Lifts the pendulum to an angle by PD control with gravity compensation, in lockstep.

In two terminals, in any order (or with `&`); Ctrl-C ends each:

    .venv/bin/sim_node --ros-args -p character:=pendulum
    .venv/bin/python examples/pd_controller.py --ros-args -p target:=1.0

With a recorder beside them, add `-p wait_for_subscribers:=2`, so that it records the first answer.
"""

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState

STIFFNESS, DAMPING = 50.0, 5.0  # N m/rad, N m s/rad
WEIGHT_TIMES_ARM = 1.0 * 9.81 * 0.5  # N m: 1 kg, half a metre from the hinge


class PdController(Node):
    """Answers each state with `kp (target - q) - kd v + m g l sin(q)`."""

    def __init__(self):
        super().__init__("pd_controller")
        self.target = self.declare_parameter("target", 1.0).value  # rad; 0 hangs straight down
        self.wanted = self.declare_parameter("wait_for_subscribers", 1).value  # to joint_torques
        self.torques = self.create_publisher(JointState, "joint_torques", 10)
        self.create_subscription(JointState, "joint_states", self.on_state, 10)

    def on_state(self, state):
        """Publish the torque for a state; its stamp says which state that is."""
        if self.torques.get_subscription_count() < self.wanted:
            return  # the simulator publishes the state again
        self.wanted = 0  # only before the first answer
        hinge = state.name.index("hinge")  # by name: the order of the entries may change
        q, v = state.position[hinge], state.velocity[hinge]
        effort = STIFFNESS * (self.target - q) - DAMPING * v + WEIGHT_TIMES_ARM * np.sin(q)
        torque = JointState(name=["hinge"], effort=[float(effort)])
        torque.header.stamp = state.header.stamp
        self.torques.publish(torque)


rclpy.init()
try:
    node = PdController()
    while rclpy.ok():
        rclpy.spin_once(node, timeout_sec=0.5)  # rclpy.spin may sleep through a SIGTERM
except (KeyboardInterrupt, ExternalShutdownException):
    pass
except RuntimeError:  # rcl's own, where a signal comes just before a wait
    if rclpy.ok():
        raise
finally:
    rclpy.try_shutdown()
