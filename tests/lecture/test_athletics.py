"""What the study `athletics` measures: flights, courses, and the limits of pushes."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from actuated_characters.metrics.recording_metrics import has_fallen
from lecture.athletics import _case
from lecture.athletics.measures import (
    commanded,
    loaded,
    longest_flight,
    taken,
)
from lecture.athletics.pushes import LARGEST, push_map
from lecture.framework.study import RunResult, RunSpec
from tests.support.in_process import InProcessRunner

WALK = {"behaviour": "state_machine", "machine": "walk"}
JUMP = {"behaviour": "state_machine", "machine": "jump"}


def test_a_commanded_course_is_that_of_the_reference() -> None:
    course = commanded(_case("walk", 4.0, WALK, "0.5,0,0.2@1 0,0,0@3"))

    assert course.speed[2 * 240] == 0.5 and course.speed[-1] == 0.0
    assert course.heading[0] == 0.0
    # 0.2 rad/s for two seconds; it begins and ends at a limited rate, which makes up for itself
    assert course.heading[-1] == pytest.approx(0.4, abs=0.01)


class Bears:
    """A runner of a character that bears an impulse in N s ahead, and half of it elsewhere."""

    fine = False

    def __init__(self, impulse: float) -> None:
        self._impulse = impulse
        self.cases: list[RunSpec] = []

    def run(self, case: RunSpec) -> RunResult:
        """A recording that says whether it fell."""
        self.cases.append(case)
        (push,) = case.pushes
        x, y, *_ = push.wrench
        size = math.hypot(x, y) * float(str(case.simulator["wrench_duration"]))
        most = self._impulse * (1.0 if x > abs(y) else 0.5)
        recording: Any = SimpleNamespace(fell=size > most)
        return RunResult(recording, {})

    def path(self, name: str) -> Any:
        """It needs no files."""
        raise NotImplementedError(name)


def fell(recording: Any) -> bool:
    return bool(recording.fell)


def test_a_push_map_brackets_what_is_borne_in_each_direction() -> None:
    runner = Bears(30.0)

    found = push_map(runner, _case("walk", 6.0, WALK), 3.0, 4, 5, fell)

    limits = np.array([30.0, 15.0, 15.0, 15.0])
    assert (np.array(found.survived) <= limits).all() and (limits < np.array(found.fell)).all()
    np.testing.assert_allclose(np.subtract(found.fell, found.survived), LARGEST / 2**5)
    assert len(runner.cases) == len({case.label for case in runner.cases}) == 20
    # to the left is to the left
    np.testing.assert_allclose(found.along([1.0, 2.0, 3.0, 4.0], 0), [0, -2, 0, 4, 0], atol=1e-12)
    np.testing.assert_allclose(found.along([1.0, 2.0, 3.0, 4.0], 1), [1, 0, -3, 0, 1], atol=1e-12)


@pytest.mark.slow
def test_a_jump_has_one_flight_and_goes_nowhere(runner: InProcessRunner) -> None:
    run = runner.run(_case("jump", 3.0, JUMP)).recording

    start, flight = longest_flight(run)

    assert 1.6 < start < 1.9 and 0.25 < flight < 0.4
    # a body in the air goes on as it was; its root is highest about the middle
    top = float(run.times[int(np.argmax(run.position[run.times > 1.0, 2]))]) + 1.0
    assert start < top < start + flight
    assert not has_fallen(run)
    assert np.abs(taken(run).heading).max() < 0.1
    assert np.abs(taken(run).speed[run.times > 2.9]).max() < 0.1


@pytest.mark.nightly
@pytest.mark.slow
def test_a_run_has_a_flight_in_each_step(runner: InProcessRunner) -> None:
    case = _case("run", 8.0, {"behaviour": "state_machine", "machine": "run"}, "2,0,0@0.2")
    run = runner.run(case).recording

    flies = loaded(run)[6 * 240 :].sum(axis=1) == 0

    assert 0.1 < flies.mean() < 0.4
    assert np.count_nonzero(np.diff(flies.astype(int)) == 1) > 4  # flights in two seconds
    assert taken(run).speed[7 * 240] > 1.7
