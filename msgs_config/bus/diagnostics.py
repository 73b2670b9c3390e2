"""The one status that a node reports on `/diagnostics`."""

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from msgs_config.bus.node import BusNode
from msgs_config.messages.cdr import encode, split_stamp
from msgs_config.messages.topics import DIAGNOSTICS

DIAGNOSTICS_PERIOD = 1.0  # s of wall time


class DiagnosticsPublisher:
    """Publishes a node's counts, and its fault or a warning if it has one."""

    def __init__(self, node: BusNode) -> None:
        self._node = node
        self._publisher = node.publisher(DIAGNOSTICS)

    @property
    def is_heard(self) -> bool:
        """Whether there is a subscriber; without one, there is no need to gather anything."""
        return bool(self._publisher.get_subscription_count())

    def publish(
        self,
        values: Mapping[str, object],
        fault: str | None = None,
        warning: str | None = None,
        character: str = "",
        *,
        below: str = "",
    ) -> None:
        """Publish the values by name.

        With a fault the level is ERROR and its text the message; with a warning alone it is WARN.
        The status has the node's name, that in a namespace `below` its own if there is one, and
        the character's as its `hardware_id`: in one namespace, so both nodes have the same.
        """
        namespace = "/".join(filter(None, (self._node.get_namespace().strip("/"), below)))
        level = DiagnosticStatus.OK if warning is None else DiagnosticStatus.WARN
        status = DiagnosticStatus(
            level=level if fault is None else DiagnosticStatus.ERROR,
            name=f"{namespace}/{self._node.get_name()}".lstrip("/"),
            message=fault or warning or "running",
            hardware_id=f"{namespace}/{character}".lstrip("/"),
            values=[KeyValue(key=name, value=str(value)) for name, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        stamp = message.header.stamp
        stamp.sec, stamp.nanosec = split_stamp(self._node.now_ns())
        self._publisher.publish(encode(message))

    def flush(self, seconds: float) -> bool:
        """Wait until every subscriber has the last report, at most `seconds`; whether it has."""
        return self._publisher.is_acknowledged(seconds)
