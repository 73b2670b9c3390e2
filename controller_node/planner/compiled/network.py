"""A small network, evaluated entry by entry in a fixed order: the same bits on every machine."""

from typing import NamedTuple

import numpy as np

from controller_node.planner.compiled.decorator import compiled
from msgs_config.arrays import SingleArray

_AT_ONCE = 4  # inputs, so that a sum is read and written once for all of them
LARGEST_INPUT = 4.97  # of the tanh below, which beyond is no longer between -1 and 1
# Coefficients of tanh x = x above(x^2) / below(x^2), the highest ones first.
TANH_ABOVE = tuple(map(np.float32, (1.0, 378.0, 17325.0, 135135.0)))
TANH_BELOW = tuple(map(np.float32, (28.0, 3150.0, 62370.0, 135135.0)))


class Network(NamedTuple):
    """Two hidden layers of tanh; weights (inputs, outputs), single precision."""

    weights_1: SingleArray
    bias_1: SingleArray
    weights_2: SingleArray
    bias_2: SingleArray
    weights_3: SingleArray
    bias_3: SingleArray


@compiled
def evaluate(network: Network, inputs: SingleArray, outputs: SingleArray) -> None:
    """Write the outputs of a network."""
    first = np.empty(len(network.bias_1), np.float32)
    second = np.empty(len(network.bias_2), np.float32)
    _add_layer(inputs, network.weights_1, network.bias_1, first)
    squash(first)
    _add_layer(first, network.weights_2, network.bias_2, second)
    squash(second)
    _add_layer(second, network.weights_3, network.bias_3, outputs)


@compiled
def _add_layer(
    inputs: SingleArray, weights: SingleArray, bias: SingleArray, outputs: SingleArray
) -> None:
    outputs[:] = bias
    whole = len(inputs) - len(inputs) % _AT_ONCE
    for i in range(0, whole, _AT_ONCE):
        a, b, c, d = inputs[i], inputs[i + 1], inputs[i + 2], inputs[i + 3]
        of_a, of_b, of_c, of_d = weights[i], weights[i + 1], weights[i + 2], weights[i + 3]
        for j in range(len(outputs)):
            outputs[j] += (a * of_a[j] + b * of_b[j]) + (c * of_c[j] + d * of_d[j])
    for i in range(whole, len(inputs)):
        for j in range(len(outputs)):
            outputs[j] += inputs[i] * weights[i, j]


@compiled
def squash(values: SingleArray) -> None:
    """Replace values by their tanh, a continued fraction of it whose error is below 3e-4.

    No library's tanh, whose last bits differ. (Lambert 1770: tanh x = x / (1 + x^2 / (3 + ...)).)
    """
    a, b = TANH_ABOVE, TANH_BELOW
    for i in range(len(values)):
        x = min(max(values[i], np.float32(-LARGEST_INPUT)), np.float32(LARGEST_INPUT))
        s = x * x
        above = a[3] + s * (a[2] + s * (a[1] + s * a[0]))
        below = b[3] + s * (b[2] + s * (b[1] + s * b[0]))
        values[i] = x * above / below
