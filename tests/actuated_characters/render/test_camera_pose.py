"""The pinhole camera's maths, and how it is placed."""

from math import atan, pi, sin, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from actuated_characters.render.engine.camera_pose import (
    CameraPose,
    Spheres,
    framing,
    natural_aspect,
)
from tests.support.pictures import pixels_of

coordinates = st.floats(-5.0, 5.0)
views = st.builds(
    CameraPose,
    target=st.tuples(coordinates, coordinates, coordinates),
    distance=st.floats(0.5, 20.0),
    yaw=st.floats(-pi, pi),
    pitch=st.floats(-1.5, 1.5),
    field_of_view=st.floats(0.1, 1.5),
)


@given(views)
def test_the_axes_are_orthonormal_and_right_handed_and_the_picture_is_upright(
    view: CameraPose,
) -> None:
    right, up, back = view.axes()

    np.testing.assert_allclose(view.axes() @ view.axes().T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(right, up), back, atol=1e-12)
    assert right[2] == 0.0 and up[2] > 0.0


def test_at_yaw_and_pitch_zero_it_looks_along_y_with_x_to_the_right() -> None:
    view = CameraPose((1.0, 2.0, 3.0), distance=4.0, yaw=0.0, pitch=0.0)

    np.testing.assert_allclose(view.eye(), (1.0, -2.0, 3.0))
    np.testing.assert_allclose(view.axes(), [(1, 0, 0), (0, 0, 1), (0, -1, 0)], atol=1e-15)


def test_a_yaw_leads_to_the_side_of_x_and_a_pitch_upwards() -> None:
    np.testing.assert_allclose(
        CameraPose(distance=2.0, yaw=0.5 * pi, pitch=0.0).eye(), (2, 0, 0), atol=1e-15
    )
    assert CameraPose(distance=2.0, yaw=0.3, pitch=0.5).eye()[2] == pytest.approx(2.0 * sin(0.5))


@given(
    st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=1, max_size=8),
    st.floats(0.01, 1.0),
    st.floats(0.3, 3.0),
    views,
)
def test_framing_shows_every_sphere_whole_and_comes_as_near_as_that_allows(
    centres: list[tuple[float, float, float]], radius: float, aspect: float, like: CameraPose
) -> None:
    points, radii = np.array(centres), np.full(len(centres), radius)

    view = framing(Spheres(points, radii), aspect, like)

    assert (view.yaw, view.pitch, view.field_of_view) == (like.yaw, like.pitch, like.field_of_view)
    clearance = _clearance(view, points, radii, aspect)
    extent = np.ptp(points @ like.axes().T, axis=0).max() + 2.0 * radius
    assert clearance == pytest.approx(0.05 * extent, rel=1e-6)


def _clearance(view: CameraPose, points: np.ndarray, radii: np.ndarray, aspect: float) -> float:
    """The smallest distance of a sphere from a plane through the eye and an edge of the picture."""
    right, up, back = view.axes()
    half = tan(0.5 * view.field_of_view)
    normals = [side * right + aspect * half * back for side in (-1.0, 1.0)]
    normals += [side * up + half * back for side in (-1.0, 1.0)]
    inwards = [-normal / np.linalg.norm(normal) for normal in normals]
    return float(min(((points - view.eye()) @ normal - radii).min() for normal in inwards))


def test_the_natural_aspect_is_that_of_the_extents() -> None:
    upright = CameraPose(yaw=0.0, pitch=0.0)
    corners = np.array([(0.0, 0.0, 0.0), (1.0, 5.0, 2.0)])

    # 5 m is the largest extent, of which a twentieth is left free on either side
    assert natural_aspect(Spheres(corners, np.zeros(2)), upright) == pytest.approx(1.5 / 2.5)


@given(
    st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=1, max_size=6),
    st.floats(0.0, 1.0),
    views,
)
def test_a_box_has_all_that_is_seen_of_spheres(
    centres: list[tuple[float, float, float]], radius: float, view: CameraPose
) -> None:
    size = (50, 40)
    directions = np.random.default_rng(2).normal(size=(30, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    surface = np.concatenate([np.array(centre) + radius * directions for centre in centres])

    box = view.box(Spheres(np.array(centres), np.full(len(centres), radius)), size)

    before = (surface - view.eye()) @ view.axes()[2] < -1e-3
    rows, columns = pixels_of(view, surface[before].T, size)
    seen = (rows >= 0) & (rows < size[1]) & (columns >= 0) & (columns < size[0])
    assert ((rows >= box.top) & (rows < box.bottom))[seen].all()
    assert ((columns >= box.left) & (columns < box.right))[seen].all()


def test_a_box_is_no_larger_than_what_it_is_of() -> None:
    view = CameraPose(
        (0.0, 0.0, 0.0), distance=10.0, yaw=0.0, pitch=0.0, field_of_view=2.0 * atan(0.1)
    )

    box = view.box(
        Spheres(np.array([(0.5, 0.0, 0.25)]), np.zeros(1)), (200, 100)
    )  # 50 pixels a metre

    assert box == (37, 38, 124, 126)  # with half a pixel around it
    assert not view.box(Spheres(np.array([(9.0, 0.0, 0.0)]), np.ones(1)), (200, 100))
    assert not view.box(Spheres(np.empty((0, 3)), np.empty(0)), (200, 100))


def test_where_a_sphere_is_at_the_camera_the_box_is_the_whole_picture() -> None:
    view = CameraPose(distance=2.0)

    assert view.box(Spheres(view.eye()[np.newaxis], np.ones(1)), (200, 100)) == (0, 100, 0, 200)
