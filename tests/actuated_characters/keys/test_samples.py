"""Moments halfway between frames, tolerances of vectors, and coordinates that pass turns."""

import math

import numpy as np
import pytest

from actuated_characters.keys.samples import (
    Samples,
    Tolerances,
    half_frames,
    moved,
    spatial_difference,
    unrolled,
)
from msgs_config.character.layout import JointLayout, JointType
from msgs_config.errors import ConfigurationError

LAYOUT = JointLayout(
    [
        ("root", JointType.FLOATING),
        ("hinge", JointType.REVOLUTE),
        ("slider", JointType.PRISMATIC),
        ("ball", JointType.SPHERICAL),
    ]
)


def test_each_vector_has_the_tolerance_of_its_unit() -> None:
    assert Tolerances(angle=2.0, place=1.0).of_vectors(LAYOUT).tolist() == [1, 2, 2, 1, 2]


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_a_tolerance_is_positive(value: float) -> None:
    with pytest.raises(ConfigurationError, match=r"--angle is .*; it must be more than 0"):
        Tolerances(angle=value)


def test_halfway_between_two_frames_half_of_the_turn_is_done() -> None:
    position = np.zeros((2, LAYOUT.size))
    position[1, LAYOUT.rotation_entries[1]] = (0.0, 1.2, 0.0)
    position[1, 0] = 0.4

    samples = half_frames(LAYOUT, np.array([0.0, 0.1]), LAYOUT.configuration(position))

    assert samples.times.tolist() == pytest.approx([0.0, 0.05, 0.1])
    middle = samples.configurations.position[1]
    assert middle[LAYOUT.rotation_entries[1]] == pytest.approx([0.0, 0.6, 0.0])
    assert middle[0] == pytest.approx(0.2)


def test_a_difference_leads_from_one_configuration_to_the_other() -> None:
    rng = np.random.default_rng(2)
    start, end = (LAYOUT.configuration(rng.normal(size=(5, LAYOUT.size))) for _ in range(2))

    reached = moved(LAYOUT, start, spatial_difference(LAYOUT, start, end))

    assert LAYOUT.difference(reached, end) == pytest.approx(0.0, abs=1e-12)


def test_three_turns_are_three_turns() -> None:
    times = np.linspace(0.0, 1.0, 61)
    position = np.zeros((61, LAYOUT.size))
    position[:, LAYOUT.rotation_entries[1, 2]] = 6.0 * math.pi * times

    coordinates = unrolled(LAYOUT, Samples(times, LAYOUT.configuration(position)))

    assert coordinates[-1, LAYOUT.rotation_entries[1]] == pytest.approx([0.0, 0.0, 6.0 * math.pi])
