"""Describes to the user which nodes publish on a topic: missing, conflicting and competing ones."""

import time
from collections.abc import Sequence

from msgs_config.bus.node import BusNode
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.messages.session import REMEDY
from msgs_config.messages.topic import Topic

_UNKNOWN_NODE = "a node whose name is not known"
_NAMES_SHOWN = 6
_NAME_PATIENCE, _NAME_POLL = 1.0, 0.01  # s


def describe_waiting(node: BusNode, topic: Topic, missing: list[str]) -> str:
    """One sentence: the entries that lack a command, and the publishers that there are."""
    shown = ", ".join(missing[:_NAMES_SHOWN])
    more = f" and {len(missing) - _NAMES_SHOWN} more" if len(missing) > _NAMES_SHOWN else ""
    return f"waiting for commands of {shown}{more}; {describe_publishers(node, topic)}"


def describe_conflict(node: BusNode, joint: str, topic: Topic) -> str:
    """One sentence: the entry that is commanded twice, and the nodes that publish commands."""
    return _conflict(joint, topic, publisher_names(node, topic))


def describe_publishers(node: BusNode, topic: Topic) -> str:
    """One sentence: the nodes that publish on a topic, and whose type or QoS does not fit."""
    names = publisher_names(node, topic)
    if not names:
        return f"'{topic.name}' has no publisher"
    sentence = f"'{topic.name}' is published by {', '.join(names)}"
    endpoints = [(each.node or _UNKNOWN_NODE, each) for each in node.endpoints(topic)]
    types = {(name, each.type_name) for name, each in endpoints}
    for name, found in sorted(types):
        if found != topic.type_name:
            sentence += f"; the type of {name} is {found}, and must be {topic.type_name}"
    for name, each in endpoints:
        if each.misfit:
            sentence += f"; the QoS of {name.rpartition('/')[2]} does not fit: {each.misfit}"
    return sentence


def publisher_names(node: BusNode, topic: Topic) -> list[str]:
    """Full names of the nodes that publish on a topic; with GIDs where several have one name.

    A publisher is discovered a moment before the name of its node, which is worth a short wait.
    """
    deadline = time.monotonic() + _NAME_PATIENCE
    while _UNKNOWN_NODE in (found := _found(node, topic)) and time.monotonic() < deadline:
        time.sleep(_NAME_POLL)
    return _told_apart(found)


def _found(node: BusNode, topic: Topic) -> dict[str, list[str]]:
    """GIDs of the publishers of a topic, by the full names of their nodes."""
    found: dict[str, list[str]] = {}
    for each in node.endpoints(topic):
        found.setdefault(each.node or _UNKNOWN_NODE, []).append(each.identity)
    return found


def _told_apart(found: dict[str, list[str]]) -> list[str]:
    return [
        name if len(gids) == 1 else f"{len(gids)} nodes {name} (GIDs {' and '.join(sorted(gids))})"
        for name, gids in sorted(found.items())
    ]


def _conflict(joint: str, topic: Topic, senders: Sequence[str]) -> str:
    return (
        f"two different commands for '{joint}' at one tick; '{topic.name}' is published by "
        + ", ".join(senders)
    )


class ConflictLog:
    """Logs in real time which nodes compete for a joint, once for each, when they are known."""

    def __init__(self, node: BusNode, logger: OnceLogger) -> None:
        self._node = node
        self._once_logger = logger
        self._topics: dict[str, Topic] = {}  # by joint

    def add(self, joint: str, topic: Topic) -> None:
        """Note a conflict of commands for a joint; finding the publishers' names takes time."""
        self._topics[joint] = topic

    def log(self) -> None:
        """Log the conflicts whose publishers' names are known."""
        for joint, topic in self._topics.items():
            if not self._once_logger.has_logged(joint):
                found = _found(self._node, topic)
                if _UNKNOWN_NODE not in found:
                    sentence = _conflict(joint, topic, _told_apart(found))
                    self._once_logger.log_once(f"{sentence}; the last one counts", kind=joint)


class OtherSimulators:
    """Logs, once for each set of names, that a topic of states has more than one publisher."""

    def __init__(
        self, node: BusNode, states: Sequence[Topic], session: str, logger: OnceLogger
    ) -> None:
        self._node = node
        self._states = states
        self._session = session
        self._once_logger = logger
        self.seen = False  # whether a topic had more than one publisher at the last `look`

    def look_at_graph(self) -> None:
        """Look at the graph; cheap as long as this node is alone."""
        shared = [topic for topic in self._states if self._node.count_publishers(topic.name) > 1]
        self.seen = bool(shared)
        for topic in shared:
            self._log(topic)

    def _log(self, topic: Topic) -> None:
        own, found = self._node.get_fully_qualified_name(), _found(self._node, topic)
        if _UNKNOWN_NODE in found or own not in found:  # not all names are known yet
            return
        names = sorted(name for name, gids in found.items() for _ in gids)
        names.remove(own)
        if names:
            others = ", ".join(names)
            self._once_logger.log_once(
                f"'{topic.name}' of this node, {own} (session {self._session}), is published by "
                f"{others} as well; unless that was killed just now, {REMEDY}"
            )
