"""Trajectories that come over a topic, and replace what is tracked."""

from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from controller_node.controller import Controller
from controller_node.interface.publishers import Publishers
from controller_node.interface.stamped_message import decode_stamped, nanoseconds
from controller_node.references.trajectory import TrajectoryPoints, points_of_lists
from msgs_config.messages import topics
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.joint_state import split_stamp
from msgs_config.runtime.once_logger import OnceLogger
from msgs_config.runtime.stamped_subscription import StampedSubscription


class Trajectories:
    """Takes `~/joint_trajectory`, each before the answer to a state, and says which it took."""

    def __init__(
        self, node: Node, controller: Controller, outputs: Publishers, logger: OnceLogger
    ) -> None:
        self._controller = controller
        self._outputs = outputs
        self._messages = StampedSubscription(
            node, topics.JOINT_TRAJECTORY, "refused ", self._follow, logger
        )
        self._now_ns = self._episode_ns = 0

    @property
    def refused(self) -> int:
        """How many were refused."""
        return self._messages.rejected

    def take(self, state_ns: int, episode_ns: int) -> None:
        """Take what has come before the answer to the state of a stamp, ns.

        One without a stamp begins with this state, one with a stamp at its time. One that cannot
        be followed is refused, and what was tracked goes on.
        """
        self._now_ns, self._episode_ns = state_ns, episode_ns
        self._messages.take()

    def _follow(self, raw: bytes) -> None:
        message, start_ns = decode_stamped(raw, JointTrajectory, "trajectory", self._now_ns)
        self._controller.set_trajectory(
            _points(message),
            start_ns=start_ns,
            now_ns=self._now_ns,
            episode_ns=self._episode_ns,
        )
        message.header.stamp.sec, message.header.stamp.nanosec = split_stamp(start_ns)
        self._outputs.publish_trajectory(message)


def _points(message: JointTrajectory) -> TrajectoryPoints:
    points = message.points
    return points_of_lists(
        message.joint_names,
        [nanoseconds(point.time_from_start) / NANOSECONDS_PER_SECOND for point in points],
        [point.positions for point in points],
        [point.velocities for point in points],
        [point.accelerations for point in points],
    )
