"""What a character gets where its files leave it open: a height to stand at, and gains."""

from dataclasses import replace

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel, still_model
from msgs_config.character.file import CharacterFile
from msgs_config.character.joints.automatic_gains import automatic_gains, describe_weak_joints
from msgs_config.character.lowest_points import lowest_heights
from msgs_config.character.model import Character


def add_defaults(character: Character, file: CharacterFile) -> Character:
    """The character on the ground and with automatic gains, as far as its file asks for them.

    Raises:
        CharacterError: a mesh cannot be used.
    """
    floating = file.on_ground and character.layout.has_floating_base
    if not floating and not file.automatic_gains:
        return character
    model = still_model(character, np.array(character.rest_position))
    heights = lowest_heights(character, model)
    if floating:
        character = _put_on_ground(character, float(heights.min()))
    if file.automatic_gains:
        character = _add_gains(character, file, model, heights)
    return character


def _put_on_ground(character: Character, lowest: float) -> Character:
    """The character with its lowest point at z = 0; `lowest` in m is where that is."""
    if not np.isfinite(lowest):
        warning = "it has nothing to collide with: it falls through the ground"
        return replace(character, warnings=(*character.warnings, warning))
    x, y, z, *others = character.rest_position
    warning = f"it begins with its lowest point on the ground: 'root_z' is {z - lowest:.4g} m"
    return replace(
        character,
        rest_position=(x, y, z - lowest, *others),
        warnings=(*character.warnings, warning),
    )


def _add_gains(
    character: Character, file: CharacterFile, model: DynamicsModel, heights: FloatArray
) -> Character:
    """The character with gains for joints that have none; `model` is at rest, `heights` are m."""
    found = automatic_gains(character, model, file.automatic_gains, heights)
    missing = {name: gains for name, gains in found.items() if name not in file.gains}
    if not missing:
        return character
    warning = (
        f"gains of {len(missing)} joints are from the mass matrix at rest, critically damped at "
        f"{file.automatic_gains:g} Hz"
    )
    return replace(
        character,
        gains=character.gains | missing,
        warnings=(*character.warnings, warning, *describe_weak_joints(character, model)),
    )
