"""Notices other nodes that publish the states of the simulator's own topics."""

from collections.abc import Sequence

from rclpy.node import Node

from msgs_config.messages.session import REMEDY
from msgs_config.messages.topics import Topic
from msgs_config.runtime.once_logger import OnceLogger
from sim_node.interface.character_interface import CharacterInterface
from sim_node.interface.publisher_diagnosis import all_publisher_names


class RivalWatch:
    """Logs, once for each set of names, that a topic of states has more than one publisher."""

    def __init__(
        self, node: Node, ports: Sequence[CharacterInterface], session: str, logger: OnceLogger
    ) -> None:
        self._node = node
        self._topics: list[Topic] = [port.states for port in ports]
        self._session = session
        self._once_logger = logger
        self.seen = False  # at the last look

    def look(self) -> None:
        """Look at the graph; cheap as long as this node is alone."""
        shared = [each for each in self._topics if self._node.count_publishers(each.name) > 1]
        self.seen = bool(shared)
        for topic in shared:
            self._tell(topic)

    def _tell(self, topic: Topic) -> None:
        names = all_publisher_names(self._node, topic)
        own = self._node.get_fully_qualified_name()
        if names is None or own not in names:  # they are yet to come
            return
        names.remove(own)
        if names:
            others = ", ".join(names)
            self._once_logger.log_once(
                f"'{topic.name}' of this node, {own} (session {self._session}), is published by "
                f"{others} as well; unless that was killed just now, {REMEDY}"
            )
