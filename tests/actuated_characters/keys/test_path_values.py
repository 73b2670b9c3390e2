"""The path of plain numbers, against the curve that runs follow."""

import numpy as np
import pytest

from actuated_characters.keys.path_weights import path_values, path_weights
from controller_node.references.files.keyframes import Keyframes
from controller_node.references.keyframes import curve_through
from msgs_config.character.layout import GeneralizedPosition, JointLayout, JointType

TIMES = np.array([0.0, 0.1, 0.35, 0.4, 1.0])


@pytest.mark.parametrize("count", [2, 3, 5])
def test_the_path_is_that_of_a_run(count: int) -> None:
    rng = np.random.default_rng(1)
    layout = JointLayout([("slider", JointType.PRISMATIC), ("hinge", JointType.REVOLUTE)])
    keys, values = TIMES[:count], rng.normal(size=(count, 2))
    keyframes = Keyframes(keys, GeneralizedPosition(values, np.empty((count, 0, 4))), smooth=True)
    curve = curve_through(layout, keyframes)
    times = np.linspace(0.0, keys[-1], 77)

    path = path_values(keys, values, times)

    expected = [curve.sample(time).configuration.position for time in times.tolist()]
    assert path == pytest.approx(np.array(expected), abs=1e-12)
    assert path_weights(keys, times) @ values == pytest.approx(path, abs=1e-12)


def test_a_straight_line_is_kept_between_inner_keys() -> None:
    times = np.linspace(0.1, 0.4, 31)

    path = path_values(TIMES, 3.0 * TIMES[:, np.newaxis], times)

    assert path[:, 0] == pytest.approx(3.0 * times, abs=1e-12)
