"""Triangles drawn into a picture with a depth for each sample: the compiled inner loops.

A sample is the middle of a pixel of the arrays. Triangles that share an edge leave no gap between
them and cover no sample twice: a sample on an edge belongs to what lies right of it or below. The
light is ambient and diffuse, by Lambert's cosine law, and the normal is interpolated (Phong 1975,
"Illumination for computer generated pictures"). What varies over a triangle is linear in the
picture once it is divided by the depth (Blinn 1992, "Hyperbolic interpolation").

Nothing but `+ - * /`, square roots and comparisons, each exact by IEEE 754 and in one order: the
same picture on every machine.
"""

from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.compiled.decorator import Compiler

Bytes: TypeAlias = NDArray[np.uint8]
Singles: TypeAlias = NDArray[np.float32]

AMBIENT, DIFFUSE = 0.6, 0.45  # share of a colour in the shade, and what light from ahead adds

compiled = Compiler(Path(__file__))

# Columns of a corner: place in the picture, inverse of its depth, normal, place in the texture.
_X, _Y, _INVERSE, _NORMAL, _UV, _COLUMNS = 0, 1, 2, 3, 6, 8


# Its arguments are single arrays: taken out of tuples they make the loops slower by a third.
@compiled
def draw_triangles(
    points: FloatArray,
    normals: FloatArray,
    triangles: IntArray,
    uvs: FloatArray,
    texture: Bytes,
    color: FloatArray,
    axes: FloatArray,
    origin: FloatArray,
    light: FloatArray,
    lens: FloatArray,
    mark: int,
    colors: Singles,
    inverses: Singles,
    marks: Bytes,
) -> None:
    """Draw what is seen of a body's triangles from their outer side, wherever nothing is nearer.

    Args:
        points: Vertices (m, 3) in the body's frame, m.
        normals: Theirs (m, 3), outwards, of length one.
        triangles: Vertices (k, 3) of each triangle, counterclockwise seen from outside.
        uvs: Where the vertices lie in the texture (m, 2), right and up, 1 at its edges.
        texture: Red, green and blue (h, w, 3), which the colour is multiplied by; none: (0, 0, 3).
        color: Red, green and blue (3,), 0 to 255.
        axes: The camera's right, up and back (3, 3) by row, in the body's frame.
        origin: The body's origin (3,) along these axes from the camera, m.
        light: Direction (3,) to the light in the body's frame, of length one.
        lens: Pixels of a length that is seen at its own distance; column and row of the axis;
            depth in m from which on something is drawn, above 0.
        mark: What `marks` has where the body is seen.
        colors: The picture (h, w, 3), 0 to 255; changed.
        inverses: One divided by the depth along the camera's axis (h, w), 0 where there is
            nothing, 1/m; changed.
        marks: (h, w); changed.
    """
    placed = np.empty((len(points), 3))
    corners = np.empty((len(points), _COLUMNS))
    for row in range(len(points)):
        _place(points[row], axes, origin, placed[row])
        _project(placed[row], lens, corners[row])
        for axis in range(3):
            corners[row, _NORMAL + axis] = normals[row, axis]
        corners[row, _UV], corners[row, _UV + 1] = uvs[row, 0], uvs[row, 1]
    clipped, planes, near = np.empty((4, _COLUMNS)), np.empty((6, 3)), lens[3]
    for number in range(len(triangles)):
        a, b, c = triangles[number, 0], triangles[number, 1], triangles[number, 2]
        before = (placed[a, 2] >= near) + (placed[b, 2] >= near) + (placed[c, 2] >= near)
        count = 3
        if before == 3:
            if not _is_seen(corners, a, b, c, inverses.shape):
                continue
            for column in range(_COLUMNS):
                clipped[0, column] = corners[a, column]
                clipped[1, column] = corners[b, column]
                clipped[2, column] = corners[c, column]
        else:
            count = _clip(triangles[number], placed, corners, lens, clipped) if before else 0
        for last in range(2, count):
            if _is_seen(clipped, 0, last - 1, last, inverses.shape):
                _fill(clipped[0], clipped[last - 1], clipped[last], planes, texture, color, light,
                      mark, colors, inverses, marks)  # fmt: skip


@compiled
def _place(point: FloatArray, axes: FloatArray, origin: FloatArray, placed: FloatArray) -> None:
    """Write where a point (3,) is along the camera's axes (3,), its depth last, m."""
    x, y, z = point[0], point[1], point[2]
    placed[0] = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z + origin[0]
    placed[1] = axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z + origin[1]
    placed[2] = -(axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z + origin[2])


