"""Learning against independent derivatives, a plain Adam, plain recursions and a toy problem."""

from collections.abc import Iterator, Mapping

import numpy as np
import pytest

from actuated_characters.training import learner as module
from actuated_characters.training.episode_types import CUT, FELL, Trace
from actuated_characters.training.learner import (
    Adam,
    Average,
    Learner,
    LearningSettings,
    backward,
    copy_of,
    forward,
    make_network,
)
from controller_node.planner.compiled.network import Network, evaluate
from msgs_config.arrays import SingleArray

SIZES = (5, 9, 6, 3)


def doubled(network: Network) -> Network:
    """The same in double precision, for derivatives."""
    return Network(*(each.astype(float) for each in network))


@pytest.fixture
def learner() -> Iterator[Learner]:
    made = Learner((4, 16, 2), np.random.default_rng(0), LearningSettings(part=64))
    yield made
    made.close()


def test_gradients_are_difference_quotients() -> None:
    rng = np.random.default_rng(1)
    network = doubled(make_network(SIZES, 1.0, rng))
    inputs, slope = rng.normal(size=(7, SIZES[0])), rng.normal(size=(7, SIZES[-1]))
    _, cache = forward(network, inputs)
    found = backward(network, cache, slope)

    for weights, gradient in zip(network, found, strict=True):
        assert gradient.shape == weights.shape
        for entry in np.ndindex(weights.shape):
            at, step = weights[entry], 1e-5
            ends = []
            for there in (at - step, at + step):
                weights[entry] = there
                ends.append(float((forward(network, inputs)[0] * slope).sum()))
            weights[entry] = at
            assert gradient[entry] == pytest.approx((ends[1] - ends[0]) / (2 * step), abs=1e-7)


def test_what_learns_answers_as_what_plays() -> None:
    """But for the error of the compiled tanh."""
    rng = np.random.default_rng(2)
    network = make_network(SIZES, 1.0, rng)
    inputs = rng.normal(size=(20, SIZES[0])).astype(np.float32)
    answers = np.empty((20, SIZES[-1]), np.float32)
    for row, answer in zip(inputs, answers, strict=True):
        evaluate(network, row, answer)

    np.testing.assert_allclose(forward(network, inputs)[0], answers, atol=3e-3)


def test_adam_takes_the_steps_of_its_paper() -> None:
    rng = np.random.default_rng(3)
    network = make_network(SIZES, 1.0, rng)
    expected = [each.astype(float) for each in network]
    means, squares = ([np.zeros(each.shape) for each in network] for _ in range(2))
    adam = Adam(network)

    for count in range(1, 6):
        gradient = [0.01 * rng.normal(size=each.shape).astype(np.float32) for each in network]
        adam.step(network, gradient, 1e-2)
        for weights, each, mean, square in zip(expected, gradient, means, squares, strict=True):
            mean[:] = 0.9 * mean + 0.1 * each
            square[:] = 0.999 * square + 0.001 * each.astype(float) ** 2
            unbiased = mean / (1 - 0.9**count), square / (1 - 0.999**count)
            weights -= 1e-2 * unbiased[0] / (np.sqrt(unbiased[1]) + 1e-8)

    for weights, wanted in zip(network, expected, strict=True):
        np.testing.assert_allclose(weights, wanted, atol=2e-5)


def test_a_large_gradient_is_shortened_as_a_whole() -> None:
    network = make_network(SIZES, 1.0, np.random.default_rng(4))
    gradient = [np.full(each.shape, 100.0, np.float32) for each in network]
    adam = Adam(network)

    adam.step(network, gradient, 1e-3)

    taken = np.sqrt(sum(float((each * each).sum()) for each in adam._means)) / 0.1
    assert taken == pytest.approx(1.0, rel=1e-4)


def random_trace(worlds: int = 3, decisions: int = 40) -> Trace:
    rng = np.random.default_rng(5)
    observations, after = rng.normal(size=(2, worlds, decisions, 4)).astype(np.float32)
    ends = rng.choice([0, 0, 0, 0, FELL, CUT], size=(worlds, decisions))
    for world in range(worlds):
        for decision in range(decisions - 1):
            if not ends[world, decision]:
                after[world, decision] = observations[world, decision + 1]
    return Trace(
        observations,
        after,
        rng.normal(size=(worlds, decisions, 2)).astype(np.float32),
        rng.random((worlds, decisions)),
        np.zeros((worlds, decisions)),
        ends,
        np.zeros((worlds, decisions), np.intp),
        np.zeros((worlds, decisions), np.intp),
    )


