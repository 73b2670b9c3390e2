"""Message types and their definitions, from the packages that are installed."""

import json
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from msgs_config.bus.endpoint_types import type_name
from msgs_config.errors import RecordingError
from msgs_config.messages.topic import find_message_class


class MessageDefinition(NamedTuple):
    """A message type as a bag describes it, so that any reader can decode it."""

    type_name: str  # as "sensor_msgs/msg/JointState"
    text: str  # the .msg file, then the .msg files of all types in it, each below its name
    type_hash: str  # of REP 2016, "RIHS01_" and 64 hexadecimal digits


@cache
def find_message_type(name: str) -> Any:
    """Return the class of a type such as `std_msgs/msg/String`.

    Raises:
        RecordingError: it is not installed.
    """
    try:
        return find_message_class(name)
    except (ImportError, AttributeError, ValueError) as error:
        raise RecordingError(f"message type {name} is not installed") from error


def read_definition(message_type: type) -> MessageDefinition:
    """Read the definition of a message type from the package that it is installed with.

    Raises:
        RecordingError: A file of the definition is not installed.
    """
    name = type_name(message_type)
    description = json.loads(_read_installed(name, ".json"))
    hashes = {entry["type_name"]: entry["hash_string"] for entry in description["type_hashes"]}
    texts = [_read_installed(name, ".msg")]
    for nested in description["type_description_msg"]["referenced_type_descriptions"]:
        package, _, short = nested["type_name"].split("/")
        text = _read_installed(nested["type_name"], ".msg")
        texts.append(f"{'=' * 80}\nMSG: {package}/{short}\n{text}")
    return MessageDefinition(name, "\n".join(texts), hashes[name])


def _read_installed(name: str, suffix: str) -> str:
    """The text of a type's file, from the `share` folder beside the package's Python code.

    The ament index would do in a full ROS install only: nothing points it to the pip wheels.
    """
    spec = find_spec(name.partition("/")[0])
    folders = spec.submodule_search_locations if spec else None
    for folder in folders or ():
        for prefix in Path(folder).parents:
            file = prefix / "share" / f"{name}{suffix}"
            if file.is_file():
                return file.read_text(encoding="utf-8")
    raise RecordingError(
        f"no definition of message type {name}: share/{name}{suffix} is not installed"
    )
