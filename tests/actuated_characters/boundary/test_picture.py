"""The picture of a search: between which values it is drawn."""

import math
from pathlib import Path

import pytest

from actuated_characters.boundary.bisection import Value, Way
from actuated_characters.boundary.file import Search
from actuated_characters.boundary.picture import _limits, _width, draw
from actuated_characters.boundary.survey import Survey
from actuated_characters.sweep.grid import Choice


def surveyed(way: Way, tried: list[dict[Value, bool]]) -> Survey:
    """A survey of points along a column `gain`, with what was tried at each."""
    axis = [Choice((), {"gain": float(number)}) for number in range(len(tried))]
    found = Survey(Search((axis,), "sim_node.x", way, "fell", 0.0, "gain", "none"))
    for point, values in zip(found.points, tried, strict=True):
        point.tried |= values
    return found


@pytest.mark.parametrize(
    ("way", "tried", "expected"),
    [
        (Way(0.0, 80.0, 1.0), {0.0: False, 20.0: True, 80.0: True}, (0.0, 24.0)),
        (Way(0.0, 80.0, 1.0), {0.0: False, 20.0: True, 60.0: False, 80.0: True}, (0.0, 64.0)),
        (Way(0.0, 80.0, 1.0), {0.0: False, 80.0: False}, (0.0, 84.0)),
        (Way(0.0, 80.0, 1.0), {0.0: True, 80.0: True}, (0.0, 4.0)),
        (Way(1.0, 0.0, 0.1), {1.0: False, 0.5: True, 0.0: True}, (0.45, 1.0)),
        (Way(-100.0, 0.0, 1.0), {-100.0: False, -50.0: True, 0.0: True}, (-100.0, -45.0)),
    ],
)
def test_all_that_was_found_is_within_the_axes(
    tmp_path: Path, way: Way, tried: dict[Value, bool], expected: tuple[float, float]
) -> None:
    found = surveyed(way, [tried, tried])

    assert _limits(found, found.points) == pytest.approx(expected)
    assert draw(found, tmp_path / "picture.png")


@pytest.mark.parametrize(
    ("degrees", "expected"),
    [([0, 90], 27.0), ([80, 90, 100], 9.0), ([350, 0], 9.0), ([-90, 270], 27.0), ([45], 27.0)],
)
def test_bars_do_not_overlap(degrees: list[int], expected: float) -> None:
    angles = [math.radians(each) for each in degrees]

    assert math.degrees(_width(angles)) == pytest.approx(expected)
