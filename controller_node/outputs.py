"""What the controller publishes."""

from dataclasses import dataclass

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from rclpy.node import Node
from std_msgs.msg import Header, String
from trajectory_msgs.msg import JointTrajectory

from controller_node.actuation import net_wrench
from msgs_config import topics
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.joint_layout import JointLayout
from msgs_config.messages import JointStateEncoder, split_stamp
from msgs_config.stamped import StampedReference, StampedState
from msgs_config.wrench_messages import WORLD


@dataclass(frozen=True)
class Answer:
    """An answer, kept: a state that comes again gets it again, and nothing is computed anew."""

    raw_state: bytes
    state: StampedState
    effort: FloatArray  # (n,) what is sent of it, zero elsewhere
    torques: bytes  # the message
    reference: StampedReference


class Outputs:
    """The publishers of a controller. A topic that nobody listens to costs nothing."""

    def __init__(self, node: Node, layout: JointLayout, commanded: IntArray) -> None:
        """Offer the topics; `commanded` are the entries of the effort that are sent."""
        self._layout = layout
        self._commanded = commanded
        self._torque_encoder = JointStateEncoder([layout.dof_names[entry] for entry in commanded])
        self._reference_encoder = JointStateEncoder(layout.dof_names)
        self._references = topics.create_publisher(node, topics.REFERENCE)
        self._wrenches = topics.create_publisher(node, topics.NET_WRENCH)
        self._torques = topics.create_publisher(node, topics.JOINT_TORQUES)
        self._configurations = topics.create_publisher(node, topics.CONFIGURATION)
        self._trajectories = topics.create_publisher(node, topics.ACTIVE_TRAJECTORY)

    @property
    def torque_subscribers(self) -> int:
        """How many subscribe to the torques."""
        return int(self._torques.get_subscription_count())

    def answer(
        self, raw: bytes, state: StampedState, effort: FloatArray, reference: StampedReference
    ) -> Answer:
        """The answer with an effort (n,) to a state, ready to be published."""
        torques = self._torque_encoder.encode(state.stamp_ns, effort=effort[self._commanded])
        sent = np.zeros(self._layout.size)
        sent[self._commanded] = effort[self._commanded]
        return Answer(raw, state, sent, torques, reference)

    def publish(self, answer: Answer) -> None:
        """Publish an answer, the torques last: who has them has heard the rest."""
        if self._references.get_subscription_count():
            reference = answer.reference
            self._references.publish(
                self._reference_encoder.encode(
                    reference.stamp_ns, reference.position, reference.velocity
                )
            )
        if self._wrenches.get_subscription_count():
            self._wrenches.publish(self._net_wrench(answer))
        self._torques.publish(answer.torques)

    def publish_configuration(self, text: str) -> None:
        """Publish what the controller is and has in force, as JSON."""
        self._configurations.publish(String(data=text))

    def publish_trajectory(self, trajectory: JointTrajectory) -> None:
        """Publish a trajectory that was taken, with the stamp that it begins at."""
        self._trajectories.publish(trajectory)

    def _net_wrench(self, answer: Answer) -> WrenchStamped:
        configuration = self._layout.configuration(answer.state.position)
        force, torque = net_wrench(self._layout, configuration, answer.effort)
        seconds, nanoseconds = split_stamp(answer.state.stamp_ns)
        header = Header(stamp=Time(sec=seconds, nanosec=nanoseconds), frame_id=WORLD)
        wrench = Wrench(force=Vector3(**_xyz(force)), torque=Vector3(**_xyz(torque)))
        return WrenchStamped(header=header, wrench=wrench)


def _xyz(vector: FloatArray) -> dict[str, float]:
    return dict(zip("xyz", vector.tolist(), strict=True))