@compiled
def _project(placed: FloatArray, lens: FloatArray, corner: FloatArray) -> None:
    """Write where in the picture a corner is that lies before the camera."""
    inverse = 1.0 / placed[2]
    corner[_X] = lens[1] + lens[0] * placed[0] * inverse
    corner[_Y] = lens[2] - lens[0] * placed[1] * inverse
    corner[_INVERSE] = inverse


@compiled
def _clip(
    triangle: IntArray, placed: FloatArray, corners: FloatArray, lens: FloatArray, kept: FloatArray
) -> int:
    """Write the corners (4, columns) of what is far enough away of a triangle; how many they are.

    Sutherland and Hodgman 1974, "Reentrant polygon clipping".
    """
    count, near, cut = 0, lens[3], np.empty(3)
    for side in range(3):
        one, other = triangle[side], triangle[(side + 1) % 3]
        if placed[one, 2] >= near:
            kept[count] = corners[one]
            count += 1
        if (placed[one, 2] >= near) != (placed[other, 2] >= near):
            # from the nearer end, whichever of two triangles it is: they meet in the same point
            if placed[one, 2] > placed[other, 2]:
                one, other = other, one
            share = (near - placed[one, 2]) / (placed[other, 2] - placed[one, 2])
            for axis in range(3):
                cut[axis] = placed[one, axis] + share * (placed[other, axis] - placed[one, axis])
            for column in range(_NORMAL, _COLUMNS):
                change = corners[other, column] - corners[one, column]
                kept[count, column] = corners[one, column] + share * change
            cut[2] = near
            _project(cut, lens, kept[count])
            count += 1
    return count


@compiled
def _is_seen(corners: FloatArray, a: int, b: int, c: int, shape: tuple[int, int]) -> bool:
    """Whether three corners are counterclockwise, and some sample may be between them."""
    a_x, a_y, b_x, b_y = corners[a, _X], corners[a, _Y], corners[b, _X], corners[b, _Y]
    c_x, c_y = corners[c, _X], corners[c, _Y]
    if not (c_x - a_x) * (b_y - a_y) > (b_x - a_x) * (c_y - a_y):
        return False  # seen from behind, without area, or NaN
    height, width = shape
    first, last = _samples(min(a_y, b_y, c_y), max(a_y, b_y, c_y), height)
    left, right = _samples(min(a_x, b_x, c_x), max(a_x, b_x, c_x), width)
    return first < last and left < right


@compiled
def _fill(
    a: FloatArray,
    b: FloatArray,
    c: FloatArray,
    planes: FloatArray,
    texture: Bytes,
    color: FloatArray,
    light: FloatArray,
    mark: int,
    colors: Singles,
    inverses: Singles,
    marks: Bytes,
) -> None:
    """Draw a triangle that is seen, its corners before the camera."""
    height, width = inverses.shape
    top, middle, bottom = _by_height(a, b, c)
    first, last = _samples(top[_Y], bottom[_Y], height)
    _set_planes(a, b, c, planes)
    flat = _have_one_normal(a, b) and _have_one_normal(a, c)
    shade = _shade(a[_NORMAL], a[_NORMAL + 1], a[_NORMAL + 2], light)
    lowest = min(a[_INVERSE], b[_INVERSE], c[_INVERSE])
    highest = max(a[_INVERSE], b[_INVERSE], c[_INVERSE])
    for row in range(first, last):
        y = row + 0.5
        upper, lower = (top, middle) if y < middle[_Y] else (middle, bottom)
        one, other = _crossing(top, bottom, y), _crossing(upper, lower, y)
        begin, end = _samples(min(one, other), max(one, other), width)
        for column in range(begin, end):
            x = column + 0.5
            # rounding must not lead a thin triangle's depth beyond that of its corners
            inverse = min(max(_at(planes[0], x, y), lowest), highest)
            if np.float32(inverse) < inverses[row, column]:
                continue
            inverses[row, column] = inverse
            marks[row, column] = mark
            if not flat:
                shade = _shade(
                    _at(planes[1], x, y), _at(planes[2], x, y), _at(planes[3], x, y), light
                )
            _paint(x, y, inverse, shade, planes, texture, color, colors[row, column])


