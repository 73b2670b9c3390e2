"""Names, message types and quality of service of every topic."""

import re
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TypeAlias

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState, MultiDOFJointState, PointCloud2
from std_msgs.msg import Header, String
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from msgs_config.character.sensors import SensorType

try:  # a full ROS install has it, the wheels have not
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

Outgoing: TypeAlias = tuple[Publisher, bytes]
"""A serialised message and its publisher."""

LISTENING_DEPTH = 50_000
"""Depth of a reader whose process may be busy otherwise for long, with a disk for instance.

It costs nothing until it is needed, unlike a publisher's."""


def _keep_last(
    depth: int,
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE,
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE,
) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=reliability,
        durability=durability,
    )


STREAM_QOS = _keep_last(5000)
"""With a small history a recorder that pauses for a moment loses messages."""
LATCHED_QOS = _keep_last(1, DurabilityPolicy.TRANSIENT_LOCAL)
CHANGES_QOS = _keep_last(100, DurabilityPolicy.TRANSIENT_LOCAL)
"""For values that may change twice at once: a listener of depth 1 has the last, a recorder all."""
DISPLAY_QOS = _keep_last(1000)
"""A viewer's own depth may be 1; a recorder's is not."""


@dataclass(frozen=True)
class Topic:
    """A topic of the contract. A name that begins with `~` is below its node's name."""

    name: str
    message_type: type
    qos: QoSProfile

    def of(self, node_name: str) -> "Topic":
        """The topic as another node names it: `~` is the node that publishes it."""
        return replace(self, name=self.name.replace("~", node_name))

    @property
    def throttled(self) -> "Topic":
        """The topic with some of its messages, a few a second of wall time, for viewers."""
        return replace(self, name=f"{self.name}_throttle", qos=DISPLAY_QOS)

    def under(self, namespace: str) -> "Topic":
        """The topic below a namespace; with an empty one it is the topic itself."""
        return replace(self, name=f"{namespace}/{self.name}") if namespace else self

    def for_listener(self, depth: int = LISTENING_DEPTH) -> "Topic":
        """The topic with a queue deep enough for a listener that polls rarely."""
        return replace(self, qos=_keep_last(depth, self.qos.durability, self.qos.reliability))


def create_publisher(node: Node, topic: Topic) -> Publisher:
    """A node's publisher on a topic of the contract."""
    return node.create_publisher(
        topic.message_type,
        topic.name,
        topic.qos,
        # each default callback is one thing more that the executor looks at in each turn
        event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
    )


def has_subscribers(publisher: Publisher) -> bool:
    """Whether anybody subscribes; asked at every tick, so without rclpy's guard of the handle."""
    return bool(publisher.handle.get_subscription_count())


def publish_together(messages: Iterable[Outgoing]) -> None:
    """Publish serialised messages in a row.

    The first wakes its subscribers up, which takes longer than all else; of messages with work
    between them each would find its subscribers asleep again.
    """
    for publisher, raw in list(messages):  # all are made before the first is published
        publisher.handle.publish_raw(raw)


def flush(publishers: Iterable[Publisher], seconds: float) -> bool:
    """Wait until every subscriber has all that was published, at the most `seconds`; whether so."""
    deadline = time.monotonic() + seconds
    return all(
        publisher.wait_for_all_acked(Duration(seconds=max(deadline - time.monotonic(), 0.0)))
        for publisher in publishers
    )


JOINT_STATES = Topic("joint_states", JointState, STREAM_QOS)
JOINT_TORQUES = Topic("joint_torques", JointState, STREAM_QOS)
EXTERNAL_WRENCH = Topic("external_wrench", MultiDOFJointState, STREAM_QOS)
APPLIED_WRENCH = Topic("applied_wrench", MultiDOFJointState, STREAM_QOS)
CONTACTS = Topic("contacts", MultiDOFJointState, STREAM_QOS)
THROW = Topic("throw", JointState, STREAM_QOS)
APPLIED_THROW = Topic("applied_throw", JointState, STREAM_QOS)
THROWN = Topic("thrown", MultiDOFJointState, STREAM_QOS)
ODOM = Topic("odom", Odometry, STREAM_QOS)
ROBOT_DESCRIPTION = Topic("robot_description", String, LATCHED_QOS)
DESCRIPTION_JOINT_STATES = Topic("description_joint_states", JointState, DISPLAY_QOS)
VISUALIZATION = Topic("visualization", MarkerArray, DISPLAY_QOS)
INITIAL_STATE = Topic("~/initial_state", JointState, LATCHED_QOS)
REFERENCE = Topic("~/reference", JointState, STREAM_QOS)
NET_WRENCH = Topic("~/net_wrench", WrenchStamped, STREAM_QOS)
JOINT_TRAJECTORY = Topic("~/joint_trajectory", JointTrajectory, STREAM_QOS)
ACTIVE_TRAJECTORY = Topic("~/active_trajectory", JointTrajectory, LATCHED_QOS)
CMD_VEL = Topic("cmd_vel", Twist, STREAM_QOS)
CMD_VEL_STAMPED = Topic("cmd_vel_stamped", TwistStamped, STREAM_QOS)
ACTIVE_CMD_VEL = Topic("~/active_cmd_vel", TwistStamped, CHANGES_QOS)
STRENGTH = Topic("~/strength", JointState, STREAM_QOS)
ACTIVE_STRENGTH = Topic("~/active_strength", JointState, CHANGES_QOS)
MODE = Topic("~/mode", String, CHANGES_QOS)
PLAN = Topic("~/plan", PointCloud2, STREAM_QOS)
CLOCK = Topic("/clock", Clock, STREAM_QOS)
EPISODE = Topic("episode", Header, LATCHED_QOS)
CONFIGURATION = Topic("~/configuration", String, LATCHED_QOS)
DIAGNOSTICS = Topic("/diagnostics", DiagnosticArray, STREAM_QOS)
JOINT_STATES_THROTTLE = JOINT_STATES.throttled
CONTACTS_THROTTLE = CONTACTS.throttled
APPLIED_WRENCH_THROTTLE = APPLIED_WRENCH.throttled
THROWN_THROTTLE = THROWN.throttled
REFERENCE_THROTTLE = REFERENCE.throttled
TRANSFORMS = (
    []
    if TFMessage is None
    else [
        Topic("/tf", TFMessage, DISPLAY_QOS),
        Topic("/tf_static", TFMessage, LATCHED_QOS),
    ]
)
"""`/tf` and `/tf_static`, where their type is installed."""


def contact_wrench(link: str) -> Topic:
    """The topic of the contact wrench on a link; what no topic's name can have becomes `_`."""
    name = re.sub(r"\W|^(?=\d)", "_", link, flags=re.ASCII)
    return Topic(f"contact_wrenches/{name}", WrenchStamped, DISPLAY_QOS)


_SENSOR_MESSAGES = {SensorType.IMU: Imu, SensorType.FORCE: WrenchStamped}


def sensor_reading(sensor_type: SensorType, name: str) -> Topic:
    """The topic of a sensor's readings; `name` is that of `Sensor.topic`."""
    return Topic(name, _SENSOR_MESSAGES[sensor_type], STREAM_QOS)


SIM_NODE = "sim_node"
CONTROLLER_NODE = "controller_node"
RECORDER_NODE = "recorder"
VIEWER_NODE = "viewer"
