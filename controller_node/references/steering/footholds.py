"""Where feet find even ground, near to where they are wanted."""

import cmath
import math
from dataclasses import replace
from typing import Protocol

import numpy as np

from controller_node.references.steering.course import Footprint
from controller_node.references.steering.gait import rest_pose
from controller_node.references.steering.legs import Legs
from msgs_config.arrays import FloatArray
from msgs_config.character.extents import farthest
from msgs_config.character.model import Character
from msgs_config.geometry import fixed_order

_MARGIN, _BEHIND = 0.02, 0.04  # m of even ground around a sole, and behind it
_LENGTHS, _WIDTHS = 7, 3  # places that are looked at below a sole: so many along, so many across
_GRID, _TURN = 0.01, 0.02  # m and rad: prints nearer to each other than this are one
_STEP, _STEPS = 0.02, 10  # m from one print that is tried to the next, and how many to each side
_EVEN = 0.005  # m
_WAY = 20.0  # m that it goes out of its way for each m of unevenness
_STEEPEST = 0.6  # m a m, on which a foot stands
_REMEMBERED = 256


class Ground(Protocol):
    """Surfaces on which feet can stand."""

    def at(self, places: FloatArray) -> FloatArray:
        """The height z (r,) in m of the highest one at places (r, 2) in m; NaN where is none."""
        ...


class Footholds:
    """The ground as a character's feet see it; it remembers where they were wanted of late."""

    def __init__(self, character: Character, ground: Ground) -> None:
        self._ground, self._soles = ground, _soles(character)
        self._known: dict[tuple[int, Footprint], Footprint] = {}

    def __getstate__(self) -> dict[str, object]:
        """All but what is remembered, which is found again."""
        return vars(self) | {"_known": {}}

    def nearest(self, foot: int, wanted: Footprint) -> Footprint:
        """The nearest print ahead or behind where a foot, by its number, stands evenly.

        Where there is none, the least uneven one; with the height and slope of its ground.
        """
        x, y = round(wanted.place.real / _GRID), round(wanted.place.imag / _GRID)
        rounded = Footprint(_GRID * complex(x, y), _TURN * round(wanted.heading / _TURN))
        if (foot, rounded) not in self._known:
            if len(self._known) > _REMEMBERED:
                self._known.clear()
            self._known[foot, rounded] = self._nearest(foot, rounded)
        return self._known[foot, rounded]

    def _nearest(self, foot: int, wanted: Footprint) -> Footprint:
        least, best = math.inf, wanted
        ahead = cmath.rect(_STEP, wanted.heading)
        for step in sorted(range(-_STEPS, _STEPS + 1), key=abs):
            if _STEP * abs(step) >= least:
                break
            place = wanted.place + step * ahead
            unevenness, found = self._standing(foot, replace(wanted, place=place))
            cost = _STEP * abs(step) + _WAY * max(unevenness - _EVEN, 0.0)
            if cost < least:
                least, best = cost, found
        return best

    def _standing(self, foot: int, wanted: Footprint) -> tuple[float, Footprint]:
        """How far the ground below a sole is off a plane, m, and the print on that plane.

        The plane is that of least squares (the places below a sole are a regular grid). Where the
        ground is no plane, the foot stands level on its highest place; without ground below all of
        the sole the print is the wanted one.
        """
        sole, heading = self._soles[foot], cmath.rect(1.0, wanted.heading)
        places = wanted.place + heading * sole
        heights = self._ground.at(np.column_stack((places.real, places.imag)))
        if np.isnan(heights).any():
            return math.inf, wanted
        middle = fixed_order.mean(sole.real), fixed_order.mean(sole.imag)
        mean = fixed_order.mean(heights)
        along, across, up = sole.real - middle[0], sole.imag - middle[1], heights - mean
        rise = fixed_order.dot(along, up) / fixed_order.dot(along, along)
        bank = fixed_order.dot(across, up) / fixed_order.dot(across, across)
        unevenness = float(np.abs(up - rise * along - bank * across).max())
        slope = complex(float(rise), float(bank))
        if unevenness > _EVEN or abs(slope) > _STEEPEST:
            return unevenness + abs(slope), replace(wanted, height=float(heights.max()))
        height = float(mean - rise * middle[0] - bank * middle[1])
        return unevenness, replace(wanted, height=height, slope=heading * slope)


def _soles(character: Character) -> list[FloatArray]:
    """Places below each foot as it rests, in its print's frame: m ahead + 1j m to the left."""
    links = {link.name: link for link in character.links}
    turns = Legs(character).feet(rest_pose(character)).orientations_xyzw
    soles = []
    for name, turn in zip(character.feet, turns, strict=True):
        back, ahead, right, left = (
            margin
            + max(
                (farthest(each, turn, np.array(way)) for each in links[name].collision_shapes),
                default=0.0,
            )
            for margin, *way in (
                (_BEHIND, -1.0, 0.0, 0.0),
                (_MARGIN, 1.0, 0.0, 0.0),
                (_MARGIN, 0.0, -1.0, 0.0),
                (_MARGIN, 0.0, 1.0, 0.0),
            )
        )
        along = -back + (ahead + back) * np.arange(_LENGTHS) / (_LENGTHS - 1)
        across = -right + (left + right) * np.arange(_WIDTHS) / (_WIDTHS - 1)
        soles.append((along[:, np.newaxis] + 1j * across).ravel())
    return soles
