"""The network, against numpy: in double precision, and in its own order to the bit."""

import numpy as np
import pytest

from controller_node.planner.compiled.network import Network, evaluate, squash
from msgs_config.arrays import FloatArray, SingleArray
from tests.support.policies import random_network

SQUASH_ERROR = 3e-4
SINGLE = 1e-5  # what single precision adds to outputs of about 1

SIZES = [(1, 1, 1, 1), (3, 5, 2, 4), (4, 8, 8, 4), (7, 9, 6, 3), (13, 4, 11, 1), (243, 31, 18, 28)]


def evaluated(network: Network, inputs: SingleArray) -> SingleArray:
    """What the compiled network writes."""
    outputs = np.full(len(network.bias_3), np.nan, np.float32)
    evaluate(network, inputs, outputs)
    return outputs


def with_bounds(network: Network, inputs: SingleArray) -> tuple[FloatArray, FloatArray]:
    """Outputs in double precision, and how far off they may be: tanh has slopes of at most one."""
    values, bounds = inputs.astype(float), np.zeros(len(inputs))
    for number, (weights, bias) in enumerate(zip(network[::2], network[1::2], strict=True)):
        if number:
            values, bounds = np.tanh(values), bounds + SQUASH_ERROR
        values = values @ weights.astype(float) + bias
        bounds = bounds @ abs(weights.astype(float))
    return values, bounds + SINGLE


def in_order(inputs: SingleArray, weights: SingleArray, bias: SingleArray) -> SingleArray:
    """A layer before its tanh: four inputs are added at once, in single precision."""
    outputs, whole = bias.copy(), len(inputs) - len(inputs) % 4
    rows = [x * row for x, row in zip(inputs, weights, strict=True)]
    for a, b, c, d in zip(*(rows[k:whole:4] for k in range(4)), strict=True):
        outputs += (a + b) + (c + d)
    for row in rows[whole:]:
        outputs += row
    return outputs


@pytest.mark.parametrize("sizes", SIZES)
def test_it_is_the_network_of_numpy_but_for_the_error_of_its_tanh(sizes: tuple[int, ...]) -> None:
    rng = np.random.default_rng(sizes[0])
    network = random_network(sizes, rng)

    for scale in (0.1, 1.0, 5.0):
        inputs = (scale * rng.normal(size=sizes[0])).astype(np.float32)
        wanted, bounds = with_bounds(network, inputs)
        assert (abs(evaluated(network, inputs) - wanted) <= bounds).all()


@pytest.mark.parametrize("sizes", SIZES)
def test_its_sums_have_one_order(sizes: tuple[int, ...]) -> None:
    """No processor fuses or reorders them: single precision in that order, to the bit."""
    rng = np.random.default_rng(sizes[0])
    network = random_network(sizes, rng)
    inputs = rng.normal(size=sizes[0]).astype(np.float32)

    values = inputs
    for number, (weights, bias) in enumerate(zip(network[::2], network[1::2], strict=True)):
        if number:
            squash(values)
        values = in_order(values, weights, bias)

    assert evaluated(network, inputs).tobytes() == values.tobytes()


def test_its_tanh_is_near_tanh_odd_and_never_falls() -> None:
    places = np.linspace(-12.0, 12.0, 2_400_001).astype(np.float32)
    found, mirrored = places.copy(), -places
    squash(found)
    squash(mirrored)

    assert abs(found - np.tanh(places.astype(float))).max() < SQUASH_ERROR
    assert found.tobytes() == (-mirrored).tobytes()
    assert np.diff(found).min() > -1e-6  # by rounding, from one place to the next
    assert (np.diff(found[abs(places) < 4.0][::100]) > 0.0).all()
    assert abs(found).max() <= 1.0


def test_its_tanh_is_defined_for_whatever_is_large() -> None:
    values = np.array((-np.inf, -1e30, 0.0, 1e30, np.inf), np.float32)

    squash(values)

    np.testing.assert_allclose(values, (-1.0, -1.0, 0.0, 1.0, 1.0), atol=SQUASH_ERROR)
