"""Drives a character over `cmd_vel`: a figure of eight, again and again, until Ctrl-C.

    .venv/bin/python -m sim_node.main --ros-args -p character:=humanoid -p real_time_factor:=1.0
    .venv/bin/python -m controller_node.main --ros-args -p character:=humanoid \\
        -p reference:=steered -p planner:=hybrid
    .venv/bin/python examples/drive.py
"""

from contextlib import suppress

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.parameter import Parameter

rclpy.init()
node = rclpy.create_node("driver", parameter_overrides=[Parameter("use_sim_time", value=True)])
velocities = node.create_publisher(Twist, "cmd_vel", 10)


def drive():
    """Ask for a circle to the left and one to the right, in turns of 12.6 s."""
    time = node.get_clock().now().nanoseconds * 1e-9  # s, simulated
    twist = Twist()
    twist.linear.x = 0.8  # m/s
    twist.angular.z = 0.5 if time % 25.2 < 12.6 else -0.5  # rad/s
    velocities.publish(twist)


node.create_timer(0.1, drive)  # again within the timeout, or it stops
with suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(node)
