"""Writes a recording without end into a bag of bounded size: of all that came, the last part.

The bag has at most two files. When the newer one is full, the older one is deleted, and another one
begins, with the last message of each latched topic, which say what the states mean.
"""

import shutil
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Any

from actuated_characters.bags.format.metadata import EARLIER_BAG, load_metadata, write_metadata
from actuated_characters.bags.format.offered_qos import is_latched
from actuated_characters.bags.writer import BagWriter
from msgs_config.errors import RecordingError
from msgs_config.messages.topic import Quality

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

_STATIC_SETS = 64  # most sets of static frames that are kept, one of each character


class LastPartsWriter:
    """A `BagWriter` that keeps at least so many bytes of messages, and at most twice as many."""

    def __init__(self, path: Path, part_bytes: int, **options: str) -> None:
        """Create the bag at `path`; `options` are those of `BagWriter`, and so are the errors."""
        self._path, self._part_bytes, self._options = path, part_bytes, options
        self._earlier = path.with_name(EARLIER_BAG)
        self._custom_data: dict[str, str] = {}
        self._topics: dict[str, tuple[str, Quality | QoSProfile]] = {}
        self._latched: dict[str, deque[tuple[bytes, int | None]]] = {}
        self._size = 0  # bytes of the messages in the newer file
        self._bag = BagWriter(path, **options)

    def set_custom_data(self, name: str, text: str) -> None:
        """Keep a text in the metadata. Raises as `BagWriter`."""
        self._custom_data[name] = text
        self._bag.set_custom_data(name, text)

    def add_topic(self, topic: str, type_name: str, offered: "Quality | QoSProfile") -> None:
        """Announce a topic. Raises as `BagWriter`."""
        self._bag.add_topic(topic, type_name, offered)
        self._topics[topic] = type_name, offered

    def write(
        self, topic: str, raw: bytes, log_time_ns: int, published_ns: int | None = None
    ) -> None:
        """Append a message. Raises as `BagWriter`."""
        if self._size > self._part_bytes:
            self._begin_part(log_time_ns)
        self._bag.write(topic, raw, log_time_ns, published_ns)
        self._size += len(raw)
        if is_latched(self._topics[topic][1]):
            # each character of a world has static frames of its own on the one topic
            most = _STATIC_SETS if topic == "/tf_static" else 1
            latched = self._latched.setdefault(topic, deque(maxlen=most))
            latched.append((raw, published_ns))

    def flush(self) -> None:
        """Hand all that was written to the operating system. Raises as `BagWriter`."""
        self._bag.flush()

    def close(self) -> None:
        """Complete the recording, as one bag. Raises RecordingError: the disk refuses the data."""
        self._bag.close()
        try:
            if self._earlier.is_dir():
                _join(self._earlier, self._path)
        except (OSError, KeyError, TypeError) as error:
            raise RecordingError(f"recording {self._path} is incomplete: {error}") from error

    def _begin_part(self, log_time_ns: int) -> None:
        self._bag.close()
        try:
            shutil.rmtree(self._earlier, ignore_errors=True)
            self._path.rename(self._earlier)
        except OSError as error:
            raise RecordingError(f"cannot write recording {self._path}: {error}") from error
        self._bag, self._size = BagWriter(self._path, **self._options), 0
        for name, text in self._custom_data.items():
            self._bag.set_custom_data(name, text)
        for topic, (type_name, offered) in self._topics.items():
            self._bag.add_topic(topic, type_name, offered)
        for topic, latched in self._latched.items():
            for raw, published_ns in latched:
                self._bag.write(topic, raw, log_time_ns, published_ns)


def _join(earlier: Path, bag: Path) -> None:
    """Make one bag of two that are complete; `earlier` is gone afterwards."""
    first, second = load_metadata(earlier), load_metadata(bag)
    for found in first["files"]:
        moved = f"{earlier.name}{Path(found['path']).suffix}"
        (earlier / found["path"]).replace(bag / moved)
        found["path"] = moved
    joined = {**second, "files": [*first["files"], *second["files"]]}
    joined["relative_file_paths"] = [found["path"] for found in joined["files"]]
    joined["message_count"] = first["message_count"] + second["message_count"]
    joined["starting_time"] = first["starting_time"]
    start_ns, last_ns = (
        each["starting_time"]["nanoseconds_since_epoch"] for each in (first, second)
    )
    joined["duration"] = {
        "nanoseconds": last_ns + second["duration"]["nanoseconds"] - start_ns,
    }
    counts = _counts(first)
    for topic in joined["topics_with_message_count"]:
        topic["message_count"] += counts.get(topic["topic_metadata"]["name"], 0)
    write_metadata(bag, joined)
    shutil.rmtree(earlier)


def _counts(metadata: dict[str, Any]) -> dict[str, int]:
    return {
        each["topic_metadata"]["name"]: each["message_count"]
        for each in metadata["topics_with_message_count"]
    }
