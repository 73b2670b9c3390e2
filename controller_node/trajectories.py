"""Trajectories that come over a topic, and replace what is tracked."""

from builtin_interfaces.msg import Duration, Time
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from controller_node.controller import Controller
from controller_node.outputs import Outputs
from controller_node.references.trajectory import TrajectoryPoints, points_of_lists
from msgs_config import topics
from msgs_config.errors import LayoutError, MessageError, MotionError
from msgs_config.messages import decode, split_stamp
from msgs_config.polling import DirectSubscription
from msgs_config.tick_clock import NANOSECONDS_PER_SECOND
from msgs_config.warnings import Warnings

_LARGEST = 2**25  # bytes of a message
_LATEST_NS = 10**15  # after now
_MOST_AT_ONCE = 100  # messages, lest a flood of them keep the states waiting


class Trajectories:
    """Takes `~/joint_trajectory`, each before the answer to a state, and says which it took."""

    def __init__(
        self, node: Node, controller: Controller, outputs: Outputs, warnings: Warnings
    ) -> None:
        self._controller = controller
        self._outputs = outputs
        self._warnings = warnings
        self._inbox = DirectSubscription(node, topics.JOINT_TRAJECTORY)
        self.refused = 0

    def take(self, state_ns: int, episode_ns: int) -> None:
        """Take what has come before the answer to the state of a stamp, ns.

        One without a stamp begins with this state, one with a stamp at its time. One that cannot
        be followed is refused, and what was tracked goes on.
        """
        for _ in range(_MOST_AT_ONCE):
            raw = self._inbox.take()
            if raw is None:
                return
            try:
                if len(raw) > _LARGEST:
                    raise MotionError(
                        f"trajectory: it has {len(raw)} bytes; it must have {_LARGEST} or fewer"
                    )
                self._follow(decode(raw, JointTrajectory), state_ns, episode_ns)
            except (MotionError, MessageError, LayoutError) as error:
                self.refused += 1
                self._warnings.say_once(f"refused {error}")

    def _follow(self, message: JointTrajectory, state_ns: int, episode_ns: int) -> None:
        start_ns = _nanoseconds(message.header.stamp) or state_ns
        if start_ns < state_ns:
            raise MotionError(
                f"trajectory: it begins at {start_ns} ns, which is over; it must be {state_ns} ns "
                "or later, or 0 for at once"
            )
        if start_ns > state_ns + _LATEST_NS or message.header.stamp.nanosec >= 10**9:
            raise MotionError(
                f"trajectory: its stamp is {message.header.stamp.sec} s and "
                f"{message.header.stamp.nanosec} ns; it must be a time, and within 1e6 s"
            )
        self._controller.follow(
            _points(message), start_ns=start_ns, now_ns=state_ns, episode_ns=episode_ns
        )
        message.header.stamp.sec, message.header.stamp.nanosec = split_stamp(start_ns)
        self._outputs.publish_trajectory(message)


def _points(message: JointTrajectory) -> TrajectoryPoints:
    points = message.points
    return points_of_lists(
        message.joint_names,
        [_nanoseconds(point.time_from_start) / NANOSECONDS_PER_SECOND for point in points],
        [point.positions for point in points],
        [point.velocities for point in points],
        [point.accelerations for point in points],
    )


def _nanoseconds(time: Time | Duration) -> int:
    return int(time.sec) * NANOSECONDS_PER_SECOND + int(time.nanosec)
