"""How low the links of a character are: what stands on the ground, or is below it."""

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel, still_model
from msgs_config.character.extents import farthest
from msgs_config.character.model import Character

_HARMLESS_DEPTH = 0.05  # m; motion capture puts feet that deep into the ground
_TOUCHING_DEPTH = 0.001  # m that a link which rests on the ground may be in it
_DOWN = np.array((0.0, 0.0, -1.0))


def lowest_heights(character: Character, model: DynamicsModel) -> FloatArray:
    """Height z (links,) in m of the lowest point that each link collides with.

    It is infinite for a link that collides with nothing.

    Args:
        character: The character.
        model: Its model, in the state that is asked about.

    Raises:
        CharacterError: a mesh cannot be used.
    """
    origins, turns_xyzw = model.link_poses()
    return np.array(
        [
            z
            - max((farthest(each, turn, _DOWN) for each in link.collision_shapes), default=-np.inf)
            for link, z, turn in zip(character.links, origins[:, 2], turns_xyzw, strict=True)
        ]
    )


def links_in_ground(character: Character) -> dict[str, float]:
    """How deep (m) the moving links of a fixed base are in the ground at the rest pose.

    Raises:
        CharacterError: a mesh cannot be used.
    """
    if character.layout.has_floating_base:
        return {}
    heights = lowest_heights(character, still_model(character, np.array(character.rest_position)))
    links = zip(character.links[1:], heights[1:].tolist(), strict=True)
    return {link.name: -height for link, height in links if height < -_TOUCHING_DEPTH}


def describe_start_below_ground(character: Character, position: FloatArray) -> tuple[str, ...]:
    """A warning if a floating character begins deeper in the ground than contacts allow.

    Args:
        character: The character.
        position: The position (n,) that it begins in, message form.

    Raises:
        CharacterError: a mesh cannot be used.
    """
    if not character.layout.has_floating_base:
        return ()
    heights = lowest_heights(character, still_model(character, position))
    deepest = int(np.argmin(heights))
    if heights[deepest] >= -_HARMLESS_DEPTH:
        return ()
    return (
        f"it begins below the ground: link '{character.links[deepest].name}' is "
        f"{-heights[deepest]:.3g} m deep, and the engine throws it out; raise 'root_z' in "
        f"'initial_position' or 'rest_pose' by as much, or set 'terrain' to none",
    )
