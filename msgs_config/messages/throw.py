"""A ball that is thrown: its numbers, by name, and which of them can be. No ROS in here."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, pi, pow

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.errors import CommandError, one_of
from msgs_config.geometry import fixed_order

MASS, RADIUS = "mass", "radius"
POSITION = ("x", "y", "z")
VELOCITY = ("vx", "vy", "vz")
NUMBERS = (MASS, RADIUS, *POSITION, *VELOCITY)
"""The numbers of a throw, in kg, m and m/s, world axes."""

DENSITY = 500.0  # kg/m^3, of a ball whose radius is not given: a light wood
_BOUNDS = {MASS: (1e-3, 1e4), RADIUS: (5e-3, 5.0)}
_MAX_SPEED = 1000.0  # m/s
_MAX_COORDINATE = 1e6  # m


@dataclass(frozen=True)
class ProjectileThrow:
    """A solid ball, and how it moves when it is let go; it does not turn then."""

    mass: float  # kg
    radius: float  # m
    position: tuple[float, float, float]  # m, world, of its centre
    velocity: tuple[float, float, float]  # m/s, world

    def __post_init__(self) -> None:
        for what, vector in (("position", self.position), ("velocity", self.velocity)):
            if len(vector) != len(POSITION):
                raise CommandError(f"the {what} is {vector}; it must be three numbers")
        for name, value in zip(NUMBERS, self.numbers().tolist(), strict=True):
            if not isfinite(value):
                raise CommandError(f"{name} is {value}; it must be finite")
        for name, (least, most) in _BOUNDS.items():
            value = getattr(self, name)
            if not least <= value <= most:
                raise CommandError(f"{name} is {value:g}; it must be {least:g} to {most:g}")
        speed = float(fixed_order.norm(np.array(self.velocity)))
        if speed > _MAX_SPEED:
            raise CommandError(f"its speed is {speed:g} m/s; it must be at most {_MAX_SPEED:g} m/s")
        if max(map(abs, self.position)) > _MAX_COORDINATE:
            raise CommandError(
                f"its place is {self.position}; no coordinate may be beyond {_MAX_COORDINATE:g} m"
            )

    def numbers(self) -> FloatArray:
        """Its numbers (8,), in the order of `NUMBERS`."""
        return np.array((self.mass, self.radius, *self.position, *self.velocity))


def parse_throw(names: Sequence[str], values: Sequence[float]) -> ProjectileThrow:
    """The throw that numbers with names describe; without a radius it has that of `DENSITY`.

    Raises:
        CommandError: a name is unknown, twice or missing, or a number cannot be.
    """
    for name in names:
        if name not in NUMBERS:
            raise CommandError(one_of("number", name, list(NUMBERS)))
        if list(names).count(name) > 1:
            raise CommandError(f"'{name}' twice")
    if len(names) != len(values):
        raise CommandError(f"{len(names)} names but {len(values)} numbers")
    given = dict(zip(names, map(float, values), strict=True))
    for name in NUMBERS:
        if name not in given and name != RADIUS:
            raise CommandError(f"'{name}' is missing; there must be {', '.join(NUMBERS)}")
    mass = given[MASS]
    x, y, z, vx, vy, vz = (given[name] for name in (*POSITION, *VELOCITY))
    return ProjectileThrow(mass, given.get(RADIUS, natural_radius(mass)), (x, y, z), (vx, vy, vz))


def natural_radius(mass: float) -> float:
    """The radius in m of a ball of a mass in kg that has `DENSITY`; 0 of what is no mass."""
    return pow(3.0 * max(mass, 0.0) / (4.0 * pi * DENSITY), 1.0 / 3.0)
