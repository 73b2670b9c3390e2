"""Drives a character over `cmd_vel`: a figure of eight, again and again, until Ctrl-C.

    .venv/bin/python -m sim_node.main --ros-args -p character:=humanoid -p real_time_factor:=1.0
    .venv/bin/python -m controller_node.main --ros-args -p character:=humanoid \\
        -p reference:=steered -p planner:=predictive
    .venv/bin/python examples/drive.py
"""

from contextlib import suppress

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.parameter import Parameter

SPEED, TURN, CIRCLE = 0.8, 0.5, 12.6  # m/s, rad/s, s


def main():
    """Publish velocities until a signal."""
    rclpy.init()
    by_simulated_time = [Parameter("use_sim_time", value=True)]
    node = rclpy.create_node("driver", parameter_overrides=by_simulated_time)
    velocities = node.create_publisher(Twist, "cmd_vel", 10)

    def drive():
        twist = Twist()
        twist.linear.x = SPEED
        is_first = node.get_clock().now().nanoseconds * 1e-9 % (2 * CIRCLE) < CIRCLE
        twist.angular.z = TURN if is_first else -TURN
        velocities.publish(twist)

    node.create_timer(0.1, drive)  # again within the timeout, or it stops
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == "__main__":
    main()
