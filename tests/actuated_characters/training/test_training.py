"""The course of a training: reproducible, resumable, ever harder pushes, and the best is kept."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from actuated_characters.training import exercises
from actuated_characters.training import training as module
from actuated_characters.training.episode_types import FELL, Trace
from actuated_characters.training.exercises import Exercise
from actuated_characters.training.job import Job, check_resumed, check_start, make_job
from actuated_characters.training.training import Look, Training
from controller_node.planner.policy.file import Policy, read_policy, shipped_policies
from msgs_config.arrays import SingleArray
from msgs_config.errors import ConfigurationError
from tests.support.training import DECISIONS, HUMANOID, arrays_of, make_small, walking_job

JOB = walking_job()


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    make_small(monkeypatch)


@pytest.fixture
def begin() -> Iterator[Callable[..., Training]]:
    begun: list[Training] = []

    def make(job: Job = JOB, start: Policy | None = None, *, resumes: bool = False) -> Training:
        begun.append(Training(job, start, resumes=resumes))
        return begun[-1]

    yield make
    for each in begun:
        each.close()


def train(training: Training) -> Policy:
    """Train to the end; the best policy."""
    while not training.is_over:
        training.go_on()
    return training.best({})


def looked_at(training: Training) -> Training:
    """A training that has something to keep."""
    training._look()
    return training


def content(policy: Policy) -> tuple[object, ...]:
    """All of a policy."""
    arrays = [*policy.network, *policy.value, *policy.scales[:3], policy.ahead, policy.unit]
    return policy.about, [each.tobytes() for each in arrays]


@pytest.mark.slow
def test_the_number_of_threads_does_not_matter_and_the_seed_does(
    begin: Callable[..., Training],
) -> None:
    one, two, three = (train(begin(replace(JOB, threads=count))) for count in (1, 2, 3))
    other = train(begin(replace(JOB, seed=2)))

    assert content(one) == content(two) == content(three)
    assert content(one)[1] != content(other)[1]


def test_a_policy_comes_back_from_its_file(begin: Callable[..., Training], tmp_path: Path) -> None:
    training = begin(replace(JOB, decisions=DECISIONS))
    training.go_on()
    training.save(tmp_path / "walk.npz", {"walk": {"to the end": "5 of 5"}})

    policy = read_policy(str(tmp_path / "walk.npz"), HUMANOID)

    assert content(policy)[1] == content(training.best({}))[1]
    assert policy.about["figures"] == {"walk": {"to the end": "5 of 5"}}
    assert policy.about["clips"] == ["walk"]
    assert policy.about["trained"]["decisions"] == DECISIONS


def test_a_training_that_is_resumed_goes_on_from_the_policy(
    begin: Callable[..., Training],
) -> None:
    first = begin(replace(JOB, decisions=DECISIONS))
    policy = train(first)
    about = {**policy.about, "trained": {**policy.about["trained"], "pushes_ns": 12.0}}
    policy = replace(policy, about=about)

    resumed, afresh = begin(start=policy, resumes=True), begin()
    strengths = [[each.strength for each in one._worlds._episodes] for one in (resumed, afresh)]
    kept = resumed.best({})
    progress = resumed.go_on()

    for name, array in arrays_of(policy).items():
        assert array.tobytes() == arrays_of(kept)[name].tobytes()
    assert progress.decisions == 2 * DECISIONS
    assert progress.push == 12.0
    assert any(
        (array != trained).any()
        for array, trained in zip(policy.network, resumed._learner.policy, strict=True)
    )
    assert strengths[0] != strengths[1], "the draws are those that it began with"


@pytest.mark.nightly
def test_another_motions_policy_is_where_a_training_begins(begin: Callable[..., Training]) -> None:
    walk = looked_at(begin()).best({})
    walk = replace(walk, about={**walk.about, "trained": {"decisions": 50, "pushes_ns": 12.0}})
    job = replace(JOB, names=("run",))
    check_start(job, walk)

    training = begin(job, walk)
    assert not training.has_best  # nothing of its own yet, that could replace a file
    first = looked_at(training).best({})
    begun, half_way = begin()._spread_and_rate(), training._spread_and_rate()
    progress = training.go_on()

    for name, array in arrays_of(walk).items():
        assert array.tobytes() == arrays_of(first)[name].tobytes()
    assert progress.decisions == DECISIONS
    assert progress.push == module._LEAST_PUSH
    assert first.about["clips"] == ["run"]
    assert first.about["trained"]["from"] == {"clips": ["walk"], "decisions": 50}
    again = looked_at(begin(replace(job, decisions=10**6), first, resumes=True))
    assert again.best({}).about["trained"]["from"] == {"clips": ["walk"], "decisions": 50}
    assert begun == (module._SPREADS[0], module._RATES[0])
    assert half_way == pytest.approx(np.sqrt((module._SPREADS, module._RATES)).prod(axis=1))
    assert again._spread_and_rate() == pytest.approx(half_way, rel=1e-3)
    assert first.scales.frame_mean.tobytes() == walk.scales.frame_mean.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_policies())
def test_a_shipped_policy_is_where_a_training_may_begin(
    begin: Callable[..., Training], name: str
) -> None:
    policy = read_policy(name, HUMANOID)
    check_start(JOB, policy)

    learner = begin(JOB, policy)._learner

    for own, given in zip(learner.policy, policy.network, strict=True):
        np.testing.assert_array_equal(own, given)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"rate": 120}, "rate: 120, this training's: 240"),
        ({"hold": 4}, "hold: 4, this training's: 8"),
    ],
)
def test_it_begins_with_what_decides_alike(
    begin: Callable[..., Training], change: dict[str, object], says: str
) -> None:
    policy = looked_at(begin()).best({})

    with pytest.raises(ConfigurationError, match=says):
        check_start(JOB, replace(policy, about={**policy.about, **change}))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"clips": ["run"]}, "clips: run, this training's: walk"),
        ({"trained": {"decisions": 10**9}}, "1,000,000,000 decisions"),
    ],
)
def test_it_goes_on_with_the_same_and_with_more(
    begin: Callable[..., Training], change: dict[str, object], says: str
) -> None:
    policy = looked_at(begin()).best({})
    check_resumed(JOB, policy)

    with pytest.raises(ConfigurationError, match=says):
        check_resumed(JOB, replace(policy, about={**policy.about, **change}))


def test_clips_that_were_made_with_other_parameters_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def bring(character: object, clip: str, simulator: object, given: dict[str, object]) -> None:
        if clip == "run":
            given["gain_scale.p"] = 0.5

    monkeypatch.setattr(exercises, "bring_parameters", bring)
    walk, run = (Exercise("humanoid", name) for name in ("walk", "run"))

    with pytest.raises(
        ConfigurationError, match=r"run was made with 'gain_scale\.p' 0\.5, the first"
    ):
        make_job([walk, run], {}, decisions=1)


def test_networks_of_another_size_are_refused(
    begin: Callable[..., Training],
) -> None:
    policy = looked_at(begin()).best({})

    with pytest.raises(ConfigurationError, match="--hidden: 128, this training's: 32"):
        check_start(replace(JOB, hidden=32), policy)


@pytest.mark.parametrize(
    ("most", "falls", "begins", "ends"),
    [
        (30.0, 0.0, 10.0, "more"),
        (30.0, 0.01, 10.0, "the same"),
        (30.0, 0.1, 10.0, "less"),
        (12.0, 0.0, 10.0, 12.0),
        (30.0, 0.1, 5.2, 5.0),
        (3.0, 0.0, 5.0, 3.0),
        (0.0, 0.0, 5.0, 0.0),
    ],
)
def test_pushes_grow_while_falls_are_rare(
    begin: Callable[..., Training], most: float, falls: float, begins: float, ends: float | str
) -> None:
    """`falls` is the share of decisions that end in one, 30 a second."""
    training = begin(replace(JOB, most_push=most))
    training._push = begins
    ended = np.zeros(1000, np.intp)
    ended[: round(1000 * falls)] = FELL

    for _ in range(30):
        training._falls = 30.0 * falls  # as it is after many such traces
        training._lead_pushes(SimpleNamespace(ends=ended))  # type: ignore[arg-type]

    if isinstance(ends, float):
        assert training._push == pytest.approx(ends)
    else:
        signs = {"more": 1, "the same": 0, "less": -1}
        assert np.sign(training._push - begins) == signs[ends]


def test_the_best_is_kept_rather_than_the_last(
    begin: Callable[..., Training], monkeypatch: pytest.MonkeyPatch
) -> None:
    training = begin(replace(JOB, most_push=0.0))
    scores = iter((0.2, 0.7, 0.5))
    bests = []

    def run(*ignored: object) -> tuple[object, None]:
        ends = np.zeros((2, 6), np.intp)
        return SimpleNamespace(ends=ends, rewards=np.full((2, 6), next(scores))), None

    monkeypatch.setattr(training._judges, "run", run)
    monkeypatch.setattr(training._learner, "least_expected", lambda trace: 0.5)
    for number in range(3):
        training._learner.averages[0].bias_3[:] = number
        bests.append(training._look().is_better)

    assert bests == [True, True, False]
    assert (training.best({}).network.bias_3 == 1.0).all()


def test_a_file_says_what_its_own_policy_was_trained_with(
    begin: Callable[..., Training], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not what was tried after it, which led to nothing better."""
    training = begin(replace(JOB, decisions=10 * DECISIONS))
    training.go_on()
    training._look()
    kept = training.best({})
    monkeypatch.setattr(training, "_look", lambda: Look(10.0, 0, is_better=False))

    training.go_on()

    assert training.done == 2 * DECISIONS
    assert training.best({}).about == kept.about
    assert kept.about["trained"]["decisions"] == DECISIONS