def test_advantages_are_those_of_their_definition(learner: Learner) -> None:
    """Sums of discounted surprises to the end of the episode or of the trace."""
    trace, settings = random_trace(), LearningSettings()
    noise = np.zeros_like(trace.actions)
    lesson = learner._lesson(trace, noise)
    whole = 1.0 / (1.0 - settings.discount)

    def value(observation: SingleArray) -> float:
        return whole * float(forward(learner.value, observation[np.newaxis])[0][0, 0])

    worlds, decisions = trace.rewards.shape
    expected = np.zeros((worlds, decisions))
    for world in range(worlds):
        for first in range(decisions):
            weight = 1.0
            for t in range(first, decisions):
                end = trace.ends[world, t]
                then = 0.0 if end == FELL else value(trace.after[world, t])
                surprise = trace.rewards[world, t] + settings.discount * then
                surprise -= value(trace.observations[world, t])
                expected[world, first] += weight * surprise
                if end:
                    break
                weight *= settings.discount * settings.fade
    targets = lesson.values.reshape(worlds, decisions) * whole
    own = np.array([[value(each) for each in rows] for rows in trace.observations])
    np.testing.assert_allclose(targets - own, expected, atol=1e-4)
    scaled = (expected - expected.mean()) / expected.std()
    np.testing.assert_allclose(lesson.advantages.reshape(worlds, decisions), scaled, atol=1e-4)


def test_what_is_told_after_a_fall_does_not_count(learner: Learner) -> None:
    trace = random_trace()
    before = learner._lesson(trace, np.zeros_like(trace.actions))
    trace.after[trace.ends == FELL] = np.nan

    after = learner._lesson(trace, np.zeros_like(trace.actions))

    assert after.values.tobytes() == before.values.tobytes()
    assert after.advantages.tobytes() == before.advantages.tobytes()


def test_the_slope_is_that_of_the_clipped_objective(learner: Learner) -> None:
    rng, spread, settings = np.random.default_rng(6), 0.3, LearningSettings()
    count = 200
    lesson = module.Lesson(
        np.zeros((count, 4)),
        rng.normal(size=(count, 2)),
        -rng.chisquare(2, size=count) / 2,
        rng.normal(size=count),
        np.zeros(count),
    )
    means = lesson.actions + spread * rng.normal(size=(count, 2))
    part = np.arange(count)

    def objective(means: np.ndarray) -> float:
        chance = -0.5 * (((lesson.actions - means) / spread) ** 2).sum(1)
        ratio = np.exp(chance - lesson.chances)
        clipped = np.clip(ratio, 1 - settings.clip, 1 + settings.clip)
        return -float(np.minimum(ratio * lesson.advantages, clipped * lesson.advantages).mean())

    slope = learner._slope(lesson, part, means, 1.0 / spread)

    assert np.abs(means).max() > settings.largest  # where another part of the slope pulls back
    for row in range(count):
        for entry in range(2):
            if abs(means[row, entry]) > settings.largest:
                continue
            ends = []
            for step in (-1e-6, 1e-6):
                there = means.copy()
                there[row, entry] += step
                ends.append(objective(there))
            quotient = (ends[1] - ends[0]) / 2e-6
            assert slope[row, entry] == pytest.approx(quotient, abs=2e-5, rel=1e-3)


def test_it_learns_what_pays(learner: Learner) -> None:
    """Of one decision, whose best answer the observation says."""
    rng, spread, count = np.random.default_rng(7), 0.3, 512
    rewards = []
    for _ in range(60):
        observations = rng.normal(size=(count, 1, 4)).astype(np.float32)
        target = np.stack((observations[..., 0], -0.5 * observations[..., 1]), axis=-1)
        noise = rng.standard_normal((count, 1, 2), np.float32)
        means = forward(learner.policy, observations[:, 0])[0][:, np.newaxis]
        actions = means + np.float32(spread) * noise
        reward = -((actions - target) ** 2).sum(-1).astype(float)
        rewards.append(float(-((means - target) ** 2).sum(-1).mean()))
        ends = np.full((count, 1), FELL)
        trace = Trace(observations, observations, actions, reward, reward, ends, ends, ends)
        learner.learn(trace, noise, spread, 1e-3)

    assert rewards[0] == pytest.approx(-1.25, abs=0.2)
    assert rewards[-1] > -0.05


