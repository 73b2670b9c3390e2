"""Writes recordings: rosbag2 directories of serialised messages, without ROS' rosbag2.

What is written is version 9, as ROS 2 Jazzy's `ros2 bag record` writes it.
"""

from pathlib import Path
from typing import Self

from rclpy.duration import Duration, Infinite
from rclpy.qos import LivelinessPolicy, QoSProfile
from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

from actuated_characters.bags.definitions import read_definition
from actuated_characters.bags.storage import MCAP, NONE, BagFiles
from msgs_config.errors import RecordingError, one_of

LATEST_NS = 2**63 - 1  # rosbag2 holds times in int64
_NS_PER_S = 10**9


class BagWriter(BagFiles):
    """Writes serialised messages into a new rosbag2 directory.

    `close` makes the recording complete. Leaving the `with` block closes it after an error too:
    what came before an error is what explains it. For one thread only. A signal handler must not
    raise into `write` or `close`, which would leave half a record behind: let it set a flag.
    """

    def __init__(self, path: Path, *, storage: str = MCAP, compression: str = NONE) -> None:
        """Create the directory `path`, and its parents.

        Args:
            path: Where the recording goes.
            storage: `mcap`, or `sqlite3` as ROS 2 Humble has it by default.
            compression: `none` or `zstd`: about half the size.

        Raises:
            ConfigurationError: There is no such storage or compression.
            RecordingError: `path` exists already or cannot be created.
        """
        super().__init__(path, storage, compression)
        self._connections: dict[str, Connection] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def add_topic(self, topic: str, message_type: type, qos: QoSProfile) -> None:
        """Announce a topic, with the quality of service that its publisher offers.

        Raises:
            RecordingError: The recording is closed or has the topic already, the definition of
                the message type is not installed, or the disk refuses the data.
        """
        self.check_open()
        if topic in self._connections:
            raise RecordingError(f"recording {self.path} has topic '{topic}' already")
        definition = read_definition(message_type)
        self._connections[topic] = self.add(topic, definition, [_offered(qos)])

    def write(self, topic: str, raw: bytes, log_time_ns: int) -> None:
        """Append a message, serialised as CDR; `log_time_ns` is when it was published, ns.

        Raises:
            RecordingError: The recording is closed, the topic was never added, the time is out of
                range, or the disk refuses the data, which closes the recording.
        """
        self.check_open()
        if topic not in self._connections:
            raise RecordingError(one_of("topic", topic, list(self._connections)))
        if not 0 <= log_time_ns <= LATEST_NS:
            raise RecordingError(f"log time {log_time_ns} ns is not within 0 to {LATEST_NS} ns")
        self.append(self._connections[topic], raw, log_time_ns)


def _offered(qos: QoSProfile) -> Qos:
    """The profile for rosbags; what is left open, as a publisher announces it (rosbag2 does so)."""
    return Qos(
        history=QosHistory(qos.history),
        depth=qos.depth,
        reliability=QosReliability(qos.reliability),
        durability=QosDurability(qos.durability),
        deadline=_qos_time(qos.deadline),
        lifespan=_qos_time(qos.lifespan),
        liveliness=QosLiveliness(qos.liveliness or LivelinessPolicy.AUTOMATIC),
        liveliness_lease_duration=_qos_time(qos.liveliness_lease_duration),
        avoid_ros_namespace_conventions=qos.avoid_ros_namespace_conventions,
    )


def _qos_time(duration: Duration) -> QosTime:
    return QosTime(*divmod(duration.nanoseconds or Infinite.nanoseconds, _NS_PER_S))
