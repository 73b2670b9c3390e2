"""A policy of many clips learns from policies of single ones."""

from dataclasses import replace

import numpy as np
import pytest

from actuated_characters.training.episode_types import Taught, Trace
from actuated_characters.training.exercises import Exercise
from actuated_characters.training.job import make_job, taught_by
from actuated_characters.training.learner import Learner, LearningSettings, Lesson, forward
from actuated_characters.training.starts import StartRange
from actuated_characters.training.teachers import Teachers, heard
from actuated_characters.training.training import Training
from controller_node.planner.compiled.observation import ObservationScales
from controller_node.planner.policy.file import read_policy
from msgs_config.errors import ConfigurationError
from tests.support.training import HUMANOID, make_small, walking_job

WALK, RUN = (read_policy(name, HUMANOID) for name in ("walk", "run"))
RANGES = [StartRange(0, 10, wraps=True), StartRange(50, 20, wraps=False)]


def observed(scales: ObservationScales, count: int) -> np.ndarray:
    """What is told of some states, the same ones each time, by scales."""
    rng, own = np.random.default_rng(2), WALK.scales
    deviation = 0.3 * own.deviation * rng.normal(size=(count, own.deviation.size))
    draws = rng.normal(size=(count, *own.frame_mean.shape))
    frames = own.frame_mean + 0.3 * own.frame_scale * draws
    told = (frames - scales.frame_mean) / scales.frame_scale
    rows: np.ndarray = np.hstack([deviation / scales.deviation, told.reshape(count, -1)])
    return rows.astype(np.float32)


def other_scales() -> ObservationScales:
    rng, own = np.random.default_rng(3), WALK.scales
    return own._replace(
        deviation=own.deviation * rng.uniform(1.0, 2.0, own.deviation.shape),
        frame_mean=own.frame_mean + 0.2 * rng.normal(size=own.frame_mean.shape),
        frame_scale=own.frame_scale * rng.uniform(3.0, 5.0, own.frame_scale.shape),
    )


def test_a_teacher_understands_what_is_told_by_other_scales() -> None:
    teachers = Teachers([WALK], RANGES[:1], other_scales())

    taught = teachers.answer(observed(other_scales(), 50), np.zeros(50, np.intp), 0.7)

    assert taught is not None
    expected, _ = forward(WALK.network, observed(WALK.scales, 50))
    assert np.abs(expected).max() > 0.3
    np.testing.assert_allclose(taught.actions, expected, atol=1e-4)
    np.testing.assert_array_equal(taught.shares, np.float32(0.7))


def test_each_teacher_speaks_of_its_own_reference_alone() -> None:
    rows = np.array([3, 55, 49, 90], dtype=np.intp)
    observations = observed(WALK.scales, 4)
    teachers = Teachers([None, RUN], RANGES, WALK.scales)

    taught = teachers.answer(observations, rows, 1.0)

    assert taught is not None
    np.testing.assert_array_equal(taught.shares, [0.0, 1.0, 0.0, 1.0])
    alone = Teachers([RUN], RANGES[:1], WALK.scales).answer(observations, rows, 1.0)
    assert alone is not None
    np.testing.assert_allclose(taught.actions[[1, 3]], alone.actions[[1, 3]], atol=1e-6)


def test_without_a_teacher_nothing_is_said() -> None:
    rows, observations = np.zeros(4, np.intp), observed(WALK.scales, 4)

    assert Teachers([None], RANGES, WALK.scales).answer(observations, rows, 1.0) is None


def test_they_are_heard_alone_at_first_then_less_and_less() -> None:
    course = [heard(share) for share in np.linspace(0.0, 1.0, 11)]

    assert course[0] == course[5] == 1.0
    assert course[10] < heard(0.8) < 1.0
    assert 0.0 < course[10] < 0.5
    assert sorted(course, reverse=True) == course


