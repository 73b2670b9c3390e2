"""Says which nodes use a topic of this node with another message type, so that neither hears."""

import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from rclpy.node import Node

from msgs_config.bus.once_logger import OnceLogger

_PERIOD = 1.0  # s between looks at the graph
_UNKNOWN_NODE = "_UNKNOWN_"  # ROS says this of a node whose name has not come yet


class OtherType(NamedTuple):
    """A node's endpoint of a topic with another type than is right."""

    node: str  # full name
    type_name: str  # as "std_msgs/msg/Float64MultiArray"


def type_name(message_type: type) -> str:
    """The name of a message class, such as "sensor_msgs/msg/JointState"."""
    *namespace, _ = message_type.__module__.split(".")
    return "/".join([*namespace, message_type.__name__])


def other_types(infos: list[Any], right: str) -> list[OtherType]:
    """Those of a topic's endpoints, as rclpy describes them, whose type is not the right one."""
    return sorted(
        {
            OtherType(f"{info.node_namespace.rstrip('/')}/{info.node_name}", info.topic_type)
            for info in infos
            if info.topic_type != right
        }
    )


class EndpointTypes:
    """Logs, once for each node and topic, that others publish or read a topic with another type.

    DDS joins endpoints of equal types alone, so such messages are lost without a word.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._once_logger = OnceLogger(node.get_logger())
        self._counts: dict[tuple[str, bool], int] = {}  # endpoints when last looked at
        self._next_look = 0.0

    def look_at_graph(self) -> None:
        """Look at the graph if it is time; cheap as long as no endpoint comes or goes."""
        now = time.monotonic()
        if now < self._next_look:
            return
        self._next_look = now + _PERIOD
        node = self._node
        sides: tuple[tuple[Any, bool, Callable[[str], int], Callable[[str], Any]], ...] = (
            (node.subscriptions, True, node.count_publishers, node.get_publishers_info_by_topic),
            (node.publishers, False, node.count_subscribers, node.get_subscriptions_info_by_topic),
        )
        for endpoints, is_input, count, infos in sides:
            for name, right in _topics(endpoints):
                found = count(name)
                if self._counts.get((name, is_input), 0) == found:
                    continue
                if self._tell(name, right, other_types(infos(name), right), is_input):
                    self._counts[name, is_input] = found

    def _tell(self, topic: str, right: str, others: list[OtherType], is_input: bool) -> bool:
        """Log what is wrong; whether all is known, or else to be looked at again."""
        does, result = ("published", "never heard") if is_input else ("read", "never sent")
        for other in others:
            if _UNKNOWN_NODE in other.node:
                return False
            self._once_logger.log_once(
                f"'{topic}' is {does} by {other.node} as {other.type_name}, which is {result}: "
                f"its type must be {right}"
            )
        return True


def _topics(endpoints: Any) -> Iterator[tuple[str, str]]:
    """Full name and type of each publisher's or subscription's topic."""
    for endpoint in list(endpoints):
        message_type = getattr(endpoint, "msg_type", None)
        if message_type is not None:
            yield endpoint.topic_name, type_name(message_type)
