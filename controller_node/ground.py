"""What a controller takes for the ground."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from controller_node.references.base import Motion
from controller_node.references.steering.reference import SteeredReference
from msgs_config.arrays import FloatArray
from msgs_config.character.meshes.resolving import collision_meshes
from msgs_config.character.model import Character, Placement, Shape
from msgs_config.character.terrain import pieces_of, terrain_shapes
from msgs_config.errors import ConfigurationError
from msgs_config.settings import Settings, parameter
from msgs_config.shared_parameters import PLANE
from msgs_config.terrain.file import read_terrain
from msgs_config.terrain.heights import Heights
from msgs_config.terrain.surfaces import Surfaces

FELT = "felt"
NO_FILE = (PLANE, FELT)  # values of the parameter that name no terrain


class Terrain:
    """The ground below a character, and the surfaces that its links reach."""

    def __init__(self, character: Character, shapes: Sequence[Shape]) -> None:
        """Take a terrain's shapes. Raises CharacterError if a mesh cannot be used."""
        self.surfaces, self._heights = Surfaces(character, shapes), Heights(shapes)

    def height_below(self, place: FloatArray) -> float:
        """The height in m of the highest surface below a place (3,) in m; 0 where is none."""
        return float(np.nan_to_num(self._heights.below(place[np.newaxis]))[0])


class GroundSettings(Settings):
    """The ground that references and planners know."""

    terrain: str = parameter(
        PLANE,
        "what planner predictive, reactions to hits and a steered reference take for the ground: "
        "plane; sim_node's terrain, which `run` hands over to the former two; or, but for "
        "reactions, felt: a plane as high as the feet that stand, whatever there is",
    )


(TERRAIN,) = GroundSettings.declared()


def ground_shapes(terrain: str) -> list[Shape]:
    """The shapes of what a parameter `terrain` names; none for a plane.

    Raises:
        ActuatedCharactersError: the file cannot be used, or there is none.
    """
    return [] if terrain in NO_FILE else terrain_shapes(read_terrain(terrain, NO_FILE))


def known_terrain(terrain: str) -> str:
    """What lies on the ground that a parameter `terrain` names, see `pieces_of`; empty: no file.

    Raises:
        CharacterError: the file or a mesh cannot be used, or there is none.
    """
    if terrain in NO_FILE:
        return ""
    read = read_terrain(terrain, NO_FILE)
    return pieces_of(read, collision_meshes(read))


def check_pieces(
    own: Mapping[str, object], known: str, simulator: Mapping[str, object], pieces: str
) -> None:
    """Raise ConfigurationError if a terrain that is known has other pieces than a simulator's.

    Both have parameters, and pieces as `known_terrain` gives them.
    """
    if known != pieces:
        raise ConfigurationError(
            f"controller_node's '{TERRAIN.name}' is {own[TERRAIN.name]}, and sim_node's, "
            f"{simulator.get(TERRAIN.name)}, has other pieces; they must be the same"
        )


def check_placement(character: Character) -> None:
    """Raise ConfigurationError if a character's own world is not where the terrain's is."""
    if character.placement != Placement():
        raise ConfigurationError(
            f"parameter 'placement' is not 0; a controller that knows '{TERRAIN.name}' has the "
            "character's own world where the terrain's is"
        )


def on_ground(motion: Motion, character: Character, terrain: str) -> Motion:
    """A motion whose feet find their places on what a parameter `terrain` names, if it is steered.

    Raises:
        CharacterError: the file cannot be used.
        ConfigurationError: the character's own world is not where the terrain's is.
    """
    steered = motion.reference
    if terrain == PLANE or not isinstance(steered, SteeredReference):
        return motion
    if shapes := ground_shapes(terrain):
        check_placement(character)
    return replace(motion, reference=steered.over(Heights(shapes) if shapes else None))
