"""The JSON of `~/configuration`: all that a run depends on, so that a bag can repeat it."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout, JointType
from msgs_config.character.meshes.resolving import collision_meshes
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.errors import LayoutError, MessageError
from msgs_config.messages.probe import DynamicsSample, read_probe
from msgs_config.messages.session import ANONYMOUS, SESSION, read_session
from msgs_config.parameters import Value, Values
from msgs_config.versions import installed_versions, read_versions

_CHARACTER = ("urdf", "urdf_path", "meshes")  # keys of a URDF's text, path and meshes
SINCE = "parameters_after_stamp_ns"
"""The key of the stamp of the last state before the parameters were in force; null at first."""
FILES = "files"
"""The key of SHA-256 of the files that a controller has read, by the parameters' names for them."""
_TERRAIN = ("terrain_urdf", "terrain_path", "terrain_meshes")
_WRONG = (ValueError, KeyError, TypeError, AttributeError, RecursionError)


def describe(
    character: Character,
    values: Values,
    since_ns: int | None = None,
    probe: DynamicsSample | None = None,
    terrain: UrdfOptions | None = None,
    actuation: Mapping[str, int | bool] | None = None,
    files: Mapping[str, str] | None = None,
    name: str = "",
    characters: Sequence[str] = (),
    session: str = ANONYMOUS,
) -> str:
    """The JSON text: the character with its files, the parameters in force, and the versions.

    `since_ns` is the stamp of the last state with other parameters; `probe` and `terrain` are a
    simulator's, `actuation` a controller's, and so are `files`, SHA-256 of what it has read by the
    parameters' names for it. `name` is the character's among several, `characters` in their
    world's order. `session`, the simulator's, is no parameter here.

    Raises:
        CharacterError: a mesh of the character or of the terrain cannot be read.
    """
    content = {
        "character": character.name,
        "character_file": character.file_text,
        "character_path": str(character.file),
        **_describe_urdf(_CHARACTER, character.loading),
        "session": session,
        "name": name,
        "characters": list(characters),
        "joints": [{"name": j.name, "type": j.type.value} for j in character.layout.joints],
        "followers": sorted(character.layout.followers),
        "effort_limits": [_finite(limit) for limit in character.effort_limits().tolist()],
        "mass": character.mass,
        **_describe_urdf(_TERRAIN, terrain),
        "probe": None if probe is None else probe.content(),
        "actuation": None if actuation is None else dict(actuation),
        FILES: dict(files or {}),
        SINCE: since_ns,
        "parameters": {key: _finite(values[key]) for key in values if key != SESSION.name},
        "versions": installed_versions(),
    }
    return json.dumps(content, allow_nan=False)


def _describe_urdf(keys: tuple[str, str, str], urdf: UrdfOptions | None) -> dict[str, Any]:
    """The text of a URDF, its path and the hashes of its meshes, under these keys."""
    text, path, meshes = keys
    if urdf is None:
        return {text: None, path: None, meshes: {}}
    return {text: urdf.urdf_text, path: str(urdf.urdf_path), meshes: collision_meshes(urdf)}


def _finite(value: Value) -> Value | None:
    """The value as JSON can express it: no limit is null, not infinity."""
    return None if isinstance(value, float) and math.isinf(value) else value


@dataclass(frozen=True)
class UrdfCopy:
    """A URDF as it was read, and where it lay, which is where its meshes are looked for."""

    path: Path
    text: str = field(repr=False)
    meshes: dict[str, str]  # SHA-256 by the name that the URDF gives, see `collision_meshes`


@dataclass(frozen=True)
class RunConfiguration:
    """The content that a listener needs to read a simulator's topics."""

    character: str
    layout: JointLayout
    effort_limits: FloatArray  # (b,) N m or N
    mass: float  # kg
    parameters: dict[str, Any]
    probe: DynamicsSample | None = None  # absent from other simulators
    versions: dict[str, str] = field(default_factory=dict)  # versions of packages by their names
    session: str = ANONYMOUS
    terrain: UrdfCopy | None = None  # beside or in place of the plane


def parse(text: str) -> RunConfiguration:
    """Read a simulator's `~/configuration`.

    Raises:
        MessageError: the text is not one.
    """
    try:
        content = json.loads(text)
        joints = [(joint["name"], JointType(joint["type"])) for joint in content["joints"]]
        followers = [str(name) for name in content.get("followers", ())]
        layout, probe = JointLayout(joints, followers), content.get("probe")
        return RunConfiguration(
            character=str(content["character"]),
            layout=layout,
            effort_limits=np.array(
                [np.inf if limit is None else limit for limit in content["effort_limits"]]
            ),
            mass=float(content["mass"]),
            parameters=dict(content["parameters"]),
            probe=None if probe is None else read_probe(probe, layout.size),
            versions=read_versions(content.get("versions")),
            session=read_session(str(content.get("session", ""))),
            terrain=_read_terrain(content),
        )
    except (*_WRONG, OverflowError, LayoutError) as error:
        raise MessageError("not a simulator's configuration") from error


@dataclass(frozen=True)
class WorldCopy:
    """The files that a simulator has read, and the character's place in its world."""

    character_path: Path
    character_text: str = field(repr=False)  # its YAML file's text; empty for a URDF alone
    urdf: UrdfCopy
    terrain: UrdfCopy | None
    name: str  # the character's, where it is one of several; else empty
    characters: tuple[str, ...]  # names in the order of entering the world; empty for one character


def parse_world(text: str) -> WorldCopy:
    """Read the files of a simulator from its `~/configuration`.

    Raises:
        MessageError: the text is not one.
    """
    try:
        content = json.loads(text)
        return WorldCopy(
            character_path=Path(str(content["character_path"])),
            character_text=str(content["character_file"]),
            urdf=_read_urdf(content, _CHARACTER),
            terrain=_read_terrain(content),
            name=str(content.get("name", "")),
            characters=tuple(str(name) for name in content.get("characters", ())),
        )
    except _WRONG as error:
        raise MessageError("not a simulator's configuration") from error


def _read_terrain(content: dict[str, Any]) -> UrdfCopy | None:
    return None if content.get(_TERRAIN[0]) is None else _read_urdf(content, _TERRAIN)


def _read_urdf(content: dict[str, Any], keys: tuple[str, str, str]) -> UrdfCopy:
    text, path, meshes = keys
    hashes = {str(name): str(digest) for name, digest in content.get(meshes, {}).items()}
    return UrdfCopy(Path(str(content[path])), str(content[text]), hashes)
