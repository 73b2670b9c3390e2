"""Trials of a feedback: runs from the first state without corrections, easy ones and hard ones.

A run may be helped by some of the root's assistance, begin at another heading, and be pushed. The
headings are there because the engine's friction is not the same in all directions of the world:
what holds along one axis need not hold between two (docs/reconstruction.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, pi, sin

import joblib
import numpy as np

from experiment.plan import Plan
from experiment.planned_push import PlannedPush, planned_push
from experiment.samcon.gain_space import Gains
from experiment.samcon.problem import Problem
from experiment.samcon.settings import Settings
from experiment.samcon.workers import leave_interrupts_to_the_parent, rollout_of
from msgs_config.arrays import FloatArray

_WORST = 100.0  # cost of a window
_LOST = 150.0  # of each window after that in which it was lost
_TESTS = 2  # runs at each heading
_MOST_HOLD = 0.7  # share of them with which a level is done
_WEAKER = 0.85  # of the root's assistance
_WEAKEST = 0.01  # share of it, below which there is none
# N/m and N s/m, N m/rad and N m s/rad: the lecture's, but for a quarter of the force's
_ASSISTANCE = {"root": (1000.0, 100.0), "root_r": (1000.0, 100.0)}
_LONGER = 1.4  # runs, each time
_FIRST_RUN = 3.8  # s
_PUSH_EVERY = 2.0  # s
_QUARTER = 0.5 * pi  # rad, after which the engine's friction is the same again


@dataclass(frozen=True)
class Fit:
    """What is to be fitted, and how."""

    count: int  # feedbacks, rounded up to whole populations
    assistance: float = 0.0  # share of the root's gains that it begins with
    push: float = 0.0  # N s, each two seconds of the last runs
    headings: int = 1  # of the motion, at which each feedback is tried
    nudge: float = 0.03  # of the search's noise, in the first window of each run


@dataclass(frozen=True)
class Level:
    """How hard the runs are."""

    assistance: float
    windows: int
    push: float  # N s

    def harder(self, fit: Fit, windows: int) -> "Level":
        """The next one; itself, if there is none."""
        if self.assistance:
            less = self.assistance * _WEAKER
            return replace(self, assistance=less if less >= _WEAKEST else 0.0)
        if self.windows < windows:
            longer = max(int(self.windows * _LONGER), self.windows + 1)
            return replace(self, windows=min(longer, windows))
        return replace(self, push=fit.push)


@dataclass(frozen=True)
class Run:
    """One run of a feedback, from the first state."""

    heading: float  # rad, by which the motion is turned
    nudge: FloatArray  # (n,) offset more in the first window, rad
    pushes: tuple[PlannedPush, ...]


@dataclass(frozen=True)
class Tried:
    """What became of a run."""

    cost: float  # mean of the windows
    held: bool  # to its end


class Trials:
    """Tries feedbacks, on some processes; None is this one alone."""

    def __init__(
        self,
        problem: Problem,
        settings: Settings,
        fit: Fit,
        parallel: joblib.Parallel | None = None,
    ) -> None:
        self._problem, self._settings, self._fit = problem, settings, fit
        rollout = rollout_of(_bare(problem, 0.0, 0.0))
        self.windows = len(rollout.windows)
        self._plan = rollout.plan
        self._noise = settings.largest_offsets(rollout.layout)
        self._parallel = parallel

    def first_level(self) -> Level:
        """Where a fit begins."""
        windows = min(max(round(_FIRST_RUN / self._problem.window), 1), self.windows)
        return Level(self._fit.assistance, windows, push=0.0)

    def costs(self, level: Level, feedbacks: Sequence[Gains], draw: int) -> list[float]:
        """The mean costs of a window of feedbacks, in order, in runs that a number draws."""
        runs = self._runs(level, [self._settings.seed, draw], 1 + (level.push > 0.0))
        tried = self._tried(level, [(gains, run) for gains in feedbacks for run in runs])
        costs = np.array([one.cost for one in tried]).reshape(len(feedbacks), -1)
        return [float(cost) for cost in costs.mean(axis=1)]

    def test(self, level: Level, gains: Gains) -> tuple[float, bool]:
        """A feedback's mean cost of a window, and whether most of its runs went to their ends."""
        runs = self._runs(level, [self._settings.seed], _TESTS)
        tried = self._tried(level, [(gains, run) for run in runs])
        held = float(np.mean([one.held for one in tried]))
        return float(np.mean([one.cost for one in tried])), held >= _MOST_HOLD

    def _runs(self, level: Level, seed: list[int], count: int) -> list[Run]:
        """So many runs at each heading; where there are pushes, every other one is pushed."""
        rng = np.random.default_rng(np.random.SeedSequence(seed))
        return [
            Run(
                heading,
                self._fit.nudge * self._noise * rng.uniform(-1.0, 1.0, len(self._noise)),
                self._pushes(level, rng) if number % 2 else (),
            )
            for number in range(count)
            for heading in headings(self._fit.headings)
        ]

    def _pushes(self, level: Level, rng: np.random.Generator) -> tuple[PlannedPush, ...]:
        if not level.push:
            return ()
        end = level.windows * self._problem.duration / self.windows
        return random_pushes(self._plan, rng, level.push, end)

    def _tried(self, level: Level, pairs: Sequence[tuple[Gains, Run]]) -> list[Tried]:
        work = [
            (_bare(self._problem, level.assistance, run.heading), level.windows, gains, run)
            for gains, run in pairs
        ]
        if self._parallel is None:
            return [tried(self._settings, *one) for one in work]
        return list(
            self._parallel(joblib.delayed(_tried_in_process)(self._settings, *one) for one in work)
        )


