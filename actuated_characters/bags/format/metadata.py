"""The `metadata.yaml` of a rosbag2 directory: read of any version of rosbag2, and written."""

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from actuated_characters.bags.format.storage import (
    CDR,
    MCAP,
    MOST_OF_METADATA,
    SUFFIXES,
    ZSTD,
    reason,
)
from msgs_config import files
from msgs_config.errors import RecordingError, one_of
from msgs_config.file_kinds import refuse_other_kind

METADATA = "metadata.yaml"
_TOP_LEVEL_KEY = "rosbag2_bagfile_information"
BAG = "bag"  # name of the bag in a run's directory
EARLIER_BAG = BAG + "-earlier"  # older part of the bag while a recording of bounded size is made
FILE, MESSAGE = "file", "message"  # what rosbag2 compressed; MCAP's chunks say so themselves
_LATEST_VERSION = 9  # version that Jazzy writes


class BagMetadata(NamedTuple):
    """The files and topics of a bag."""

    files: tuple[Path, ...]  # the files in the order of writing
    topics: tuple[str, ...]
    compression_mode: str  # FILE, MESSAGE or empty
    content: Mapping[str, Any]  # all of it


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
    except Exception as error:  # raised for a file that holds something else
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
    """Read the content of `metadata.yaml`, unchecked.

    Raises:
        RecordingError: it is no YAML, or too large.
        OSError, UnicodeDecodeError, KeyError, TypeError: it cannot be read, or is something else.
    """
    refuse_other_kind(bag / METADATA, "the metadata of a bag", (".yaml",), RecordingError)
    with (bag / METADATA).open(encoding="utf-8") as file:
        text = file.read(MOST_OF_METADATA + 1)
    place = f"{METADATA} is damaged"
    content = files.parse_yaml(place, text, RecordingError, most=MOST_OF_METADATA)
    return content[_TOP_LEVEL_KEY]


def write_metadata(bag: Path, content: Mapping[str, Any]) -> None:
    """Write `metadata.yaml`, whole. Raises OSError."""
    scratch = bag / f"{METADATA}.tmp"
    text = files.dump_yaml({_TOP_LEVEL_KEY: dict(content)})
    scratch.write_text(text, encoding="utf-8")
    scratch.replace(bag / METADATA)


def _parse(bag: Path, content: Mapping[str, Any]) -> BagMetadata:
    paths = content["relative_file_paths"]
    topics = [topic["topic_metadata"] for topic in content["topics_with_message_count"]]
    others = {topic["serialization_format"] for topic in topics} - {CDR}
    mode = (content.get("compression_mode") or "").lower()  # rosbag2 writes it in capitals
    mode = "" if mode == "none" else mode
    # `ros2 bag reindex` of Humble leaves the storage empty; each file's suffix says it as well
    named = content["storage_identifier"] or storage_of(paths)
    found: dict[str, tuple[Any, Collection[str]]] = {
        "storage": (named, SUFFIXES),
        "compression mode": (mode, dict.fromkeys(["", FILE, MESSAGE])),
        "compression": (content["compression_format"] if mode else ZSTD, {ZSTD}),
        "serialisation": (max(others, default=CDR), {CDR}),
    }
    for what, (value, choices) in found.items():
        if value not in choices:
            problem = one_of(what, value, [choice for choice in choices if choice])
            raise RecordingError(f"cannot read recording {bag}: {problem}")
    present = tuple(bag / PurePath(path).name for path in paths)  # old paths include the bag's name
    return BagMetadata(present, tuple(str(topic["name"]) for topic in topics), mode, content)


def storage_of(paths: Iterable[str]) -> str:
    """The storage of a bag's files by the suffix of the first one; empty if that says none."""
    suffixes = {suffix for path in list(paths)[:1] for suffix in PurePath(path).suffixes}
    return next((name for name, suffix in SUFFIXES.items() if suffix in suffixes), "")


def recover_hint(bag: Path, does: str) -> str:
    """The end of an error about a bag: what `info --recover` does, if it can do anything."""
    run = bag.parent if bag.name == BAG else bag
    can = bag.is_dir() and any(file.suffix == SUFFIXES[MCAP] for file in bag.iterdir())
    return f"; 'actuated_characters info {run} --recover' {does}" if can else ""


def _missing(bag: Path) -> str:
    """The reason why there is no metadata file, and a remedy."""
    if not bag.is_dir():
        return "there is no such directory"
    return f"it has no {METADATA}{recover_hint(bag, 'makes one')}"
