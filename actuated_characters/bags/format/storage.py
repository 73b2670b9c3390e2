"""Names of rosbag2's storages and compressions, and a message as a file of a bag stores it."""

from typing import NamedTuple

MCAP, SQLITE3 = "mcap", "sqlite3"
NONE, ZSTD = "none", "zstd"
STORAGES, COMPRESSIONS = (MCAP, SQLITE3), (NONE, ZSTD)
SUFFIXES = {MCAP: ".mcap", SQLITE3: ".db3"}
ZSTD_SUFFIX = ".zstd"  # of a file that is compressed as a whole
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"  # no message begins so: CDR begins with a zero
CDR = "cdr"  # the only serialisation that ROS 2 has
LATEST_NS = 2**63 - 1  # rosbag2 holds times in int64


class StoredTopic(NamedTuple):
    """A topic as a file announces it."""

    name: str
    type_name: str  # as "sensor_msgs/msg/JointState"
    serialization: str
    definition: str = ""
    type_hash: str = ""  # empty before Jazzy
    offered_qos: str = ""  # YAML, as rosbag2 writes it


class StoredMessage(NamedTuple):
    """A message of a file; those of one file sort by time, and then as they were written."""

    log_time_ns: int
    place: tuple[int, int]  # in the file
    topic: StoredTopic
    raw: bytes  # as it is stored: rosbag2 may have compressed each


def reason(error: Exception) -> str:
    """The text of a library's error in one line."""
    text = (error.strerror if isinstance(error, OSError) else None) or str(error)
    return " ".join(text.split()) or type(error).__name__