@compiled
def _by_height(
    a: FloatArray, b: FloatArray, c: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The corners from the picture's upper edge downwards."""
    if b[_Y] < a[_Y]:
        a, b = b, a
    if c[_Y] < b[_Y]:
        b, c = c, b
    if b[_Y] < a[_Y]:
        a, b = b, a
    return a, b, c


@compiled
def _samples(low: float, high: float, count: int) -> tuple[int, int]:
    """The first of `count` samples, at 0.5, 1.5 ..., from `low` on, and that from `high` on."""
    limit = float(count)  # as numbers so large that they are no integer are
    first = min(max(np.ceil(low - 0.5), 0.0), limit)
    last = min(max(np.ceil(high - 0.5), 0.0), limit)
    return int(first), int(last)


@compiled
def _crossing(upper: FloatArray, lower: FloatArray, y: float) -> float:
    """Where the edge between two corners crosses a height; the same for both of its triangles."""
    slope = (lower[_X] - upper[_X]) / (lower[_Y] - upper[_Y])
    crossing: float = upper[_X] + (y - upper[_Y]) * slope
    return crossing


@compiled
def _set_planes(a: FloatArray, b: FloatArray, c: FloatArray, planes: FloatArray) -> None:
    """Write what is linear in the picture (6, 3): its change with x and with y, and its value at 0.

    That is the inverse depth, and the normal and the place in the texture times it.
    """
    right_b, down_b = b[_X] - a[_X], b[_Y] - a[_Y]
    right_c, down_c = c[_X] - a[_X], c[_Y] - a[_Y]
    area = right_b * down_c - right_c * down_b
    for number in range(6):
        if number:
            column = _NORMAL + number - 1
            at_a = a[column] * a[_INVERSE]
            to_b, to_c = b[column] * b[_INVERSE] - at_a, c[column] * c[_INVERSE] - at_a
        else:
            at_a = a[_INVERSE]
            to_b, to_c = b[_INVERSE] - at_a, c[_INVERSE] - at_a
        with_x = (to_b * down_c - to_c * down_b) / area
        with_y = (to_c * right_b - to_b * right_c) / area
        planes[number, 0], planes[number, 1] = with_x, with_y
        planes[number, 2] = at_a - with_x * a[_X] - with_y * a[_Y]


@compiled
def _have_one_normal(a: FloatArray, b: FloatArray) -> bool:
    x, y, z = _NORMAL, _NORMAL + 1, _NORMAL + 2
    same: bool = a[x] == b[x] and a[y] == b[y] and a[z] == b[z]
    return same


@compiled
def _at(plane: FloatArray, x: float, y: float) -> float:
    value: float = plane[0] * x + plane[1] * y + plane[2]
    return value


@compiled
def _shade(x: float, y: float, z: float, light: FloatArray) -> float:
    """The share of a colour that is seen of a surface with a normal of any length."""
    along = x * light[0] + y * light[1] + z * light[2]
    if not along > 0.0:
        return AMBIENT
    lit: float = AMBIENT + DIFFUSE * along / np.sqrt(x * x + y * y + z * z)
    return lit


@compiled
def _texel(place: float, count: int) -> int:
    """Which of so many texels is at a place that repeats with each 1; 0 if that is no number."""
    share = place - np.floor(place)
    return min(int(share * count), count - 1) if 0.0 <= share <= 1.0 else 0


@compiled
def _paint(
    x: float,
    y: float,
    inverse: float,
    shade: float,
    planes: FloatArray,
    texture: Bytes,
    color: FloatArray,
    pixel: Singles,
) -> None:
    """Give a pixel (3,) the colour of a place in the picture."""
    height, width = texture.shape[0], texture.shape[1]
    if not height:
        for channel in range(3):
            pixel[channel] = min(shade * color[channel], 255.0)
        return
    u, v = _at(planes[4], x, y) / inverse, _at(planes[5], x, y) / inverse
    column = _texel(u, width)
    row = height - 1 - _texel(v, height)
    for channel in range(3):
        share = texture[row, column, channel] / 255.0
        pixel[channel] = min(shade * color[channel] * share, 255.0)


@compiled
def add_shadow(
    dark: BoolArray, places: FloatArray, first: tuple[int, int], samples: int, share: Singles
) -> None:
    """Add up the share of each pixel (h, w) in which a plane is seen that lies in the shadow.

    Args:
        dark: Where (m, n) something is in the way of the light, in a picture from there.
        places: Column and row in that picture, both times a third number, that number, and one
            that is above 0 where the plane is seen: (4, 3), of a sample's column, row and 1.
        first: Row and column of the first sample.
        samples: So many of them are drawn along each edge of a pixel.
        share: 0 to begin with; changed.
    """
    height, width = dark.shape
    one = np.float32(1.0 / samples**2)
    for row in range(samples * share.shape[0]):
        for column in range(samples * share.shape[1]):
            x, y = first[1] + column + 0.5, first[0] + row + 0.5
            scale = _at(places[2], x, y)
            if not (scale > 0.0 and _at(places[3], x, y) > 0.0):
                continue
            left = np.floor(_at(places[0], x, y) / scale)
            down = np.floor(_at(places[1], x, y) / scale)
            if 0.0 <= left < width and 0.0 <= down < height and dark[int(down), int(left)]:
                share[row // samples, column // samples] += one
