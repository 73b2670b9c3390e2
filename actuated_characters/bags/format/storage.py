"""Names of rosbag2's storages and compressions, and a message as a file of a bag stores it."""

from collections.abc import Mapping
from typing import NamedTuple

MCAP, SQLITE3 = "mcap", "sqlite3"
NONE, ZSTD = "none", "zstd"
COMPRESSIONS = (NONE, ZSTD)
SUFFIXES = {MCAP: ".mcap", SQLITE3: ".db3"}
ZSTD_SUFFIX = ".zstd"  # suffix of a file that is compressed as a whole
FILE_SUFFIXES = (*SUFFIXES.values(), ZSTD_SUFFIX)
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"  # no message begins so: CDR begins with a zero
CDR = "cdr"  # the only serialisation that ROS 2 has
MOST_OF_METADATA = 1 << 22  # characters; for a hundred topics it takes some 100,000
LATEST_NS = 2**63 - 1  # rosbag2 holds times in int64
ROS_DISTRO = "jazzy"  # the distribution of the wheels of ROS 2
WALL, SIMULATED = "wall", "simulated"
LOG_TIMES = (WALL, SIMULATED)
LOG_TIME = "log_time"  # key in channels' metadata and rosbag2's custom data: WALL or SIMULATED
OFFERED_QOS, TYPE_HASH = "offered_qos_profiles", "topic_type_hash"  # keys of a channel's metadata


class StoredTopic(NamedTuple):
    """A topic as a file announces it."""

    name: str
    type_name: str  # such as "sensor_msgs/msg/JointState"
    serialization: str
    definition: str = ""
    type_hash: str = ""  # empty before Jazzy
    offered_qos: str = ""  # YAML, as rosbag2 writes it
    has_simulated_log_time: bool = False  # False: log times are of the wall clock


class StoredMessage(NamedTuple):
    """A message of a file; those of one file sort by time, and then as they were written."""

    log_time_ns: int
    published_ns: int | None  # wall time; None where the storage does not have it
    place: tuple[int, int]  # says where the message is in the file
    topic: StoredTopic
    raw: bytes  # the stored bytes: rosbag2 may have compressed each message
    number: int = 0  # its number among its channel's messages; 0 if it has none


class FileStatistics(NamedTuple):
    """The messages of a file, counted."""

    counts: Mapping[str, int]  # messages by topic; topics without any may be left out
    first_ns: int  # log times of the first message and of the last; 0 without messages
    last_ns: int


class Beginning(NamedTuple):
    """What may be left out in front: the messages of before, but of some topics."""

    log_time_ns: int = 0
    whole: frozenset[str] = frozenset()


def reason(error: Exception) -> str:
    """The text of a library's error in one line."""
    text = (error.strerror if isinstance(error, OSError) else None) or str(error)
    return " ".join(text.split()) or type(error).__name__