def test_the_slope_is_between_what_was_tried_and_what_was_taught() -> None:
    rng = np.random.default_rng(6)
    learner = Learner((4, 8, 2), rng, LearningSettings())
    count, part = 30, np.arange(30)
    plain = Lesson(
        np.zeros((count, 4), np.float32),
        rng.normal(size=(count, 2)).astype(np.float32),
        np.full(count, -1.0, np.float32),
        rng.normal(size=count).astype(np.float32),
        np.zeros(count, np.float32),
    )
    means = (plain.actions + 0.1 * rng.normal(size=(count, 2))).astype(np.float32)
    wanted = rng.normal(size=(count, 2)).astype(np.float32)
    shares = rng.random(count).astype(np.float32)
    shares[:5] = 0.0

    tried = learner._slope(plain, part, means, np.float32(3.0))
    both = learner._slope(
        replace(plain, taught=Taught(wanted, shares)), part, means, np.float32(3.0)
    )
    learner.close()

    # half the mean square of what is off has this slope
    imitated = (means - wanted) / count
    expected = (1.0 - shares[:, np.newaxis]) * tried + shares[:, np.newaxis] * imitated
    np.testing.assert_allclose(both, expected, atol=1e-6)
    np.testing.assert_array_equal(both[:5], tried[:5])


@pytest.mark.nightly
def test_a_pupil_comes_to_answer_as_its_teacher() -> None:
    observations = observed(WALK.scales, 8 * 96).reshape(8, 96, -1)
    rows, flat = np.zeros(8 * 96, np.intp), observations.reshape(8 * 96, -1)
    taught = Teachers([WALK], RANGES, WALK.scales).answer(flat, rows, 1.0)
    assert taught is not None
    rng, shape = np.random.default_rng(1), (8, 96)
    learner = Learner((flat.shape[1], 128, len(WALK.unit)), rng, LearningSettings())
    tried = rng.normal(size=(*shape, len(WALK.unit))).astype(np.float32)
    nothing, none = np.zeros(shape), np.zeros(shape, np.intp)
    trace = Trace(observations, observations, tried, rng.random(shape), nothing, none, none, none)

    def off() -> float:
        return float(np.abs(forward(learner.policy, flat)[0] - taught.actions).mean())

    before = off()
    for _ in range(50):
        learner.learn(trace, np.zeros_like(tried), 0.5, 1e-3, taught)
    learner.close()

    assert off() < 0.3 * before


def test_a_training_has_its_pupil_taught(monkeypatch: pytest.MonkeyPatch) -> None:
    make_small(monkeypatch)
    job = walking_job()
    pupils = []
    for own in (job, replace(job, teachers=(None,)), taught_by(job, [WALK])):
        training = Training(own)
        training.go_on()
        training.close()
        pupils.append(training._learner.policy.weights_1.tobytes())

    alone, without, taught = pupils
    assert alone == without != taught


def test_a_policy_says_whom_it_imitated_and_how_wide_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    make_small(monkeypatch)
    clips = [Exercise("humanoid", name) for name in ("walk", "spin", "run")]
    job = taught_by(make_job(clips, {}, decisions=64, hidden=24), [RUN, WALK])
    training = Training(job)
    training.go_on()
    training._look()
    training.close()

    policy = training.best({})

    assert [each and each.about["clips"] for each in job.teachers] == [["walk"], None, ["run"]]
    assert policy.about["trained"]["imitated"] == ["walk", "run"]
    assert policy.network.weights_2.shape == (24, 24)


def test_what_was_learnt_alone_is_not_imitated_away_where_a_training_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    make_small(monkeypatch)
    job = taught_by(walking_job(), [WALK])
    first = Training(job)
    while not first.is_over:
        first.go_on()
    first.close()

    longer = replace(job, decisions=100 * job.decisions)
    resumed = Training(longer, first.best({}), resumes=True)
    alone = Training(replace(longer, teachers=()), first.best({}), resumes=True)
    for each in (resumed, alone):
        each.close()

    assert first.best({}).about["trained"]["heard"] < 1.0
    assert resumed._heard == first.best({}).about["trained"]["heard"]
    assert alone._heard == 0.0
    assert alone.best({}).about["trained"]["imitated"] == ["walk"]
    assert alone._spread_and_rate()[0] == resumed._spread_and_rate()[0]


def test_a_policy_that_is_steered_otherwise_is_not_imitated() -> None:
    steered = read_policy("steered", HUMANOID)
    job = replace(walking_job(), names=("steered",), gait=("run", "walk"))

    assert taught_by(job, [steered]).teachers == (steered,)
    with pytest.raises(ConfigurationError, match="was steered by run, walk; here it is by crawl"):
        taught_by(replace(job, gait=("crawl",)), [steered])
