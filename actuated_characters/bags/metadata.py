"""What `metadata.yaml` says of a rosbag2 directory, whichever version of rosbag2 wrote it."""

from collections.abc import Mapping
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from actuated_characters.bags.storage import MCAP, SUFFIXES, ZSTD, reason
from actuated_characters.runs.run_directory import BAG
from msgs_config import files
from msgs_config.errors import RecordingError, one_of

METADATA = "metadata.yaml"
FILE, MESSAGE = "file", "message"  # what rosbag2 compressed; within MCAP the file itself tells
_LATEST_VERSION = 9  # of Jazzy
_MOST = 1 << 22  # characters; of a hundred topics it has some 100,000
CDR = "cdr"  # the only serialisation that ROS 2 has


class BagMetadata(NamedTuple):
    """What a reader needs to know before it opens the files."""

    files: tuple[Path, ...]  # in the order in which they were written
    topics: tuple[str, ...]
    compression_mode: str  # FILE, MESSAGE or empty


def read_metadata(bag: Path) -> BagMetadata:
    """Read the metadata of versions 1 to 9, and of later ones that still say the same.

    Raises:
        RecordingError: there is none, or something in it cannot be used.
    """
    try:
        content = load_metadata(bag)
        version = int(content["version"])
    except OSError as error:
        raise RecordingError(f"no complete recording at {bag}: {_missing(bag)}") from error
    except RecordingError as error:
        raise RecordingError(f"cannot read recording {bag}: {error}") from error
    except Exception as error:  # of a file that holds something else
        raise RecordingError(f"cannot read recording {bag}: {METADATA} is damaged") from error
    try:
        return _parse(bag, content)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        later = f" (version {version}, later than {_LATEST_VERSION})"
        raise RecordingError(
            f"cannot read recording {bag}: {METADATA}{later if version > _LATEST_VERSION else ''} "
            f"lacks a field or has one of a wrong type: {reason(error)}"
        ) from error


def load_metadata(bag: Path) -> Any:
    """What `metadata.yaml` says, unchecked.

    Raises:
        RecordingError: it is no YAML, or too large.
        OSError, UnicodeDecodeError, KeyError, TypeError: it cannot be read, or is something else.
    """
    with (bag / METADATA).open(encoding="utf-8") as file:
        text = file.read(_MOST + 1)
    place = f"{METADATA} is damaged"
    content = files.parse_yaml(place, text, RecordingError, most=_MOST)
    return content["rosbag2_bagfile_information"]


def _parse(bag: Path, content: Mapping[str, Any]) -> BagMetadata:
    storage, paths = content["storage_identifier"], content["relative_file_paths"]
    topics = [topic["topic_metadata"] for topic in content["topics_with_message_count"]]
    mode = (content.get("compression_mode") or "").lower()  # rosbag2 writes it in capitals
    mode = "" if mode == "none" else mode
    problem = None
    if storage not in SUFFIXES:
        problem = one_of("storage", storage, list(SUFFIXES))
    elif mode not in ("", FILE, MESSAGE):
        problem = one_of("compression mode", mode, [FILE, MESSAGE])
    elif mode and content["compression_format"] != ZSTD:
        problem = one_of("compression", content["compression_format"], [ZSTD])
    elif any(topic["serialization_format"] != CDR for topic in topics):
        problem = f"its messages are not serialised as {CDR}"
    if problem is not None:
        raise RecordingError(f"cannot read recording {bag}: {problem}")
    present = tuple(bag / PurePath(path).name for path in paths)  # once relative to `bag`'s parent
    names = tuple(str(topic["name"]) for topic in topics)
    return BagMetadata(present, names, mode)


def recover_hint(bag: Path, does: str) -> str:
    """What follows in an error of a bag: what the command `recover` does, if it can."""
    run = bag.parent if bag.name == BAG else bag
    can = bag.is_dir() and any(file.suffix == SUFFIXES[MCAP] for file in bag.iterdir())
    return f"; 'actuated_characters recover {run}' {does}" if can else ""


def _missing(bag: Path) -> str:
    """Why there is no metadata file, and what would help."""
    if not bag.is_dir():
        return "there is no such directory"
    return f"it has no {METADATA}{recover_hint(bag, 'makes one')}"
