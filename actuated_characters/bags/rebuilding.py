"""Builds the character of a recording from the texts in it, not from today's files."""

from dataclasses import dataclass

import numpy as np

from msgs_config.character.file import (
    read_character_texts,
)
from msgs_config.character.loading import build_character
from msgs_config.character.meshes.resolving import check_collision_meshes
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.errors import ActuatedCharactersError, RecordingError
from msgs_config.messages.configuration import (
    RunConfiguration,
    UrdfCopy,
    WorldCopy,
    parse,
    parse_world,
)
from msgs_config.shared_parameters import collides, placed


@dataclass(frozen=True)
class RecordedWorld:
    """The world that a character was in."""

    namespace: str = ""  # its simulator's, without the leading slash
    name: str = ""  # the character's name in its world, where there were several
    characters: tuple[str, ...] = ()  # the names of all characters, in the order of their entry
    terrain: UrdfOptions | None = None  # what there is beside the plane

    @property
    def topics_below(self) -> str:
        """What the names of its simulator's topics begin with: empty, or with a slash."""
        return f"/{self.namespace}" if self.namespace else ""


@dataclass(frozen=True)
class Rebuilt:
    """A simulator's `~/configuration`, and the character and world that are built from it."""

    character: Character
    known: RunConfiguration
    world: RecordedWorld


def rebuild(text: str, namespace: str) -> Rebuilt:
    """Build the character that a simulator's configuration describes.

    Args:
        text: The configuration, JSON.
        namespace: Where its topics are, without the leading slash.

    Raises:
        RecordingError: the character cannot be built, or is not the one that it was.
        MessageError: the text is no configuration.
    """
    known, copy = parse(text), parse_world(text)
    try:
        character = placed(_character(known, copy), known.parameters)
        terrain = None if copy.terrain is None else _terrain(copy.terrain)
    except ActuatedCharactersError as error:
        raise RecordingError(f"cannot rebuild character {known.character}: {error}") from error
    same_joints = character.layout.joints == known.layout.joints
    if not same_joints or not np.isclose(character.mass, known.mass, rtol=1e-9):
        raise RecordingError(
            f"character {known.character} is not the one that was recorded: from the texts in its "
            f"configuration come {character.layout.size} degrees of freedom and "
            f"{character.mass:g} kg, and there were {known.layout.size} and {known.mass:g} kg"
        )
    inner = f"/{namespace}".removesuffix(f"/{copy.name}") if copy.name else f"/{namespace}"
    world = RecordedWorld(inner.removeprefix("/"), copy.name, copy.characters, terrain)
    return Rebuilt(character, known, world)


def _character(known: RunConfiguration, copy: WorldCopy) -> Character:
    """From the texts, with the meshes that lie where they lay."""
    urdf = copy.urdf
    file = read_character_texts(copy.character_path, copy.character_text, urdf.path, urdf.text)
    loaded = collides(known.parameters)
    if loaded:
        check_collision_meshes(file.loading, urdf.meshes)
    return build_character(file, loaded)


def _terrain(terrain: UrdfCopy) -> UrdfOptions:
    loading = UrdfOptions(terrain.path, terrain.text, fixed_base=True)
    check_collision_meshes(loading, terrain.meshes)
    return loading
