"""Message types and their definitions: of the packages that are installed, or of rosbags."""

import json
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from msgs_config.errors import RecordingError
from msgs_config.messages import typed
from msgs_config.messages.topic import find_message_class


class MessageDefinition(NamedTuple):
    """A message type as a bag describes it, so that any reader can decode it."""

    type_name: str  # such as "sensor_msgs/msg/JointState"
    text: str  # the .msg file, then the .msg files of all types in it, each below its name
    type_hash: str  # REP 2016's hash: "RIHS01_" and 64 hexadecimal digits


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


def read_definition(name: str) -> MessageDefinition:
    """Read the definition of a type such as `std_msgs/msg/String`.

    It is that of the package that the type is installed with; without ROS that of rosbags, which
    has no comments, and the same hash.

    Raises:
        RecordingError: A file of the definition is not installed.
    """
    if find_spec(name.partition("/")[0]) is None and name in typed.types().fielddefs:
        text, _ = typed.types().generate_msgdef(name, ros_version=2)
        return MessageDefinition(name, text, typed.types().hash_rihs01(name))
    description = json.loads(_read_installed(name, ".json"))
    hashes = {entry["type_name"]: entry["hash_string"] for entry in description["type_hashes"]}
    texts = [_read_installed(name, ".msg")]
    for nested in description["type_description_msg"]["referenced_type_descriptions"]:
        package, _, short = nested["type_name"].split("/")
        text = _read_installed(nested["type_name"], ".msg")
        texts.append(f"{'=' * 80}\nMSG: {package}/{short}\n{text}")
    return MessageDefinition(name, "\n".join(texts), hashes[name])


@cache
def first_field(name: str) -> str:
    """The type of the first field of a message type, as `std_msgs/msg/Header`.

    That of a list ends in `[]`; empty where it has no field, or the type is not known.
    """
    try:
        text = read_definition(name).text.partition("=" * 80)[0]
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(text, name))
    except (RecordingError, TypesysError):
        return ""
    _, fields = store.fielddefs[name]
    match fields[0][1] if fields else None:
        case (Nodetype.NAME, type_name):
            return str(type_name)
        case (Nodetype.SEQUENCE, ((Nodetype.NAME, type_name), _)):
            return f"{type_name}[]"
    return ""


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
