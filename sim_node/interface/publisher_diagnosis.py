"""What to tell a user whose simulator waits: what is missing, and who could send it."""

import time

from rclpy.node import Node
from rclpy.qos import QoSCompatibility, qos_check_compatible

from msgs_config.messages.topics import Topic

UNKNOWN_NODE = "a node whose name is not known"
_NAMES_SHOWN = 6
_UNKNOWN = "_UNKNOWN_"  # in what ROS says of a node whose name has not come yet
_NAME_PATIENCE, _NAME_POLL = 1.0, 0.01  # s


def describe_waiting(node: Node, topic: Topic, missing: list[str]) -> str:
    """One sentence: the entries that lack a command, and the publishers that there are."""
    shown = ", ".join(missing[:_NAMES_SHOWN])
    more = f" and {len(missing) - _NAMES_SHOWN} more" if len(missing) > _NAMES_SHOWN else ""
    return f"waiting for commands of {shown}{more}; {describe_publishers(node, topic)}"


def describe_conflict(joint: str, topic: Topic, senders: list[str]) -> str:
    """One sentence: the entry that is commanded twice, and who publishes commands."""
    return (
        f"two different commands for '{joint}' at one tick; '{topic.name}' is published by "
        + ", ".join(senders)
    )


def publisher_names(node: Node, topic: Topic, *, wait_for_names: bool = True) -> list[str]:
    """Full names of the nodes that publish on a topic.

    A publisher is discovered a moment before the name of its node, which is worth a short wait
    where there is time for it.
    """
    deadline = time.monotonic() + (_NAME_PATIENCE if wait_for_names else 0.0)
    while True:
        infos = node.get_publishers_info_by_topic(topic.name)
        names = {f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos}
        unknown = {name for name in names if _UNKNOWN in name}
        if not unknown or time.monotonic() > deadline:
            return sorted(names - unknown) + [UNKNOWN_NODE] * bool(unknown)
        time.sleep(_NAME_POLL)


def all_publisher_names(node: Node, topic: Topic) -> list[str] | None:
    """The full name of each publisher's node, one for each publisher; None if one is to come."""
    infos = node.get_publishers_info_by_topic(topic.name)
    names = [f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos]
    return None if any(_UNKNOWN in name for name in names) else sorted(names)


def describe_publishers(node: Node, topic: Topic) -> str:
    """One sentence: the nodes that publish on a topic, and whose QoS does not fit."""
    infos = node.get_publishers_info_by_topic(topic.name)
    if not infos:
        return f"nobody publishes on '{topic.name}'"
    sentence = f"'{topic.name}' is published by {', '.join(publisher_names(node, topic))}"
    for info in infos:
        compatibility, reason = qos_check_compatible(info.qos_profile, topic.qos)
        if compatibility == QoSCompatibility.ERROR:
            sentence += f"; the QoS of {info.node_name} does not fit: {reason.strip()}"
    return sentence