def test_an_average_is_of_all_at_first_and_of_the_last_ones_later() -> None:
    rng = np.random.default_rng(8)
    networks = [make_network(SIZES, 1.0, rng) for _ in range(5)]
    weights = [each.weights_2.astype(float) for each in networks]
    average = Average(networks[0], 3)

    for network in networks[1:3]:
        average.take(network)
    mean = sum(weights[:3]) / 3
    np.testing.assert_allclose(average.network.weights_2, mean, atol=1e-6)

    for network, each in zip(networks[3:], weights[3:], strict=True):
        average.take(network)
        mean = mean + (each - mean) / 3  # exponentially, by as many
    np.testing.assert_allclose(average.network.weights_2, mean, atol=1e-6)
    assert (networks[0].weights_2 == weights[0]).all(), "its own copy"
    last = Average(networks[0], 1)
    last.take(networks[1])
    np.testing.assert_allclose(last.network.weights_2, weights[1], atol=1e-6)


def test_what_is_used_is_the_average_of_what_was_learnt(learner: Learner) -> None:
    given = copy_of(learner.policy), copy_of(learner.value)
    for each in (*given[0], *given[1]):
        each += np.float32(0.1)
    learner.take(*given)
    before = [copy_of(each) for each in learner.averages]
    trace = random_trace(16, 8)

    learner.learn(trace, np.zeros_like(trace.actions), 0.3, 1e-3)

    networks = (learner.policy, learner.value)
    for average, start, now in zip(learner.averages, before, networks, strict=True):
        assert (now.weights_3 != start.weights_3).any()
        for mean, first, last in zip(average, start, now, strict=True):
            np.testing.assert_allclose(mean, 0.5 * (first + last), atol=1e-6)


def least_of(learner: Learner, trace: Trace, lows: Mapping[tuple[int, int], int]) -> bool:
    """Whether low states count: entries of a trace, world and first decision, so many of them."""
    states = np.random.default_rng(6).normal(size=(50, 4)).astype(np.float32)
    values = forward(learner.value, states)[0][:, 0]
    trace.observations[:] = states[values.argmax()]
    for (world, first), count in lows.items():
        trace.observations[world, first : first + count] = states[values.argmin()]
    learner.value.bias_3[:] += np.float32(0.5) - values.min()  # above the least that is told
    learner.take(learner.policy, learner.value)
    return learner.least_expected(trace) < 0.5 + 0.5 * float(np.ptp(values))


@pytest.mark.parametrize(
    ("ends", "lows", "counts"),
    [
        ({(0, 99): FELL}, {(0, 70): 30}, False),
        ({(0, 99): FELL}, {(0, 55): 15}, True),  # more than a second before
        ({(0, 99): FELL}, {(1, 50): 20}, True),  # another world's
        ({(0, 69): CUT, (0, 71): FELL}, {(0, 50): 20}, True),  # another episode's
        ({}, {(0, 50): 20}, True),
        ({}, {(0, 70): 30, (1, 70): 30}, False),  # nobody knows what follows
        ({(0, each): FELL for each in range(20, 100, 20)}, {(0, 0): 100}, False),
        ({(w, each): FELL for w in (0, 1) for each in range(9, 100, 10)}, {(0, 0): 100}, True),
    ],
)
def test_states_that_lead_to_a_fall_are_none_of_a_calm_motion(
    learner: Learner,
    ends: Mapping[tuple[int, int], int],
    lows: Mapping[tuple[int, int], int],
    counts: bool,
) -> None:
    """Those of the second before, of the same episode; where there are no others, all count."""
    trace = random_trace(2, 100)
    trace.ends[:] = 0
    for entry, end in ends.items():
        trace.ends[entry] = end

    assert least_of(learner, trace, lows) == counts
