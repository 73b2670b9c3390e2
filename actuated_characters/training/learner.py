"""Proximal policy optimisation of two small networks, in numpy.

Sources: Schulman et al. 2017, "Proximal Policy Optimization Algorithms"; Schulman et al. 2016,
"High-Dimensional Continuous Control Using Generalized Advantage Estimation"; Kingma and Ba 2015,
"Adam: A Method for Stochastic Optimization"; Polyak and Juditsky 1992, "Acceleration of Stochastic
Approximation by Averaging".
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from actuated_characters.training.episode_types import CUT, FELL, Taught, Trace
from controller_node.planner.compiled.network import Network
from msgs_config.arrays import FloatArray, IntArray, SingleArray

_LARGEST_GRADIENT = 1.0  # norm to which a gradient is shortened
_MEAN_KEEPS, _SQUARE_KEEPS, _LEAST_ROOT = 0.9, 0.999, 1e-8  # Adam's
_LOG_RATIO_MOST = 20.0
_VALUE_RATE = 1e-3
_VALUE_WEIGHT = 4.0
_LEAST_CALM = 1e-3
_FALLS_SOON = 30  # decisions, 1 s: a state from which it falls so soon is not calm
_OVER_WEIGHT = np.float32(0.1)  # of means beyond the largest action


@dataclass(frozen=True)
class LearningSettings:
    """How policies learn."""

    discount: float = 0.96  # a decision
    fade: float = 0.95  # of advantages, a decision
    passes: int = 5  # over a trace
    part: int = 768  # decisions of a step
    clip: float = 0.2  # of the ratio of probabilities
    largest: float = 2.0  # action
    averaged: int = 30  # traces, over which networks are averaged


class Adam:
    """Steps along a gradient, each entry by how sure it is."""

    def __init__(self, network: Network) -> None:
        self._means = [np.zeros_like(each) for each in network]
        self._squares = [np.zeros_like(each) for each in network]
        self._steps = 0

    def step(self, network: Network, gradient: Sequence[SingleArray], rate: float) -> None:
        """Change a network in place."""
        self._steps += 1
        norm = float(np.sqrt(sum(float((each * each).sum()) for each in gradient)))
        share = np.float32(min(1.0, _LARGEST_GRADIENT / (norm + _LEAST_ROOT)))
        of_mean, of_square = (1.0 - keeps**self._steps for keeps in (_MEAN_KEEPS, _SQUARE_KEEPS))
        parts = zip(network, gradient, self._means, self._squares, strict=True)
        for weights, each, mean, square in parts:
            scaled = each * share
            mean += np.float32(1.0 - _MEAN_KEEPS) * (scaled - mean)
            square += np.float32(1.0 - _SQUARE_KEEPS) * (scaled * scaled - square)
            root = np.sqrt(square / np.float32(of_square)) + np.float32(_LEAST_ROOT)
            weights -= np.float32(rate / of_mean) * mean / root


class Average:
    """The mean of what a network was lately, which scatters less than what it is."""

    def __init__(self, network: Network, most: int) -> None:
        """Begin with what it is; from so many on, those of before fade."""
        self.network = copy_of(network)
        self._count, self._most = 1, most

    def take(self, network: Network) -> None:
        """Count what it is now."""
        self._count = min(self._count + 1, self._most)
        for mean, weights in zip(self.network, network, strict=True):
            mean += np.float32(1.0 / self._count) * (weights - mean)


def copy_of(network: Network) -> Network:
    """The same weights, of its own."""
    return Network(*(each.copy() for each in network))


def make_network(sizes: Sequence[int], last: float, rng: np.random.Generator) -> Network:
    """A network with random weights; those of its last layer are `last` times as large."""
    parts: list[SingleArray] = []
    for layer, (inputs, outputs) in enumerate(pairwise(sizes)):
        gain = last if layer == len(sizes) - 2 else 1.0
        weights = gain * rng.normal(size=(inputs, outputs)) / np.sqrt(inputs)
        parts += [weights.astype(np.float32), np.zeros(outputs, np.float32)]
    return Network(*parts)


Cache = tuple[SingleArray, SingleArray, SingleArray]


def forward(network: Network, inputs: SingleArray) -> tuple[SingleArray, Cache]:
    """Outputs (m, o) of inputs (m, i), and what `backward` needs."""
    first = np.tanh(inputs @ network.weights_1 + network.bias_1)
    second = np.tanh(first @ network.weights_2 + network.bias_2)
    return second @ network.weights_3 + network.bias_3, (inputs, first, second)


def backward(network: Network, cache: Cache, slope: SingleArray) -> list[SingleArray]:
    """The gradient of what has a slope (m, o) at the outputs."""
    inputs, first, second = cache
    at_second = (slope @ network.weights_3.T) * (1.0 - second * second)
    at_first = (at_second @ network.weights_2.T) * (1.0 - first * first)
    return [
        *(inputs.T @ at_first, at_first.sum(0)),
        *(first.T @ at_second, at_second.sum(0)),
        *(second.T @ slope, slope.sum(0)),
    ]


@dataclass(frozen=True)
class Lesson:
    """What is learnt from a trace, a row a decision."""

    observations: SingleArray  # (m, o)
    actions: SingleArray  # (m, a)
    chances: SingleArray  # (m,) logarithms of the actions' probabilities, but for a constant
    advantages: SingleArray  # (m,) in standard deviations
    values: SingleArray  # (m,)
    taught: Taught | None = None


class Learner:
    """Policy and value, and how they learn."""

    def __init__(
        self, sizes: tuple[int, int, int], rng: np.random.Generator, settings: LearningSettings
    ) -> None:
        """`sizes` are of observation, hidden layers and action."""
        inputs, hidden, actions = sizes
        self._settings, self._rng = settings, rng
        self.policy = make_network((inputs, hidden, hidden, actions), 0.01, rng)
        self.value = make_network((inputs, hidden // 2, hidden // 2, 1), 0.1, rng)
        self._policy_steps, self._value_steps = Adam(self.policy), Adam(self.value)
        self._average()
        self._threads = ThreadPoolExecutor(1)

    def take(self, policy: Network, value: Network) -> None:
        """Go on from other networks of the same sizes."""
        for own, given in ((self.policy, policy), (self.value, value)):
            for weights, wanted in zip(own, given, strict=True):
                weights[:] = wanted
        self._average()

    @property
    def averages(self) -> tuple[Network, Network]:
        """Policy and value as they were lately, which is how they are to be used."""
        policy, value = self._averages
        return policy.network, value.network

    def close(self) -> None:
        """End its thread."""
        self._threads.shutdown()

    def learn(
        self,
        trace: Trace,
        noise: SingleArray,
        spread: float,
        rate: float,
        taught: Taught | None = None,
    ) -> None:
        """Learn from a trace (worlds, decisions), by steps of the policy of a rate.

        `noise` (worlds, decisions, a) are the draws that were added to its actions, by `spread`;
        `taught` is what teachers say to it.
        """
        lesson = self._lesson(trace, noise, taught)
        orders = [self._rng.permutation(len(lesson.values)) for _ in range(self._settings.passes)]
        valuing = self._threads.submit(self._learn_value, lesson, orders)
        self._learn_policy(lesson, orders, np.float32(1.0 / spread), rate)
        valuing.result()
        for average, network in zip(self._averages, (self.policy, self.value), strict=True):
            average.take(network)

    def _average(self) -> None:
        """Begin to average."""
        most = self._settings.averaged
        self._averages = Average(self.policy, most), Average(self.value, most)

    def _lesson(self, trace: Trace, noise: SingleArray, taught: Taught | None = None) -> Lesson:
        settings = self._settings
        worlds, decisions = trace.rewards.shape
        whole = 1.0 / (1.0 - settings.discount)  # of a reward of one, for good
        values = whole * _answers(self.value, trace.observations).reshape(worlds, decisions)
        after = np.empty_like(values)
        after[:, :-1] = values[:, 1:]
        ends = trace.ends != 0
        ends[:, -1] = True
        after[ends] = whole * _answers(self.value, trace.after[ends])
        after[trace.ends == FELL] = 0.0  # whatever it is told: a state that diverged may be NaN
        surprise = trace.rewards + settings.discount * after - values
        goes_on = settings.discount * settings.fade * (trace.ends == 0)
        advantages, last = np.zeros_like(values), np.zeros(worlds)
        for decision in range(decisions - 1, -1, -1):
            last = surprise[:, decision] + goes_on[:, decision] * last
            advantages[:, decision] = last
        centred = (advantages - advantages.mean()) / (advantages.std() + _LEAST_ROOT)
        return Lesson(
            trace.observations.reshape(worlds * decisions, -1),
            trace.actions.reshape(worlds * decisions, -1),
            (-0.5 * noise * noise).sum(2).ravel(),
            centred.astype(np.float32).ravel(),
            ((advantages + values) / whole).astype(np.float32).ravel(),
            taught,
        )

    def least_expected(self, trace: Trace) -> float:
        """What the averaged value expects in the states of a trace but for a twentieth.

        States that lead to a fall within `_FALLS_SOON`, or may, as the trace is over before, do not
        count, if there are others.
        """
        until_fall, left = np.empty_like(trace.ends), np.zeros(len(trace.ends), np.intp)
        for decision in range(trace.ends.shape[1] - 1, -1, -1):
            ends = trace.ends[:, decision]
            left = np.where(ends == FELL, 0, np.where(ends == CUT, _FALLS_SOON, left + 1))
            until_fall[:, decision] = left
        expected = _answers(self._averages[1].network, trace.observations)
        stays = until_fall.ravel() >= _FALLS_SOON
        least = float(np.quantile(expected[stays] if stays.any() else expected, 0.05))
        return max(least, _LEAST_CALM)

    def _parts(self, orders: Sequence[IntArray]) -> list[IntArray]:
        count = max(1, len(orders[0]) // self._settings.part)
        return [part for order in orders for part in np.array_split(order, count)]

    def _learn_value(self, lesson: Lesson, orders: Sequence[IntArray]) -> None:
        for part in self._parts(orders):
            found, cache = forward(self.value, lesson.observations[part])
            slope = (found[:, 0] - lesson.values[part]) * np.float32(_VALUE_WEIGHT / len(part))
            gradient = backward(self.value, cache, slope[:, np.newaxis])
            self._value_steps.step(self.value, gradient, _VALUE_RATE)

    def _learn_policy(
        self, lesson: Lesson, orders: Sequence[IntArray], inverse: np.float32, rate: float
    ) -> None:
        for part in self._parts(orders):
            found, cache = forward(self.policy, lesson.observations[part])
            slope = self._slope(lesson, part, found, inverse)
            self._policy_steps.step(self.policy, backward(self.policy, cache, slope), rate)

    def _slope(
        self, lesson: Lesson, part: IntArray, means: SingleArray, inverse: np.float32
    ) -> SingleArray:
        """The slope (m, a) of the clipped objective at the means, and of what teachers say."""
        settings, advantage = self._settings, lesson.advantages[part]
        off = (lesson.actions[part] - means) * inverse
        log_ratio = (-0.5 * off * off).sum(1) - lesson.chances[part]
        log_ratio = np.clip(log_ratio, -_LOG_RATIO_MOST, _LOG_RATIO_MOST)
        ratio = np.exp(log_ratio)
        too_high = (advantage > 0.0) & (ratio > 1.0 + settings.clip)
        too_low = (advantage < 0.0) & (ratio < 1.0 - settings.clip)
        counts = -advantage * ratio * ~(too_high | too_low) / np.float32(len(part))
        slope = counts[:, np.newaxis] * off * inverse
        over = np.abs(means) - np.float32(settings.largest)
        slope += _OVER_WEIGHT / np.float32(len(part)) * np.maximum(over, 0.0) * np.sign(means)
        if lesson.taught is not None:  # half the square of what is off
            share = lesson.taught.shares[part, np.newaxis]
            wrong = (means - lesson.taught.actions[part]) / np.float32(len(part))
            slope += share * (wrong - slope)
        single: SingleArray = slope.astype(np.float32)
        return single


def _answers(value: Network, observations: SingleArray) -> FloatArray:
    """What a value (of one output) expects of each observation (..., o)."""
    rows = observations.reshape(-1, observations.shape[-1])
    found: FloatArray = forward(value, rows)[0][:, 0].astype(float)
    return found