def headings(count: int) -> list[float]:
    """Headings in rad within a quarter turn, after which the engine's friction is the same."""
    return [index * _QUARTER / count for index in range(count)]


def random_pushes(
    plan: Plan, rng: np.random.Generator, push: float, end: float
) -> tuple[PlannedPush, ...]:
    """Pushes of so many N s on the root, each two seconds until a time in s, from random sides."""
    root = plan.character.links[0].name
    held = plan.simulator.number("wrench_duration")
    times = np.arange(rng.uniform(0.5, _PUSH_EVERY), end - held, _PUSH_EVERY).tolist()
    sides = rng.uniform(-np.pi, np.pi, len(times)).tolist()
    force = push / held
    return tuple(
        planned_push(plan, root, (force * cos(side), force * sin(side), 0.0), time)
        for time, side in zip(times, sides, strict=True)
    )


def turned(problem: Problem, heading: float) -> Problem:
    """A problem whose motion begins at a heading in rad."""
    if not heading:
        return problem
    placement = {"placement": [0.0, 0.0, 0.0, heading]}
    return replace(problem, simulator={**problem.simulator, **placement})


def _tried_in_process(
    settings: Settings, problem: Problem, windows: int, gains: Gains, run: Run
) -> Tried:
    leave_interrupts_to_the_parent()
    return tried(settings, problem, windows, gains, run)


def tried(settings: Settings, problem: Problem, windows: int, gains: Gains, run: Run) -> Tried:
    """A feedback's run over the first windows of a problem."""
    rollout = rollout_of(problem)
    rollout.act(gains)
    offsets = np.array([rollout.plain(window) for window in range(windows)])
    offsets[0] += run.nudge
    ends = rollout.follow(offsets, run.pushes, settings.bounds)
    total = 0.0
    for window, end in enumerate(ends):
        (value,) = rollout.costs(window, end[np.newaxis], settings).tolist()
        if not np.isfinite(value):
            return Tried((total + _LOST * (windows - window)) / windows, held=False)
        total += min(value, _WORST)
    return Tried(total / windows, held=True)


def _bare(problem: Problem, assistance: float, heading: float) -> Problem:
    """A problem without its feedback, lest an engine is made for each, and without its pushes.

    It is turned to a heading, and some of the root's assistance may help.
    """
    bare = turned(replace(problem, feedback={}, window_feedback="", pushes=()), heading)
    if not assistance:
        return bare
    gains = {
        f"gains.{vector}.{kind}": assistance * gain
        for vector, pair in _ASSISTANCE.items()
        for kind, gain in zip("pd", pair, strict=True)
    }
    return replace(bare, controller={**problem.controller, "root_assistance": True, **gains})
