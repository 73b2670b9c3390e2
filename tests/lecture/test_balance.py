"""The study of balance: what it calls standing, its bisection, and what the lecture expects."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lecture import balance
from lecture.framework.study import RunResult, RunSpec
from msgs_config.geometry import rotations
from tests.support.in_process import InProcessRunner

pytestmark = pytest.mark.slow


class Weakling:
    """A runner in which every character that is pushed harder than by an impulse lies down."""

    def __init__(self, outcome: RunResult, impulse: float) -> None:
        self._outcome = outcome
        self._impulse = impulse
        self.impulses: list[float] = []

    def run(self, case: RunSpec) -> RunResult:
        impulse = sum(np.linalg.norm(push.wrench[:3]) for push in case.pushes) * 0.1
        self.impulses.append(impulse)
        if impulse <= self._impulse:
            return self._outcome
        run = self._outcome.recording
        down = run.position.copy()
        down[-1, 2] = 0.1
        return replace(self._outcome, recording=replace(run, position=down))

    def path(self, name: str) -> Path:
        raise AssertionError("it needs no file")


@pytest.fixture(scope="module")
def stood(runner: InProcessRunner) -> RunResult:
    return runner.run(balance._case("stand", 2.0))


def test_it_stands_by_joint_efforts_alone(stood: RunResult) -> None:
    assert balance.survives(stood)
    assert balance.standing_time(stood.recording) == pytest.approx(2.0, abs=0.01)
    assert not stood.recording.effort[:, :6].any()


def test_without_the_virtual_force_it_falls(runner: InProcessRunner) -> None:
    outcome = runner.run(balance._case("without", 2.0, {"balance.enabled": False}))

    assert not balance.survives(outcome)
    assert 0.5 < balance.standing_time(outcome.recording) < 2.0


@pytest.mark.parametrize(("x", "y"), balance._DIRECTIONS.values(), ids=balance._DIRECTIONS)
def test_a_push_has_its_impulse_and_its_direction(
    runner: InProcessRunner, x: float, y: float
) -> None:
    run = runner.run(balance._case("pushed", 1.2, impulse=(6.0 * x, 6.0 * y))).recording

    wrenches = [w.wrenches[0, :2] for w in run.applied_wrench if w is not None and len(w.links)]
    assert np.sum(wrenches, axis=0) / 240.0 == pytest.approx([6.0 * x, 6.0 * y], rel=1e-9)


@pytest.mark.parametrize("bearable", [0.3, 7.0, 12.6, 31.9])
def test_bisection_finds_the_largest_impulse(stood: RunResult, bearable: float) -> None:
    runner = Weakling(stood, bearable)

    limit = balance._largest_impulse(runner, "left")

    assert limit.survived <= bearable < limit.fell
    assert limit.fell - limit.survived <= 0.5
    assert len(runner.impulses) <= balance.RUNS / 4


def test_a_character_on_its_back_has_not_survived(stood: RunResult) -> None:
    run = stood.recording
    position = run.position.copy()
    backwards = rotations.exp(np.array((0.0, -1.5, 0.0)))
    position[-1, 3:6] = rotations.log(
        rotations.multiply(backwards, rotations.exp(position[-1, 3:6]))
    )

    fallen = replace(stood, recording=replace(run, position=position))

    assert balance.is_upright(run)
    assert not balance.survives(fallen)


def test_the_time_until_the_fall_is_that_of_the_last_state_that_stood(stood: RunResult) -> None:
    position = stood.recording.position.copy()
    position[100:, 2] = 0.3

    fallen = replace(stood.recording, position=position)

    assert balance.standing_time(fallen) == fallen.times[99]
