"""The polygon on the ground in which a character stands: around what touches the ground."""

import numpy as np

from actuated_characters.render.engine.camera_pose import Spheres
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations

_NEAR_GROUND = 0.02  # m


def support_polygon(
    outlines: list[Spheres], origins: FloatArray, turns_xyzw: FloatArray
) -> FloatArray:
    """The corners (c, 2), m, counterclockwise, around all points that are on the ground, z = 0.

    Args:
        outlines: Of each of m links that touch something, in its frame.
        origins: Of the links' frames (m, 3), m, world.
        turns_xyzw: Their orientations (m, 4).
    """
    points = [np.empty((0, 2))]
    for outline, origin, turn in zip(outlines, origins, turns_xyzw, strict=True):
        centres = origin + rotations.rotate(turn, outline.centres)
        near = centres[:, 2] - outline.radii < _NEAR_GROUND
        points.append(centres[near, :2])
    return convex_hull(np.concatenate(points))


def convex_hull(points: FloatArray) -> FloatArray:
    """The corners (c, 2), counterclockwise, of the hull of points (m, 2).

    Andrew's monotone chain (Information Processing Letters 9(5), 1979).
    """
    ordered = sorted({(float(x), float(y)) for x, y in points})
    if len(ordered) < 3:
        return np.array(ordered).reshape(-1, 2)
    lower, upper = _chain(ordered), _chain(ordered[::-1])
    return np.array(lower[:-1] + upper[:-1])


def _chain(ordered: list[tuple[float, float]]) -> list[tuple[float, float]]:
    chain: list[tuple[float, float]] = []
    for x, y in ordered:
        while len(chain) > 1:
            (ax, ay), (bx, by) = chain[-2:]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                break
            chain.pop()
        chain.append((x, y))
    return chain
