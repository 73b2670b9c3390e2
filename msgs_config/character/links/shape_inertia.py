"""Moments of inertia from the shapes that a link collides with, as Bullet has them.

They are a box's, except for a sphere that is alone: the shape's own box, the box round it, or that
round several shapes, with Bullet's margins wherever it adds them.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from msgs_config.character.links.transforms import (
    IDENTITY,
    Transform,
    compose,
    inverse,
    read_transform,
)
from msgs_config.character.meshes.bounds import Bounds, bounds_of_parts
from msgs_config.character.model import ShapeType, UrdfOptions, Vector
from msgs_config.geometry.scalars import add, scale, subtract, to_parent

_MARGIN = 0.001  # m, of every shape in the end
_FIRST_MARGIN = 0.04  # m, of a box at first
_MARGIN_SHARE = 0.10000000149011612  # of half a box's shortest edge: 0.1 in single precision
_TWELFTH = 0.08333333  # as Bullet writes it for hulls and capsules
_QUANTA = 10216  # steps along each axis, on which the vertices of a hull lie
_LEAST_STEP = 1e-300  # m, of which the inverse is a number
_ORIGIN = (0.0, 0.0, 0.0)


class _Solid(NamedTuple):
    """A shape."""

    bounds: Callable[[Transform], Bounds]
    """Of its place in a frame: two corners of the box round it, m, along that frame's axes."""
    moments: Callable[[float], Vector]
    """Of its mass, kg: its moments of inertia where it is alone, kg m^2."""


def moments_of_shapes(
    link: ElementTree.Element, mass: float, frame: Transform, loading: UrdfOptions
) -> Vector:
    """Moments of inertia, kg m^2, of a link of a mass, kg, about the axes of its inertial frame.

    Raises:
        CharacterError: a mesh cannot be used.
    """
    if mass == 0.0:
        return _ORIGIN
    to_frame = inverse(frame)
    placed = [
        (compose(to_frame, read_transform(part, loading.scale)), _read_solid(part, loading.scale))
        for part in (link.findall("collision") if loading.collisions else ())
    ]
    alone = len(placed) == 1 and placed[0][0] == IDENTITY
    moments = (placed[0][1] if alone else _together(placed)).moments(mass)
    scaling = link.find("contact/inertia_scaling")
    return moments if scaling is None else scale(float(scaling.get("value", "1")), moments)


def _read_solid(part: ElementTree.Element, lengths: float) -> _Solid:
    """The shape of a `<collision>`, all lengths multiplied."""
    (shape,) = part.findall("geometry/*")

    def size(name: str, default: str = "") -> list[float]:
        return [lengths * float(piece) for piece in shape.get(name, default).split()]

    match ShapeType(shape.tag):
        case ShapeType.SPHERE:
            return _sphere(*size("radius"))
        case ShapeType.BOX:
            return _box(size("size"))
        case ShapeType.MESH:
            parts = bounds_of_parts(Path(shape.get("filename", "")), size("scale", "1 1 1"))
            return _mesh(shape.get("filename", ""), parts, "concave" in part.attrib)
        case kind:
            (radius,), half = size("radius"), 0.5 * size("length")[0]
    if kind is ShapeType.CAPSULE:
        return _boxed((radius, radius, radius + half), lambda mass: mass * _TWELFTH)
    return _hull((-radius, -radius, -half), (radius, radius, half))  # of 32 sides


def _sphere(radius: float) -> _Solid:
    reach = (radius, radius, radius)
    return _Solid(
        lambda place: (subtract(place.origin, reach), add(place.origin, reach)),
        lambda mass: (0.4 * mass * radius * radius,) * 3,
    )


def _box(edges: Sequence[float]) -> _Solid:
    """A box of edges, m: its margins go out and in, which leaves their rounding behind."""
    x, y, z = (0.5 * edge for edge in edges)
    margin = min(_FIRST_MARGIN, _MARGIN_SHARE * min(x, y, z))
    inner = _grown((x, y, z), -_FIRST_MARGIN)
    if margin < _FIRST_MARGIN:
        inner = _grown(_grown(inner, _FIRST_MARGIN), -margin)
    inner = _grown(_grown(inner, margin), -_MARGIN)
    return _boxed(_grown(inner, _MARGIN), lambda mass: mass / 12.0)


