"""Names, message types and quality of service of every topic."""

from dataclasses import dataclass, replace

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

_DEEP_HISTORY = 5000
"""With a small history a recorder that pauses for a moment loses messages."""

STREAM_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=_DEEP_HISTORY,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
LATCHED_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


@dataclass(frozen=True)
class Topic:
    """A topic of the contract. A name that begins with `~` is below its node's name."""

    name: str
    message_type: type
    qos: QoSProfile

    def of(self, node_name: str) -> "Topic":
        """The topic as another node names it: `~` is the node that publishes it."""
        return replace(self, name=self.name.replace("~", node_name))


def create_publisher(node: Node, topic: Topic) -> Publisher:
    """A node's publisher on a topic of the contract."""
    return node.create_publisher(topic.message_type, topic.name, topic.qos)


JOINT_STATES = Topic("joint_states", JointState, STREAM_QOS)
JOINT_TORQUES = Topic("joint_torques", JointState, STREAM_QOS)
REFERENCE = Topic("~/reference", JointState, STREAM_QOS)
CLOCK = Topic("/clock", Clock, STREAM_QOS)
EPISODE = Topic("episode", Header, LATCHED_QOS)
CONFIGURATION = Topic("~/configuration", String, LATCHED_QOS)
DIAGNOSTICS = Topic("/diagnostics", DiagnosticArray, STREAM_QOS)

SIM_NODE = "sim_node"
CONTROLLER_NODE = "controller_node"
RECORDER_NODE = "recorder"
