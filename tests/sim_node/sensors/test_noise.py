"""Noise has the statistics that are stated, and is a function of tick, seed and name."""

import math

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.sensors import Noise
from sim_node.sensors.noise import NoiseSource

RATE = 240


def draws(noise: Noise, ticks: int, name: str = "imu.rate", seed: int = 1) -> FloatArray:
    source = NoiseSource(noise, seed, name, 1.0 / RATE)
    return np.array([source.at(tick) for tick in range(1, ticks + 1)])


def test_white_noise_has_the_deviation_stated_and_no_correlation() -> None:
    stddev = (0.1, 2.0, 0.0)

    found = draws(Noise(stddev=stddev), 20_000)

    assert found.std(axis=0) == pytest.approx(stddev, rel=0.03)
    assert found.mean(axis=0) == pytest.approx(np.zeros(3), abs=0.05)
    x, y = found[:, 0] / 0.1, found[:, 1] / 2.0
    for a, b in ((x, y), (x[:-1], x[1:]), (y[:-1], y[1:])):
        assert abs(np.mean(a * b)) < 0.03
    assert np.mean(x**4) == pytest.approx(3.0, rel=0.1)  # a normal distribution's


def test_a_bias_is_what_is_stated_and_one_that_is_drawn_is_constant() -> None:
    constant = draws(Noise(bias=(1.0, 2.0, 3.0)), 5)
    assert constant.tolist() == [[1.0, 2.0, 3.0]] * 5

    drawn = np.array([draws(Noise(bias_stddev=(0.5,) * 3), 2, seed=seed) for seed in range(1500)])
    assert (drawn[:, 0] == drawn[:, 1]).all()
    assert drawn.std() == pytest.approx(0.5, rel=0.05)


def test_a_bias_walks_by_independent_steps_of_equal_deviation() -> None:
    ticks = 3000

    walks = np.concatenate(
        [draws(Noise(bias_walk=(0.2,) * 3), ticks, seed=seed) for seed in range(6)], axis=1
    )

    steps = np.diff(walks, axis=0, prepend=0.0)
    deviation = 0.2 / math.sqrt(RATE)
    assert steps.std() == pytest.approx(deviation, rel=0.02)
    assert steps[:16].std() == pytest.approx(deviation, rel=0.2)  # from the beginning on
    assert steps[2047].std() == pytest.approx(deviation, rel=0.5)  # at a power of two
    for lag in (1, 2, 3, 64):
        correlation = np.mean(steps[lag:] * steps[:-lag]) / deviation**2
        assert abs(correlation) < 0.03, lag


def test_noise_depends_on_tick_seed_and_name_alone() -> None:
    noise = Noise(stddev=(1.0,) * 3, bias_stddev=(1.0,) * 3, bias_walk=(1.0,) * 3)
    all_ticks = draws(noise, 300)

    late = NoiseSource(noise, 1, "imu.rate", 1.0 / RATE)
    assert [late.at(tick) for tick in (300, 7, 128)] == [
        tuple(all_ticks[tick - 1]) for tick in (300, 7, 128)
    ]
    assert not np.isin(all_ticks, draws(noise, 300, seed=2)).any()
    assert not np.isin(all_ticks, draws(noise, 300, name="imu.force")).any()
