"""The one status that a node reports on `/diagnostics`."""

from collections.abc import Mapping

from msgs_config.bus.node import BusNode
from msgs_config.messages import typed
from msgs_config.messages.topics import DIAGNOSTICS

DIAGNOSTICS_PERIOD = 1.0  # s of wall time
_STATUS, _KEY_VALUE = "diagnostic_msgs/msg/DiagnosticStatus", "diagnostic_msgs/msg/KeyValue"


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
        levels = typed.constants(_STATUS)
        level = levels.OK if warning is None else levels.WARN
        status = typed.new(
            _STATUS,
            level=level if fault is None else levels.ERROR,
            name=f"{namespace}/{self._node.get_name()}".lstrip("/"),
            message=fault or warning or "running",
            hardware_id=f"{namespace}/{character}".lstrip("/"),
            values=[typed.new(_KEY_VALUE, key=k, value=str(v)) for k, v in values.items()],
        )
        message = typed.stamped(DIAGNOSTICS.type_name, self._node.now_ns(), status=[status])
        self._publisher.publish(typed.encode(message))

    def flush(self, seconds: float) -> bool:
        """Wait until every subscriber has the last report, at most `seconds`; whether it has."""
        return self._publisher.is_acknowledged(seconds)
