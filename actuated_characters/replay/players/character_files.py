"""A recorded character as files again, for nodes that load it by its path."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from controller_node.ground import NO_FILE, TERRAIN
from msgs_config import files
from msgs_config.character.file import ALONE
from msgs_config.character.layout import JointType
from msgs_config.character.meshes.resolving import resolve_meshes
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.errors import CharacterError
from msgs_config.shared_parameters import PLANE

_NO_LIMIT = 1e300  # N m or N; a file cannot say infinity


def write_character(directory: Path, character: Character, *, lift_limits: bool = False) -> Path:
    """Write a character's YAML file and URDF from its texts; the YAML file's path.

    Meshes and clips are named by absolute paths, as they are found from where the files stood.
    With `lift_limits` no effort is clipped.

    Raises:
        CharacterError: a mesh does not exist any more.
    """
    urdf = write_urdf(directory / f"{character.name}.urdf", character.loading)
    content = _content(character)
    content["urdf"] = urdf.name
    if lift_limits:
        content["joints"] = _without_limits(character, content.get("joints") or {})
    file = directory / f"{character.name}.yaml"
    file.write_text(files.dump_yaml(content), encoding="utf-8")
    return file


def write_urdf(file: Path, loading: UrdfOptions) -> Path:
    """Write a URDF from its text, its meshes named by absolute paths; the file.

    Raises:
        CharacterError: a mesh does not exist any more.
    """
    robot = resolve_meshes(loading).robot
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(ElementTree.tostring(robot, encoding="utf-8"))
    return file


def write_terrain(directory: Path, terrain: UrdfOptions | None) -> dict[str, str]:
    """The parameter of a node that has a recorded terrain from a file; none without terrain.

    Raises:
        CharacterError: a mesh does not exist any more.
    """
    if terrain is None:
        return {}
    return {TERRAIN.name: str(write_urdf(directory / "terrain.urdf", terrain))}


def write_known_terrain(
    directory: Path, terrain: UrdfOptions | None, parameters: Mapping[str, object]
) -> dict[str, str]:
    """The same for a controller, which may know none: by its recorded parameters.

    Raises:
        CharacterError: a mesh does not exist any more.
    """
    knows = parameters.get(TERRAIN.name, PLANE) not in NO_FILE
    return write_terrain(directory, terrain) if knows else {}


def _content(character: Character) -> dict[str, Any]:
    """The content of the character's file, or what a URDF alone stands for."""
    if not character.file_text:
        return dict(ALONE)
    content = files.parse_yaml_mapping(character.file, character.file_text, CharacterError)
    if character.clips.pattern:
        content["clips"] = {**content["clips"], "files": character.clips.pattern}
    return content


def _without_limits(character: Character, joints: dict[str, Any]) -> dict[str, Any]:
    names = [
        joint.name for joint in character.moving_joints if joint.type is not JointType.FLOATING
    ]
    lifted = {name: {**(joints.get(name) or {}), "effort_limit": _NO_LIMIT} for name in names}
    return {**joints, **lifted}
