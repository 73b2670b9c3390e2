"""Whether a character fell: measured on its body, never on what is judged.

A reference that follows the state says nothing about a fall; nor does a law that goes on acting.
"""

import math
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.lowest_points import lowest_heights
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.errors import CharacterError
from msgs_config.geometry import elementary, fixed_order, rotations
from msgs_config.geometry.scalars import Vector, exp, rotate
from sim_node.physics.ground import Ground

FALLEN_HEIGHT = 0.5
"""Share of the standing height below which a centre of mass is down."""

FALLEN_TILT = math.radians(60.0)
"""Angle in rad of the base's upward axis from where it should point, beyond which it is down."""

FALLEN_TIME = 0.3
"""How long a character is down without a break until it fell, s."""

_UP = np.array((0.0, 0.0, 1.0))


class PostureSeries(NamedTuple):
    """How high and how upright a body is, in each of r states."""

    height: FloatArray  # (r,) m from the ground to the centre of mass
    up: FloatArray  # (r, 3) unit vectors in the world: the base's axis that points up at rest


class PostureReader:
    """Reads how high and how upright a character is over its ground."""

    def __init__(self, character: Character, terrain: UrdfOptions | None = None) -> None:
        """For a character whose base floats; without `terrain` the ground is the plane z = 0.

        Raises:
            CharacterError: the base is fixed, or the terrain cannot be loaded.
        """
        if not character.layout.has_floating_base:
            raise CharacterError(f"character '{character.name}' has a fixed base; it cannot fall")
        self._model = DynamicsModel(character)
        self._ground = None if terrain is None else Ground(terrain)
        rest = np.array(character.rest_position)
        upright = rotations.exp(rest[3:6])
        self._up_in_base: Vector = tuple(
            rotations.rotate(rotations.conjugate(upright), _UP).tolist()
        )
        self.standing_height = self._standing_height(character, rest)
        """Of the centre of mass above the lowest point of the character at rest, m."""

    def _standing_height(self, character: Character, rest: FloatArray) -> float:
        centre = float(self._model.centre_of_mass_at(rest)[2])
        try:
            lowest = float(lowest_heights(character, self._model).min(initial=np.inf))
        except CharacterError:  # raised for a mesh that is no longer there
            lowest = math.inf
        return centre - (lowest if math.isfinite(lowest) else character.placement.z)

    def read(self, positions: FloatArray) -> PostureSeries:
        """The postures at positions (r, n), message form; NaN where a position is."""
        heights = np.full(len(positions), np.nan)
        up = np.full((len(positions), 3), np.nan)
        for row, position in enumerate(positions):
            turn: Vector = tuple(position[3:6].tolist())
            if turn[0] == turn[0]:
                centre = self._model.centre_of_mass_at(position)
                ground = self._ground
                below = 0.0 if ground is None else ground.heights_below(centre[np.newaxis])[0]
                heights[row] = centre[2] - below
                up[row] = rotate(exp(turn), self._up_in_base)
        return PostureSeries(heights, up)


def tilts(up: FloatArray, desired: FloatArray) -> FloatArray:
    """Angle (r,) in rad between upward axes (r, 3) and desired ones; NaN: the vertical is."""
    wanted = np.where(np.isnan(desired), _UP, desired)
    return elementary.arccos(np.clip(fixed_order.dot(up, wanted), -1.0, 1.0))


def is_down(body: PostureSeries, desired: PostureSeries, standing_height: float) -> BoolArray:
    """Where (r,) a body is down, as a body on its own ground; it has fallen if that lasts.

    It is down where its centre of mass is below half of what it should be, or its base's upward
    axis more than 60 degrees from where it should point. It should be at its standing height, m,
    and upright; a desired posture, NaN where there is none, may ask for less: to lie, to crawl, to
    roll, to be upside down. It must come from a reference that does not follow the state.
    """
    wanted = np.fmin(desired.height, standing_height)
    low = body.height < FALLEN_HEIGHT * wanted
    down: BoolArray = low | (tilts(body.up, desired.up) > FALLEN_TILT)
    return down


def fall_row(down: BoolArray, ticks: FloatArray, rate_hz: float) -> int | None:
    """The first row of those (r,) of a fall: down for `FALLEN_TIME` on end; None without a fall.

    `ticks` (r,) are the rows' numbers at a rate of `rate_hz`; a tick that is left out, as between
    two episodes, is a break.
    """
    follows = np.zeros(len(down), dtype=np.bool_)  # whether the row before was down
    follows[1:] = down[1:] & down[:-1] & (np.diff(ticks) == 1)
    starts = np.flatnonzero(down & ~follows)
    ends = np.flatnonzero(down & ~np.append(follows[1:], False))
    lasting = np.flatnonzero(ends - starts + 1 >= math.ceil(FALLEN_TIME * rate_hz))
    return int(starts[lasting[0]]) if len(lasting) else None


def reader_for(character: Character, terrain: UrdfOptions | None = None) -> PostureReader | None:
    """The reader of a character's postures; None for a fixed base, which cannot fall.

    Raises:
        CharacterError: the terrain cannot be loaded.
    """
    return PostureReader(character, terrain) if character.layout.has_floating_base else None


class FallWatch:
    """Watches a body tick by tick, where a run should end as soon as it fell."""

    def __init__(self, reader: PostureReader, rate_hz: float) -> None:
        self._reader = reader
        self._least = math.ceil(FALLEN_TIME * rate_hz)
        self.ticks_down = 0
        """For how many ticks it has been down, until now."""

    def has_fallen(self, position: FloatArray, desired: FloatArray | None = None) -> bool:
        """Look at the next tick's position (n,), and a desired one that does not follow it."""
        reader = self._reader
        wanted = np.full_like(position, np.nan) if desired is None else desired
        height, up = reader.read(np.stack((position, wanted)))
        body, reference = PostureSeries(height[:1], up[:1]), PostureSeries(height[1:], up[1:])
        down = bool(is_down(body, reference, reader.standing_height)[0])
        self.ticks_down = self.ticks_down + 1 if down else 0
        return self.ticks_down >= self._least
