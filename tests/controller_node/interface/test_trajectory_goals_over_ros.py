"""The action FollowJointTrajectory over topics, where `control_msgs` is installed."""

from typing import Any

import pytest
from builtin_interfaces.msg import Duration
from rclpy.action import ActionClient
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from tests.support.ros import Processes, SimulatorClient

control_msgs = pytest.importorskip("control_msgs", exc_type=ImportError)

SUCCEEDED, CANCELED, ABORTED = 4, 5, 6


class Sender:
    """Sends goals to `controller_node`."""

    def __init__(self, client: SimulatorClient) -> None:
        from control_msgs.action import FollowJointTrajectory
        from control_msgs.msg import JointTolerance

        self._client, self._action = client, FollowJointTrajectory
        self._tolerance = JointTolerance(name="hinge", position=0.2)
        self._actions = ActionClient(
            client.node, FollowJointTrajectory, "controller_node/follow_joint_trajectory"
        )
        self.told: list[Any] = []
        client.spin_until(self._actions.server_is_ready, "the action")

    def send(self, position: float, seconds: int, joint: str = "hinge") -> Any:
        point = JointTrajectoryPoint(positions=[position], time_from_start=Duration(sec=seconds))
        goal = self._action.Goal(
            trajectory=JointTrajectory(joint_names=[joint], points=[point]),
            goal_tolerance=[self._tolerance] if joint == "hinge" else [],
            goal_time_tolerance=Duration(sec=1),
        )
        sent = self._actions.send_goal_async(goal, feedback_callback=self.told.append)
        self._client.spin_until(sent.done, "the goal's acceptance")
        return sent.result()

    def result(self, handle: Any) -> Any:
        future = handle.get_result_async()
        self._client.spin_until(future.done, "the goal's result")
        return future.result()


def test_goals_are_reached_refused_and_cancelled(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.node("controller_node", character="pendulum")
    processes.simulator("pendulum", real_time_factor=2.0)
    sender = Sender(client)

    reached = sender.result(sender.send(0.8, 1))
    assert (reached.status, reached.result.error_code) == (SUCCEEDED, 0)
    assert sender.told and list(sender.told[0].feedback.joint_names) == ["hinge"]

    refused = sender.result(sender.send(0.8, 1, joint="elbow"))
    assert (refused.status, refused.result.error_code) == (ABORTED, -2)
    assert "elbow" in refused.result.error_string

    handle = sender.send(0.5, 100)
    client.spin_until(handle.cancel_goal_async().done, "the cancellation")
    assert sender.result(handle).status == CANCELED
