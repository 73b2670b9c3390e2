"""The path of plain numbers, against the curve that runs follow."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from actuated_characters.keys.path_weights import path_values, path_weights
from controller_node.references.files.keyframes import Keyframes
from controller_node.references.keyframes import curve_through
from msgs_config.character.layout import GeneralizedPosition, JointLayout, JointType

TIMES = np.array([0.0, 0.1, 0.35, 0.4, 1.0])


@pytest.mark.parametrize("count", [2, 3, 5])
def test_the_path_is_that_of_a_run(count: int) -> None:
    rng = np.random.default_rng(1)
    layout = JointLayout([("slider", JointType.PRISMATIC), ("hinge", JointType.REVOLUTE)])
    keys, states = TIMES[:count], rng.normal(size=(count, 3, 2))
    whole = GeneralizedPosition(states[:, 0], np.empty((count, 0, 4)))
    keyframes = Keyframes(keys, whole, True, None, states[:, 1], states[:, 2])
    curve = curve_through(layout, keyframes)
    times = np.linspace(0.0, keys[-1], 77)

    path = path_values(keys, states, times)

    expected = [curve.sample(time).configuration.position for time in times[:-1].tolist()]
    assert path[:-1] == pytest.approx(np.array(expected), abs=1e-12)
    assert path[-1] == pytest.approx(states[-1, 0], abs=1e-12)
    weighted = path_weights(keys, times) @ states.reshape(-1, 2)
    assert weighted == pytest.approx(path, abs=1e-12)


def test_a_quintic_is_kept() -> None:
    quintic = Polynomial([0.3, -1.0, 2.0, -1.5, 0.7, 0.2])
    rows = [quintic.deriv(order)(TIMES) if order else quintic(TIMES) for order in range(3)]
    states = np.stack(rows, axis=1)[..., np.newaxis]
    times = np.linspace(0.0, 1.0, 31)

    path = path_values(TIMES, states, times)

    assert path[:, 0] == pytest.approx(quintic(times), abs=1e-12)
