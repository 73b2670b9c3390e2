"""Colours of skins: a pair for each of several characters, one for its right side."""

import re
from collections.abc import Sequence

import numpy as np

from actuated_characters.bags.rebuilding import RecordedWorld
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character, Quadruple
from msgs_config.geometry import elementary

# None is near the red of a joint at its limit, nor the green of a reference.
_PAIRS: tuple[tuple[Quadruple, Quadruple], ...] = (
    ((0.87, 0.83, 0.76, 1.0), (0.47, 0.54, 0.64, 1.0)),
    ((0.34, 0.53, 0.72, 1.0), (0.17, 0.29, 0.44, 1.0)),
    ((0.93, 0.76, 0.38, 1.0), (0.62, 0.47, 0.20, 1.0)),
    ((0.66, 0.58, 0.78, 1.0), (0.41, 0.33, 0.55, 1.0)),
    ((0.42, 0.44, 0.47, 1.0), (0.20, 0.21, 0.24, 1.0)),
    ((0.62, 0.50, 0.41, 1.0), (0.40, 0.30, 0.23, 1.0)),
)
_NUMBERED = re.compile(r"_[0-9]+$")
_MIDDLE = 0.02  # m: a link that is no farther to the right is of the trunk


def team_numbers(names: Sequence[str]) -> list[int]:
    """The numbers, for `skin_colors`, of characters of these names.

    Names that differ in a number at their end are of one team, which has one number.
    """
    teams = [_NUMBERED.sub("", name) for name in names]
    found = list(dict.fromkeys(teams))
    return [found.index(team) for team in teams]


def color_number(world: RecordedWorld, alone: int) -> int:
    """The number, for `skin_colors`, that a character has wherever it is seen.

    It is its team's in its world, whichever characters of it are shown; or `alone`, if it has its
    world for itself.
    """
    if world.name not in world.characters:
        return alone
    return team_numbers(world.characters)[world.characters.index(world.name)]


def skin_colors(character: Character, number: int = 0) -> list[Quadruple]:
    """The colours rgba of the links (l,) of one character among several, by its number."""
    plain, right = _PAIRS[number % len(_PAIRS)]
    model, rest = DynamicsModel(character), np.array(character.rest_position)
    model.update(rest, np.zeros_like(rest))
    ways = model.link_poses()[0] - rest[:3]
    yaw = np.array(character.placement.yaw)
    leftwards = ways[:, 1] * elementary.cos(yaw) - ways[:, 0] * elementary.sin(yaw)
    return [right if left < -_MIDDLE else plain for left in leftwards.tolist()]
