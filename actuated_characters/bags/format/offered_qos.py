"""The quality of service of a publisher as rosbag2's metadata has it."""

from typing import TYPE_CHECKING, Any

from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

from msgs_config.messages.topic import Quality

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

_NS_PER_S = 10**9
_FOREVER_NS = 2**63 - 1  # what rclpy has for a duration without end


def offered_qos(offered: "Quality | QoSProfile") -> Qos:
    """The profile for rosbags; open values are those that a publisher announces, as in rosbag2."""
    if isinstance(offered, Quality):
        durability, reliability = QosDurability, QosReliability
        return Qos(
            history=QosHistory.KEEP_LAST,
            depth=offered.depth,
            reliability=reliability.RELIABLE if offered.is_reliable else reliability.BEST_EFFORT,
            durability=durability.TRANSIENT_LOCAL if offered.is_latched else durability.VOLATILE,
            deadline=_time(None),
            lifespan=_time(None),
            liveliness=QosLiveliness.AUTOMATIC,
            liveliness_lease_duration=_time(None),
            avoid_ros_namespace_conventions=False,
        )
    return Qos(
        history=QosHistory(offered.history),
        depth=offered.depth,
        reliability=QosReliability(offered.reliability),
        durability=QosDurability(offered.durability),
        deadline=_time(offered.deadline),
        lifespan=_time(offered.lifespan),
        liveliness=QosLiveliness(offered.liveliness or QosLiveliness.AUTOMATIC),
        liveliness_lease_duration=_time(offered.liveliness_lease_duration),
        avoid_ros_namespace_conventions=offered.avoid_ros_namespace_conventions,
    )


def _time(duration: Any) -> QosTime:
    """One of rclpy's durations; none, and one of 0, is without end."""
    nanoseconds = (0 if duration is None else duration.nanoseconds) or _FOREVER_NS
    return QosTime(*divmod(nanoseconds, _NS_PER_S))


def is_latched(offered: "Quality | QoSProfile") -> bool:
    """Whether those who come late get the last messages, too."""
    return offered_qos(offered).durability is QosDurability.TRANSIENT_LOCAL
