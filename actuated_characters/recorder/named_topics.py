"""Topics that are recorded by their names alone, of any type that is installed."""

from collections.abc import Collection, Iterator, Sequence

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from actuated_characters.bags.format.definitions import find_message_type
from actuated_characters.recorder.topics import RecordedTopic, check_names
from msgs_config.bus.dds import DdsNode
from msgs_config.errors import RecordingError
from msgs_config.messages.topic import Quality, Topic


class NamedTopics:
    """Looks for topics by their names alone; publishers have the type and quality of service."""

    def __init__(self, node: DdsNode, names: Sequence[str], known: Collection[str]) -> None:
        """Look for all names, resolved, but those that are known.

        Raises:
            ConfigurationError: a name is not one that a topic can have.
        """
        self._node = node
        check_names(node, "topics", names)
        resolved = [node.resolve_topic_name(name) for name in names]
        self.missing = {name for name in resolved if name not in known}
        """Names of which no publisher was seen so far."""

    def find_published(self) -> Iterator[tuple[RecordedTopic, QoSProfile]]:
        """Yield topics that have a publisher now, each once, with the QoS of the first publisher.

        A type that is not installed is logged, and the topic not looked for any more.
        """
        for name in sorted(self.missing):
            endpoints = self._node.get_publishers_info_by_topic(name)
            if not endpoints:
                continue
            self.missing.discard(name)
            try:
                find_message_type(endpoints[0].topic_type)
            except RecordingError as error:
                self._node.get_logger().error(f"'{name}' is not recorded: {error}")
                continue
            profiles = [endpoint.qos_profile for endpoint in endpoints]
            topic = Topic(name, endpoints[0].topic_type, fitting_quality(profiles))
            yield RecordedTopic(topic, name, name, None), profiles[0]


def fitting_quality(profiles: Sequence[QoSProfile]) -> Quality:
    """The strictest quality of service with which a subscription fits all of these publishers."""
    return Quality(
        depth=1,
        is_latched=all(each.durability is DurabilityPolicy.TRANSIENT_LOCAL for each in profiles),
        is_reliable=all(each.reliability is ReliabilityPolicy.RELIABLE for each in profiles),
    )
