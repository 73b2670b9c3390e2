"""The fewest keys of motions whose fewest keys are known, and of some that are not."""

import itertools
import math

import numpy as np
import pytest

from actuated_characters.keys.fewest import fewest_keys
from actuated_characters.keys.samples import Samples, Tolerances, half_frames
from actuated_characters.keys.written import FewestKeys
from controller_node.references.keyframes import KeyframesReference
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout, JointType

LAYOUT = JointLayout([("root", JointType.FLOATING), ("hinge", JointType.REVOLUTE)])
FREE = (np.full(LAYOUT.size, -np.inf), np.full(LAYOUT.size, np.inf))
TIMES = np.linspace(0.0, 2.0, 121)
HINGE = LAYOUT.joint("hinge").start


def samples_of(positions: FloatArray) -> Samples:
    return half_frames(LAYOUT, TIMES, LAYOUT.configuration(positions))


def hinge(values: FloatArray) -> Samples:
    positions = np.zeros((len(TIMES), LAYOUT.size))
    positions[:, HINGE] = values
    return samples_of(positions)


def check(found: FewestKeys, samples: Samples, tolerances: Tolerances) -> None:
    """What the reference of a run is at each sample, measured anew."""
    reference = KeyframesReference(LAYOUT, found.keyframes)
    for row, time in enumerate(samples.times.tolist()):
        if found.keyframes.period is not None and row == len(samples.times) - 1:
            continue  # the next period begins
        state = reference.sample(time).configuration
        there = samples.configurations
        turned = abs(float(state.orientations_xyzw[0] @ there.orientations_xyzw[row, 0]))
        assert 2.0 * math.acos(min(turned, 1.0)) <= tolerances.angle + 1e-7
        assert abs(state.position[HINGE] - there.position[row, HINGE]) <= tolerances.angle
        away = np.linalg.norm(state.position[:3] - there.position[row, :3])
        assert away <= tolerances.place


def test_what_is_still_has_two_keys() -> None:
    found = fewest_keys(LAYOUT, hinge(np.full(121, 0.3)), Tolerances(), bounds=FREE)

    assert found.keyframes.times.tolist() == [0.0, 2.0] and found.error == 0.0


def test_a_quintic_from_rest_to_rest_has_two_keys() -> None:
    u = TIMES / 2.0
    samples = hinge(2.0 * u**3 * (10.0 - 15.0 * u + 6.0 * u * u))

    found = fewest_keys(LAYOUT, samples, Tolerances(), bounds=FREE)

    assert len(found.keyframes.times) == 2
    check(found, samples, Tolerances())


def test_a_motion_that_begins_and_ends_fast_needs_one_key_between_its_ends() -> None:
    samples = hinge(3.0 * TIMES)  # rad/s

    found = fewest_keys(LAYOUT, samples, Tolerances(), bounds=FREE)

    check(found, samples, Tolerances())
    assert len(found.keyframes.times) <= 3
    assert found.keyframes.velocities is not None
    assert found.keyframes.velocities[:, HINGE].min() > 1.5  # rad/s, also at both ends


def test_a_turn_about_changing_axes_is_kept() -> None:
    positions = np.zeros((len(TIMES), LAYOUT.size))
    positions[:, 0] = np.sin(2.0 * TIMES)
    positions[:, 3] = 2.5 * np.sin(3.0 * TIMES)
    positions[:, 4] = 2.0 * np.cos(2.0 * TIMES)
    positions[:, 5] = TIMES
    samples = samples_of(positions)

    found = fewest_keys(LAYOUT, samples, Tolerances(), bounds=FREE)

    check(found, samples, Tolerances())
    assert len(found.keyframes.times) <= 121 / 10


@pytest.mark.slow
def test_a_larger_tolerance_needs_fewer_keys() -> None:
    samples = hinge(np.sin(9.0 * TIMES) + 0.2 * np.sin(31.0 * TIMES))
    counts = []
    for angle in (0.01, 0.05, 0.3):
        tolerances = Tolerances(angle)
        found = fewest_keys(LAYOUT, samples, tolerances, bounds=FREE)
        check(found, samples, tolerances)
        counts.append(len(found.keyframes.times))

    assert counts == sorted(counts, reverse=True) and len(set(counts)) == 3


def test_a_loop_goes_on_with_the_speed_that_it_had() -> None:
    positions = np.zeros((len(TIMES), LAYOUT.size))
    positions[:, HINGE] = np.sin(2.0 * math.pi * TIMES)
    positions[:, 0] = 0.3 * np.cos(math.pi * TIMES)
    positions[:, 3] = 0.6 * np.cos(math.pi * TIMES)
    positions[:, 4] = 0.6 * np.sin(math.pi * TIMES)
    samples = samples_of(positions)

    found = fewest_keys(LAYOUT, samples, Tolerances(), bounds=FREE, loops=True)

    assert found.keyframes.period == 2.0
    check(found, samples, Tolerances())
    reference = KeyframesReference(LAYOUT, found.keyframes)
    before, after = reference.sample(2.0 - 1e-6), reference.sample(2.0 + 1e-6)
    assert before.velocity == pytest.approx(after.velocity, abs=1e-2)
    assert before.velocity[HINGE] == pytest.approx(2.0 * math.pi, rel=0.3)
    assert len(found.keyframes.times) <= 8


def test_keys_stay_within_limits() -> None:
    values = np.maximum(np.sin(5.0 * TIMES), 0.0)
    bounds = (FREE[0].copy(), FREE[1].copy())
    bounds[0][HINGE], bounds[1][HINGE] = 0.0, 0.99995
    samples = hinge(np.minimum(values, 0.99995))

    found = fewest_keys(LAYOUT, samples, Tolerances(), bounds=bounds)

    at_keys = found.keyframes.configurations.position[:, HINGE]
    assert at_keys.min() >= 0.0 and at_keys.max() <= 0.99995
    check(found, samples, Tolerances())


@pytest.mark.slow
def test_frames_too_far_apart_get_keys_between_them() -> None:
    values = np.where(np.arange(121) % 2, 0.8, -0.8)
    samples = hinge(values)

    found = fewest_keys(LAYOUT, samples, Tolerances(), bounds=FREE)

    check(found, samples, Tolerances())


def test_the_same_motion_gives_the_same_keys() -> None:
    samples = hinge(np.sin(9.0 * TIMES))

    first, second = (
        fewest_keys(LAYOUT, samples, Tolerances(), bounds=FREE).keyframes for _ in range(2)
    )

    assert first.times.tobytes() == second.times.tobytes()
    assert first.configurations.position.tobytes() == second.configurations.position.tobytes()
    assert first.velocities is not None and second.velocities is not None
    assert first.velocities.tobytes() == second.velocities.tobytes()


def test_progress_grows_to_the_end() -> None:
    shares: list[float] = []

    fewest_keys(
        LAYOUT, hinge(np.sin(9.0 * TIMES)), Tolerances(), bounds=FREE, progress=shares.append
    )

    assert all(a <= b for a, b in itertools.pairwise(shares)) and 0.0 < shares[-1] <= 1.0
