"""When a point stands on the ground, of points whose ways are written down."""

import numpy as np
import pytest

from character_motion.retargeting.contacts import (
    Contact,
    find_contacts,
    joined,
    mask,
    smoothed,
)
from msgs_config.arrays import FloatArray

RATE = 100.0


def steps(height: float = 0.15, slip: float = 0.0) -> FloatArray:
    """A foot (f, 3) that stands for 0.5 s, swings ahead by 0.6 m in 0.4 s, and stands again."""
    time = np.arange(0.0, 1.4, 1.0 / RATE)
    phase = np.clip((time - 0.5) / 0.4, 0.0, 1.0)
    smooth = phase**2 * (3.0 - 2.0 * phase)
    x = 0.6 * smooth + slip * np.where(phase == 0.0, time, 0.5)
    z = 0.08 + height * np.sin(np.pi * phase) ** 2
    return np.stack((x, np.zeros_like(x), z), axis=-1)


def test_a_foot_stands_until_it_swings_and_after() -> None:
    first, second = find_contacts(steps(), 0.08, 1.0 / RATE)

    assert first.first == 0 and first.last == pytest.approx(50, abs=7)
    assert second.first == pytest.approx(90, abs=7) and second.last == 139


def test_a_foot_over_the_ground_does_not_stand() -> None:
    assert find_contacts(steps() + np.array((0.0, 0.0, 0.1)), 0.08, 1.0 / RATE) == ()


def test_a_foot_that_slides_along_stands_where_it_is_slow_alone() -> None:
    contacts = find_contacts(steps(slip=0.35), 0.08, 1.0 / RATE)

    for contact in contacts:
        places = steps(slip=0.35)[contact.frames, 0]
        assert np.ptp(places) <= 0.11  # within 5 cm of the middle


def test_short_breaks_are_none_and_short_contacts_neither() -> None:
    touches = np.zeros(100, dtype=np.bool_)
    touches[10:30] = touches[33:50] = touches[80:83] = True

    assert joined(touches, 0.01) == (Contact(10, 49),)
    assert mask((Contact(10, 49),), 100).sum() == 40


def test_noise_goes_and_a_line_stays() -> None:
    line = np.linspace(0.0, 1.0, 200)[:, np.newaxis] * np.ones(3)
    noise = np.random.default_rng(1).normal(0.0, 0.01, line.shape)

    np.testing.assert_allclose(smoothed(line, 0.01)[10:-10], line[10:-10], atol=1e-12)
    assert smoothed(noise, 0.01).std() < 0.005
