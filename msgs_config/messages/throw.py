"""A ball or a box that is thrown: its numbers, by name, and which can be. No ROS in here."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, isfinite, pi, pow, sin

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Quaternion, Shape, ShapeType, Vector
from msgs_config.errors import CommandError, one_of
from msgs_config.geometry import fixed_order

MASS, RADIUS, YAW = "mass", "radius", "yaw"
SIZE = ("size_x", "size_y", "size_z")
POSITION = ("x", "y", "z")
VELOCITY = ("vx", "vy", "vz")
NUMBERS = (MASS, RADIUS, *POSITION, *VELOCITY)
"""The numbers of a ball's throw, in kg, m and m/s, world axes."""
BOX_NUMBERS = (MASS, *SIZE, *POSITION, *VELOCITY, YAW)
"""The numbers of a box's throw, in kg, m, m/s and rad; its edges are in its own axes."""

DENSITY = 500.0  # kg/m^3, of what has no size given: a light wood
_BOUNDS = {MASS: (1e-3, 1e4), RADIUS: (5e-3, 5.0), **dict.fromkeys(SIZE, (1e-2, 10.0))}
_MAX_SPEED = 1000.0  # m/s
_MAX_COORDINATE = 1e6  # m


@dataclass(frozen=True)
class ProjectileThrow:
    """A solid ball or box, and how it moves when it is let go; it does not turn then."""

    mass: float  # kg
    radius: float | None  # m; None: a box
    position: tuple[float, float, float]  # m, world, of its centre
    velocity: tuple[float, float, float]  # m/s, world
    size: tuple[float, float, float] | None = None  # m: the edges of a box
    yaw: float = 0.0  # rad about z: how a box is turned

    def __post_init__(self) -> None:
        if (self.radius is None) == (self.size is None):
            raise CommandError("there must be the radius of a ball, or the size of a box")
        for what in ("position", "velocity", "size"):
            vector = getattr(self, what)
            if vector is not None and len(vector) != len(POSITION):
                raise CommandError(f"the {what} is {vector}; it must be three numbers")
        for name, value in zip(self.names, self.numbers().tolist(), strict=True):
            if not isfinite(value):
                raise CommandError(f"{name} is {value}; it must be finite")
            least, most = _BOUNDS.get(name, (value, value))
            if not least <= value <= most:
                raise CommandError(f"{name} is {value:g}; it must be {least:g} to {most:g}")
        speed = float(fixed_order.norm(np.array(self.velocity)))
        if speed > _MAX_SPEED:
            raise CommandError(f"its speed is {speed:g} m/s; it must be at most {_MAX_SPEED:g} m/s")
        if max(map(abs, self.position)) > _MAX_COORDINATE:
            raise CommandError(
                f"its place is {self.position}; no coordinate may be beyond {_MAX_COORDINATE:g} m"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its numbers."""
        return NUMBERS if self.size is None else BOX_NUMBERS

    def numbers(self) -> FloatArray:
        """Its numbers, in the order of `names`."""
        if self.size is None:
            return np.array((self.mass, self.radius, *self.position, *self.velocity))
        return np.array((self.mass, *self.size, *self.position, *self.velocity, self.yaw))

    @property
    def shape(self) -> Shape:
        """What it looks like, and is touched as, about its centre."""
        if self.size is not None:
            return Shape(ShapeType.BOX, tuple(self.size))
        assert self.radius is not None
        return Shape(ShapeType.SPHERE, (self.radius,))

    @property
    def half_edges(self) -> Vector:
        """From its centre to its sides, m."""
        if self.size is not None:
            x, y, z = self.size
            return 0.5 * x, 0.5 * y, 0.5 * z
        assert self.radius is not None
        return (self.radius,) * 3

    @property
    def reach(self) -> float:
        """As far as this from its centre it reaches, m."""
        return self.radius or float(fixed_order.norm(np.array(self.half_edges)))

    @property
    def turn_xyzw(self) -> Quaternion:
        """Its orientation when it is let go."""
        return 0.0, 0.0, sin(0.5 * self.yaw), cos(0.5 * self.yaw)

    def describe(self) -> str:
        """What it is and how large, in a few words."""
        if self.size is None:
            return f"a ball with a radius of {self.radius:.3g} m"
        return f"a box of {self.describe_size()}"

    def describe_size(self) -> str:
        """Its size in a few words."""
        if self.size is None:
            return f"radius {self.radius:.3g} m"
        return " x ".join(f"{edge:.3g}" for edge in self.size) + " m"


def parse_throw(names: Sequence[str], values: Sequence[float]) -> ProjectileThrow:
    """The throw that numbers with names describe: a box's if there are edges, else a ball's.

    A ball without a radius has that of `DENSITY`, a box without `YAW` is not turned.

    Raises:
        CommandError: a name is unknown, twice or missing, or a number cannot be.
    """
    is_box = not set(SIZE).isdisjoint(names)
    numbers, optional = (BOX_NUMBERS, YAW) if is_box else (NUMBERS, RADIUS)
    for name in names:
        if name not in numbers:
            raise CommandError(one_of("number", name, list(numbers)))
        if list(names).count(name) > 1:
            raise CommandError(f"'{name}' twice")
    if len(names) != len(values):
        raise CommandError(f"{len(names)} names but {len(values)} numbers")
    given = dict(zip(names, map(float, values), strict=True))
    for name in numbers:
        if name not in given and name != optional:
            raise CommandError(f"'{name}' is missing; there must be {', '.join(numbers)}")
    mass = given[MASS]
    x, y, z, vx, vy, vz = (given[name] for name in (*POSITION, *VELOCITY))
    if is_box:
        a, b, c = (given[name] for name in SIZE)
        yaw = given.get(YAW, 0.0)
        return ProjectileThrow(mass, None, (x, y, z), (vx, vy, vz), (a, b, c), yaw)
    return ProjectileThrow(mass, given.get(RADIUS, natural_radius(mass)), (x, y, z), (vx, vy, vz))


def natural_radius(mass: float) -> float:
    """The radius in m of a ball of a mass in kg that has `DENSITY`; 0 of what is no mass."""
    return pow(3.0 * max(mass, 0.0) / (4.0 * pi * DENSITY), 1.0 / 3.0)


def natural_edge(mass: float) -> float:
    """The edge in m of a cube of a mass in kg that has `DENSITY`; 0 of what is no mass."""
    return pow(max(mass, 0.0) / DENSITY, 1.0 / 3.0)