def _mesh(name: str, parts: Sequence[Bounds], is_concave: bool) -> _Solid:
    """A mesh: each part of an .obj is a hull, of an .stl one hull whose vertices are rounded.

    As it is, concave, it has no moments of inertia where it is alone.
    """
    if is_concave:
        return _round(*_union(parts), 0.0, lambda mass, corners: _ORIGIN)
    if name.lower().endswith(".obj"):
        return _together([(IDENTITY, _hull(*part)) for part in parts])
    ((lower, upper),) = parts
    rounded = [_rounded(*pair) for pair in zip(lower, upper, strict=True)]
    return _hull(*zip(*rounded, strict=True))


def _rounded(lower: float, upper: float) -> tuple[float, float]:
    """Bounds along an axis, m, on the steps of the vertices between them."""
    step, middle = (upper - lower) * (1.0 / _QUANTA), (lower + upper) * 0.5
    if not _LEAST_STEP < step < math.inf:
        return middle, middle
    first, last = (int((bound - middle) * (1.0 / step)) * step + middle for bound in (lower, upper))
    return first, last


def _hull(lower: Vector, upper: Vector) -> _Solid:
    """A convex hull with vertices on all sides of a box; its margin counts three times."""

    def moments(mass: float, corners: Bounds) -> Vector:
        return _box_moments(mass * _TWELFTH, _grown(_half_edges(corners), _MARGIN))

    return _round(_grown(lower, -_MARGIN), _grown(upper, _MARGIN), _MARGIN, moments)


def _together(placed: Sequence[tuple[Transform, _Solid]]) -> _Solid:
    """Several shapes as one, also none."""
    lower, upper = _union([solid.bounds(place) for place, solid in placed])
    return _round(
        lower,
        upper,
        _MARGIN,
        lambda mass, corners: _box_moments(mass / 12.0, _half_edges(corners)),
    )


def _boxed(half: Vector, share: Callable[[float], float]) -> _Solid:
    """A shape about its origin, with the moments of a box of half the edges `half`, m."""
    return _Solid(partial(_turned_box, half, _ORIGIN), lambda mass: _box_moments(share(mass), half))


def _round(
    lower: Vector, upper: Vector, margin: float, moments: Callable[[float, Bounds], Vector]
) -> _Solid:
    """A shape between two corners, m, with the moments that follow from the box round it."""
    half = _grown(scale(0.5, subtract(upper, lower)), margin)
    bounds = partial(_turned_box, half, scale(0.5, add(upper, lower)))
    return _Solid(bounds, lambda mass: moments(mass, bounds(IDENTITY)))


def _turned_box(half: Vector, centre: Vector, place: Transform) -> Bounds:
    """The corners of the box round a turned box of half the edges `half`, m."""
    first, second, third = ((abs(x), abs(y), abs(z)) for x, y, z in place.axes)
    middle = add(to_parent(place.axes, centre), place.origin)
    reach = to_parent((first, second, third), half)
    return subtract(middle, reach), add(middle, reach)


def _box_moments(share: float, half: Vector) -> Vector:
    """Moments of inertia of a box about its centre, kg m^2, given a twelfth of its mass, kg."""
    x, y, z = (2.0 * each * (2.0 * each) for each in half)
    return share * (y + z), share * (x + z), share * (x + y)


def _half_edges(corners: Bounds) -> Vector:
    return scale(0.5, subtract(corners[1], corners[0]))


def _grown(vector: Vector, length: float) -> Vector:
    return add(vector, (length, length, length))


def _union(boxes: Sequence[Bounds]) -> Bounds:
    """The corners of the box round boxes; round none they are the origin."""
    lower, upper = zip(*boxes, strict=True) if boxes else ((_ORIGIN,), (_ORIGIN,))
    x, y, z = (min(each) for each in zip(*lower, strict=True))
    u, v, w = (max(each) for each in zip(*upper, strict=True))
    return (x, y, z), (u, v, w)
