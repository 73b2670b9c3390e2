"""Pushes links of a running character, and prints the wrench that was applied, and when.

For instance the pendulum of `pd_controller.py`, or two links of the humanoid at once:

    .venv/bin/python examples/push.py --link rod --force 20 0 0 --point 0 0 -1 --at 5
    .venv/bin/python examples/push.py --link chest neck --force 0 60 0

A push lasts as long as the parameter `wrench_duration` of `sim_node` says. Without `--at` it
begins with the next tick, whichever that is; with `--at`, a time that is still to come, it begins
at exactly that tick, and the run can be repeated to the last bit.
"""

import argparse
import sys

import numpy as np
import rclpy
from geometry_msgs.msg import Transform, Vector3, Wrench
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import MultiDOFJointState

REJECTED_AFTER = 1.0  # s of simulated time; a push that was not applied by then was rejected


class WrenchPublisher(Node):
    """Publishes one push on `external_wrench`; reads `applied_wrench` until it is over."""

    def __init__(self, arguments):
        super().__init__("pusher")
        self.push = message(arguments)
        self.at = arguments.at
        self.deadline = None  # s of simulated time
        self.applied = []  # messages on `applied_wrench`, one for each tick of the push
        self.over = Future()  # of the stamp of the first tick without it, s
        self.create_subscription(MultiDOFJointState, "applied_wrench", self.receive, 1000)
        self.pushes = self.create_publisher(MultiDOFJointState, "external_wrench", 10)
        self.timer = self.create_timer(0.02, self.send)

    def send(self):
        """Publish the push, once connected to a simulator in both directions."""
        if self.pushes.get_subscription_count() and self.count_publishers("applied_wrench"):
            self.timer.cancel()
            self.pushes.publish(self.push)
            print(f"sent: push on {', '.join(self.push.joint_names)}", flush=True)

    def receive(self, applied):
        """Collect the wrenches applied during the tick that ended at the stamp; usually none."""
        time = seconds(applied.header.stamp)
        if not self.timer.is_canceled() or self.over.done():
            return
        if self.deadline is None:
            self.deadline = max(time, self.at) + REJECTED_AFTER
        if set(self.push.joint_names) <= set(applied.joint_names):
            self.applied.append(applied)
        elif self.applied or time > self.deadline:
            self.over.set_result(time)

    def report(self):
        """Print the wrench that was applied, and when; returns the exit code."""
        if not self.applied:
            print("nothing was applied; sim_node has logged the reason", file=sys.stderr)
            return 1
        last = seconds(self.applied[-1].header.stamp)
        period = self.over.result() - last
        ticks = len(self.applied)
        print(f"applied from {last - ticks * period:.4f} s to {last:.4f} s, {ticks} ticks")
        for link in self.push.joint_names:
            forces, points = [], []
            for applied in self.applied:
                row = applied.joint_names.index(link)
                forces.append(array(applied.wrench[row].force))
                points.append(array(applied.transforms[row].translation))
            print(
                f"{link}: force {forces[0]} N at {points[0]} m of its frame, "
                f"impulse {np.round(period * np.sum(forces, axis=0), 6)} N s"
            )
        return 0


def message(arguments):
    """The push: one wrench a link, and one point a link if it is not the centre of mass."""
    push = MultiDOFJointState(joint_names=arguments.link)
    nanoseconds = round(1e9 * arguments.at)  # a stamp of zero means the next tick
    push.header.stamp.sec, push.header.stamp.nanosec = divmod(nanoseconds, 10**9)
    wrench = Wrench(force=vector(arguments.force), torque=vector(arguments.torque))
    push.wrench = [wrench] * len(arguments.link)
    if arguments.point:
        where = Transform(translation=vector(arguments.point))
        push.transforms = [where] * len(arguments.link)
    return push


def vector(numbers):
    """Three numbers as a message."""
    x, y, z = numbers
    return Vector3(x=x, y=y, z=z)


def array(vector):
    """A message of three numbers as an array."""
    return np.array([vector.x, vector.y, vector.z])


def seconds(stamp):
    """A stamp as a number, s."""
    return stamp.sec + 1e-9 * stamp.nanosec


def parse():
    """Parse the command line without the arguments for ROS."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--link", nargs="+", required=True, help="links, each pushed alike")
    parser.add_argument("--force", nargs=3, type=float, required=True, help="N, world axes")
    parser.add_argument("--torque", nargs=3, type=float, default=[0.0] * 3, help="N m, world axes")
    parser.add_argument(
        "--point", nargs=3, type=float, help="m in the link's frame; else its centre of mass"
    )
    parser.add_argument("--at", type=float, default=0.0, help="simulated time, s; else at once")
    return parser.parse_args(remove_ros_args()[1:])


def main():
    """Push and report; returns the exit code, 1 if nothing was applied."""
    arguments = parse()
    rclpy.init()
    try:
        node = WrenchPublisher(arguments)
        while rclpy.ok() and not node.over.done():  # a wait without end may miss a SIGTERM
            rclpy.spin_until_future_complete(node, node.over, timeout_sec=0.5)
        return node.report() if node.over.done() else 1
    except (KeyboardInterrupt, ExternalShutdownException):
        return 1
    except RuntimeError:  # rcl's own, where a signal comes just before a wait
        if rclpy.ok():
            raise
        return 1
    finally:
        rclpy.try_shutdown()


sys.exit(main())
