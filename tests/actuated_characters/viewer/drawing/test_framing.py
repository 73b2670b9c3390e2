"""The camera has all characters whole on a page of 1440 by 900, beside its panel, and large."""

import numpy as np
import pytest

from actuated_characters.viewer.drawing.framing import FIELD_OF_VIEW, Framing, frame_points
from msgs_config.arrays import FloatArray
from msgs_config.geometry import fixed_order

SIZE = np.array((1440.0, 900.0))  # pixels
PANEL = 335.0  # pixels from the right edge


def on_page(points: FloatArray, view: Framing) -> FloatArray:
    """Pixels (k, 2) of points (k, 3), from the upper left corner."""
    ahead = view.look_at - view.eye
    ahead /= fixed_order.norm(ahead)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= fixed_order.norm(right)
    to = points - view.eye
    axes = np.column_stack((right, -np.cross(right, ahead)))
    places = to @ axes / (to @ ahead)[:, np.newaxis] / np.tan(0.5 * FIELD_OF_VIEW)
    pixels: FloatArray = 0.5 * SIZE + 0.5 * SIZE[1] * places
    return pixels


def box(*size: float) -> FloatArray:
    """The corners (8, 3) of a box on the ground."""
    corners = np.stack(np.meshgrid(*([0.0, edge] for edge in size)), axis=-1).reshape(-1, 3)
    return corners + np.array((7.0, -3.0, 0.0))


@pytest.mark.parametrize(
    "size", [(0.4, 0.6, 1.7), (5.0, 5.0, 2.0), (6.0, 0.5, 1.8), (12.0, 12.0, 2.0), (0.1, 0.1, 0.1)]
)
def test_all_is_beside_the_panel_and_takes_most_of_the_height_or_the_width(
    size: tuple[float, float, float],
) -> None:
    corners = box(*size)

    pixels = on_page(corners, frame_points(corners))

    (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
    assert left > 0.0 < top
    assert right < SIZE[0] - PANEL and bottom < SIZE[1]
    assert bottom - top > 0.5 * SIZE[1] or right - left > 0.7 * (SIZE[0] - PANEL)


def test_what_is_not_wide_is_in_the_middle_of_the_page() -> None:
    corners = box(0.4, 0.6, 1.7)

    view = frame_points(corners)

    middle = on_page(corners.mean(axis=0)[np.newaxis], view)[0]
    np.testing.assert_allclose(middle, 0.5 * SIZE, atol=0.03 * SIZE[1])