def test_a_policy_that_falls_is_worse_than_one_that_costs_a_little_more(
    begin: Callable[..., Training], monkeypatch: pytest.MonkeyPatch
) -> None:
    training = begin(replace(JOB, most_push=0.0))
    seen = iter(((0.5, 0), (0.6, 1)))

    def run(*ignored: object) -> tuple[object, None]:
        reward, falls = next(seen)
        ends = np.zeros((2, 30), np.intp)
        ends[:falls, 3] = FELL  # half a fall a second
        return SimpleNamespace(ends=ends, rewards=np.full((2, 30), reward)), None

    monkeypatch.setattr(training._judges, "run", run)
    monkeypatch.setattr(training._learner, "least_expected", lambda trace: 0.5)

    looks = [training._look(), training._look()]

    assert [(each.falls, each.is_better) for each in looks] == [(0, True), (1, False)]


def test_episodes_begin_more_often_where_others_fell(
    begin: Callable[..., Training], monkeypatch: pytest.MonkeyPatch
) -> None:
    training = begin()
    run, even = training._worlds.run, training._worlds._starts._weights

    def run_and_fall(*given: object) -> tuple[Trace, SingleArray]:
        trace, noise = run(*given)  # type: ignore[arg-type]
        trace.ends[:] = np.where(trace.rows < 100, FELL, 0)  # in the first of three bins
        return trace, noise

    monkeypatch.setattr(training._worlds, "run", run_and_fall)
    while not training.is_over:
        training.go_on()

    shares = training._worlds._starts._weights / even
    assert shares[0] > shares[2] > shares[1] > 0.0
    assert (training._judges._starts._weights == even).all(), "a look is the same each time"


