"""What the table of steering says is what the commands prescribe, and what a root has done."""

import math

import numpy as np
import pytest

from benchmarks.planner.steering import DRIVEN, EIGHT_LASTS, Task, _plan, _stopped
from controller_node.references.steering.reference import SteeredReference

RATE = 240


def reference_of(task: Task) -> SteeredReference:
    reference = _plan(task).reference
    assert isinstance(reference, SteeredReference)
    return reference


def test_the_eight_is_a_circle_to_the_left_and_one_to_the_right_walked_and_run() -> None:
    reference = reference_of(Task(1, True, ()))
    ticks = range(0, round(EIGHT_LASTS * RATE), RATE // 10)
    courses = [reference.course(tick) for tick in ticks]

    turned = np.unwrap([each.heading for each in courses])
    ends = [turned[round(10 * time)] for time in (1.0, 16.7, 32.4, 41.4, 50.4)]
    full = 2.0 * math.pi
    assert np.diff(ends) == pytest.approx([full, -full, full, -full], abs=0.7)  # at 1.5 rad/s^2
    assert max(each.forward for each in courses[:300]) == pytest.approx(1.0)
    assert max(each.forward for each in courses) == pytest.approx(2.2)
    assert (courses[0].forward, courses[-1].forward) == (0.0, 0.0)


def test_the_stop_is_from_the_largest_speed_and_by_the_timeout() -> None:
    reference = reference_of(Task(1, False, ()))
    silent = DRIVEN + reference.limits.timeout

    assert reference.course(round(silent * RATE)).forward == pytest.approx(2.5)
    stands = silent + 2.5 / reference.limits.braking
    assert reference.course(round(stands * RATE) - 2).forward > 0.0
    assert reference.course(round(stands * RATE) + 2).forward == 0.0


def test_a_root_has_stopped_when_it_is_slow_for_good() -> None:
    time = np.arange(4 * RATE) / RATE
    speed = np.clip(2.5 - 1.25 * time, 0.0, None)  # it stands after 2 s
    roots = np.column_stack((np.cumsum(speed) / RATE, np.zeros(len(time))))

    # the mean over the quarter of a second around 1.88 s is that at 1.88 s: 0.15 m/s
    assert _stopped(roots, RATE) == pytest.approx(1.88, abs=0.02)
    assert _stopped(roots[:RATE], RATE) == math.inf
    assert _stopped(np.zeros((RATE, 2)), RATE) == 0.0
