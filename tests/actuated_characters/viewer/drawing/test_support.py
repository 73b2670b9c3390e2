"""The support polygon, of shapes whose corners are known, and its hull against its definition."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from actuated_characters.render.engine.camera_pose import Spheres
from actuated_characters.viewer.drawing.support import convex_hull, support_polygon

NO_TURN = np.array((0.0, 0.0, 0.0, 1.0))


def test_two_feet_span_the_polygon_and_what_is_in_the_air_does_not() -> None:
    corners = np.array([(x, y, 0.0) for x in (-0.1, 0.1) for y in (-0.05, 0.05)])
    foot = Spheres(corners, np.full(4, 0.02))
    origins = np.array([(0.0, 0.2, 0.02), (0.0, -0.2, 0.02), (5.0, 0.0, 1.0)])

    found = support_polygon([foot] * 3, origins, np.tile(NO_TURN, (3, 1)))

    expected = {(-0.1, -0.25), (0.1, -0.25), (0.1, 0.25), (-0.1, 0.25)}
    assert {(round(x, 9), round(y, 9)) for x, y in found.tolist()} == expected


def test_nothing_on_the_ground_is_no_polygon() -> None:
    assert support_polygon([], np.empty((0, 3)), np.empty((0, 4))).shape == (0, 2)


whole = st.integers(-5, 5).map(float)


@given(arrays(float, st.tuples(st.integers(0, 12), st.just(2)), elements=whole))
def test_a_hull_is_convex_counterclockwise_of_the_points_and_around_them(
    points: "np.ndarray[tuple[int, int], np.dtype[np.float64]]",
) -> None:
    hull = convex_hull(points)

    given_points = {tuple(point) for point in points.tolist()}
    assert {tuple(corner) for corner in hull.tolist()} <= given_points
    if len(hull) < 3:
        return
    edges = np.roll(hull, -1, axis=0) - hull
    for corner, (ex, ey) in zip(hull, edges, strict=True):
        dx, dy = (points - corner).T
        assert (ex * dy - ey * dx >= 0.0).all()