@pytest.mark.parametrize(("decisions", "worlds"), [(1, 2), (1_000_000, 2083)])
def test_looks_take_a_share_of_what_is_tried(
    begin: Callable[..., Training], monkeypatch: pytest.MonkeyPatch, decisions: int, worlds: int
) -> None:
    """A twentieth in all: of a million decisions two looks with and without pushes, of 0.2 s."""
    training = begin(replace(JOB, decisions=decisions))
    counts = []

    def run(*ignored: object) -> tuple[object, None]:
        counts.append(len(training._judges._episodes))
        return SimpleNamespace(ends=np.zeros((2, 6), np.intp), rewards=np.ones((2, 6))), None

    monkeypatch.setattr(training._judges, "run", run)
    monkeypatch.setattr(training._learner, "least_expected", lambda trace: 0.5)
    look = training._look()

    assert counts == [worlds, worlds]
    assert look.seconds == pytest.approx(2 * worlds * 0.2)


def test_it_looks_as_often_as_it_should(begin: Callable[..., Training]) -> None:
    job = replace(JOB, decisions=10 * DECISIONS)
    training, looks = begin(job), []
    look = training._look

    def count() -> Look:
        looks.append(training.done // DECISIONS)
        return look()

    training._look = count  # type: ignore[method-assign]
    train(training)

    assert looks == [5, 10]


def test_a_policy_says_by_which_clips_it_was_steered(begin: Callable[..., Training]) -> None:
    """Not those that it keeps as they are."""
    exercises = [Exercise("humanoid", name) for name in ("kick", "steered")]
    clips = {"steering.clips": ["walk", "crawl"]}

    job = make_job(exercises, clips, decisions=1)

    assert looked_at(begin(replace(JOB, gait=job.gait))).best({}).about["gait"] == ["crawl", "walk"]
    assert "gait" not in looked_at(begin()).best({}).about
