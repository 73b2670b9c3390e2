"""The chequerboard as a view sees it, compared with rays that are cast one by one."""

from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from actuated_characters.render.engine import ground
from actuated_characters.render.engine.camera_pose import CameraPose
from tests.support.pictures import points_at

SIZE = (24, 16)
views = st.builds(
    CameraPose,
    target=st.tuples(*[st.floats(-5.0, 5.0)] * 2, st.floats(0.0, 2.0)),
    distance=st.floats(0.5, 20.0),
    yaw=st.floats(-pi, pi),
    pitch=st.floats(0.05, 1.5),
    field_of_view=st.floats(0.1, 1.2),
)


@given(views)
def test_the_ground_is_where_rays_meet_it(view: CameraPose) -> None:
    width, height = SIZE
    rows, columns = np.arange(height), np.arange(width)
    depth = ground.depths(view, height, rows + 0.5)

    x, y = ground.places(view, SIZE, rows + 0.5, columns + 0.5)

    below = np.isfinite(depth) & (depth < 1e3)
    pixels = np.array(np.meshgrid(rows[below], columns, indexing="ij")).reshape(2, -1)
    points = points_at(view, pixels, np.repeat(depth[below], width), SIZE)
    np.testing.assert_allclose(points[2], 0.0, atol=1e-8)
    np.testing.assert_allclose(points[0], x[below].ravel(), atol=1e-8)
    np.testing.assert_allclose(points[1], y[below].ravel(), atol=1e-8)
    # what is not below the horizon has no ground
    upwards = points_at(view, np.array([rows, 0 * rows]), np.ones(height), SIZE)[2] >= view.eye()[2]
    np.testing.assert_array_equal(np.isinf(depth), upwards)


@pytest.mark.parametrize("yaw", [0.0, 0.45, -2.0])
@pytest.mark.parametrize("pitch", [0.15, 0.9])
def test_a_pixel_has_the_mean_of_what_it_covers(yaw: float, pitch: float) -> None:
    view, size, fine = CameraPose((0.3, 0.1, 0.8), 4.0, yaw, pitch), (96, 64), 8
    sharp = ground.depths(view, 64, np.arange(64.0)) < 1.6 * view.distance  # no haze so far

    seen = ground.colors(view, size)[sharp, :, 0]

    rays = _light_tiles(view, size, fine)[np.repeat(sharp, fine)]
    cast = rays.reshape(-1, fine, 96, fine).mean(axis=(1, 3))
    one_ray = _light_tiles(view, size, 1)[sharp]
    dark, contrast = 255.0 * 0.70, 255.0 * 0.18
    error = np.abs((seen - dark) / contrast - cast)
    # a footprint is taken as a rectangle along the grid, which it is but nearly
    assert error.mean() < 0.4 * np.abs(one_ray - cast).mean()
    assert abs(((seen - dark) / contrast).mean() - cast.mean()) < 0.01


def _light_tiles(view: CameraPose, size: tuple[int, int], fine: int) -> np.ndarray:
    """1 where a ray meets a light tile, with so many rays along each edge of a pixel."""
    rows, columns = ((np.arange(edge * fine) + 0.5) / fine for edge in size[::-1])
    x, y = ground.places(view, size, rows, columns)
    tile = ground.tile_length(view.distance)
    with np.errstate(invalid="ignore"):
        return ((np.floor(x / tile) + np.floor(y / tile)) % 2.0 == 0.0).astype(float)


def test_far_away_there_is_nothing_but_the_background() -> None:
    seen = ground.colors(CameraPose(pitch=0.05), (40, 60))

    np.testing.assert_array_equal(seen[:20], np.broadcast_to(ground.BACKGROUND, (20, 40, 3)))
    assert (seen[-1] != ground.BACKGROUND).all()


@pytest.mark.parametrize("height", [0.0, -1.0])
def test_from_the_ground_or_below_there_is_none(height: float) -> None:
    view = CameraPose(target=(0.0, 0.0, height), pitch=0.0)

    seen = ground.colors(view, SIZE)

    np.testing.assert_array_equal(seen, np.broadcast_to(ground.BACKGROUND, seen.shape))


def test_tiles_are_1_2_or_5_times_a_power_of_ten() -> None:
    lengths = {ground.tile_length(d) for d in (0.7, 3.0, 5.9, 6.1, 13.0, 31.0)}

    assert lengths == {0.1, 0.5, 1.0, 2.0, 5.0}
