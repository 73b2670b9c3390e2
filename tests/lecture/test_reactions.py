"""The study `reactions`: what hits do, measured by the run without them."""

from dataclasses import replace

import numpy as np
import pytest

from lecture.framework.result import StudyResult
from lecture.framework.study import RunSpec
from lecture.reactions import HIT, IMPULSES, lost_momentum, measure
from msgs_config.messages.projectiles import BallStates, ball_names
from msgs_config.messages.throw import ProjectileThrow
from tests.support.in_process import InProcessRunner

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

GRAVITY = 9.81


@pytest.fixture(scope="module")
def result(runner: InProcessRunner) -> StudyResult:
    return runner.study("reactions")


@pytest.mark.nightly
def test_the_measured_impulses_are_about_those_that_were_planned(result: StudyResult) -> None:
    measured = np.array(result.column("measured impulse (N s)"))

    # without restitution a ball loses all that it has, less what the chest takes along
    np.testing.assert_allclose(measured, IMPULSES, rtol=0.15)


@pytest.mark.nightly
def test_the_harder_the_hit_the_farther_the_root_gives_way(result: StudyResult) -> None:
    peaks = result.column("largest displacement of the root (m)")

    assert peaks == sorted(peaks) and len(set(peaks)) == len(IMPULSES)


@pytest.mark.nightly
def test_it_is_back_within_two_seconds_if_it_does_not_fall(result: StudyResult) -> None:
    back = result.column("back on the clip (s)")

    assert max(back[:-1]) <= 2.0 and back[-1] > 2.0
    *limp, longest = result.column("LIMP (s)")
    assert limp == [0.0] * 3 and longest > 0.5
    assert min(result.column("REACT (s)")[:-1]) > 0.0


@pytest.mark.nightly
def test_the_pictures_are_there(result: StudyResult) -> None:
    kinds = ("ragdoll", "active_ragdoll", "reactive")
    assert set(result.figures) == {"reactions", *(f"reactions_{kind}" for kind in kinds)}


@pytest.mark.nightly
def test_the_captured_motion_is_above_its_reaction(result: StudyResult) -> None:
    captured, reaction = result.figures["reactions_reactive"].axes

    assert captured.get_title("center") == "the captured motion"
    above, below = (np.asarray(axes.images[0].get_array()) for axes in (captured, reaction))
    assert above.shape == below.shape
    black = [(picture.max(axis=2) < 70).sum() for picture in (above, below)]
    # both have the captions' letters; no captured motion has the ball
    assert black[1] > 5 * black[0]


def test_a_ball_that_hits_nothing_loses_no_momentum(runner: InProcessRunner) -> None:
    run = runner.run(RunSpec("past", "pendulum", 1.2)).recording
    throw = ProjectileThrow(3.0, 0.1, (0.0, 0.0, 9.0), (2.0, 0.0, 0.0))
    falls = np.zeros((len(run.times), 13))
    falls[:, 7], falls[:, 9] = 2.0, -GRAVITY * run.times
    states = [
        BallStates(stamp, ball_names([throw]), row[np.newaxis])
        for stamp, row in zip(run.stamps_ns.tolist(), falls, strict=True)
    ]
    thrown = replace(run, throws=((throw,), *[()] * (len(run.times) - 2)), balls=tuple(states))

    assert lost_momentum(thrown, HIT) == pytest.approx(0.0, abs=1e-9)


def test_without_a_hit_the_root_gives_way_nowhere_and_is_back_at_once(
    runner: InProcessRunner,
) -> None:
    case = RunSpec("walk", "humanoid", 1.5, reference={"reference": "clip", "clip": "walk"})
    run = runner.run(case).recording
    size = len(run.effort)
    unseen = ProjectileThrow(1.0, 0.1, (0.0, 0.0, 9.0), (0.0, 0.0, 0.0))
    run = replace(run, throws=((unseen,), *[()] * (size - 1)), balls=(None,) * (size + 1))

    reaction = measure(run, run, HIT)

    assert (reaction.peak, reaction.back, reaction.impulse) == (0.0, 0.0, 0.0)
