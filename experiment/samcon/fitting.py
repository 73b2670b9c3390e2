"""Fits what acts without a search to a motion, so that it goes on for longest without corrections.

CMA-ES over the gains of the feedback, and over the offsets of a cycle's windows if the motion
wraps. Each policy is tried in runs from the first state. The search then begins from one with
which what it looks ahead at holds for longer.

It may begin with some of the root's assistance, which is withdrawn step by step, each time that
the policy in the middle gets to the end of its runs. Then the runs get longer, and pushed.

Sources: Hansen 2016, "The CMA Evolution Strategy: A Tutorial"; the package `cma` is its author's.
Liu, van de Panne and Yin 2016, "Guided Learning of Control Graphs", fit such a feedback likewise;
van de Panne and Lamouret 1995, "Guided Optimization for Balanced Locomotion", help at first, too.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import cos, sin
from types import ModuleType

import joblib
import numpy as np

from controller_node.references.clip_file import read_clip
from experiment.planned_push import PlannedPush, planned_push
from experiment.samcon.policy import Policy, PolicySpace
from experiment.samcon.problem import Problem
from experiment.samcon.rollout import Branch, Rollout
from experiment.samcon.settings import Settings
from experiment.samcon.workers import (
    leave_interrupts_to_the_parent,
    rollout_of,
    some_processes,
)
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError

POPULATION = 16
"""Policies are tried so many at a time."""

_STEP = 0.12  # of the vector at first
_WORST = 100.0  # cost of a window
_LOST = 150.0  # of each window after that in which it was lost
_SHRINK = 0.005  # a squared step from the first policy, against the cost of a window
_TEST_EVERY = 3  # populations
_TESTS = 2  # runs
_WEAKER = 0.85  # of the root's assistance
_WEAKEST = 0.01  # share of it, below which there is none
# N/m and N s/m, N m/rad and N m s/rad: the lecture's, but for a quarter of the force's
_ASSISTANCE = {"root": (1000.0, 100.0), "root_r": (1000.0, 100.0)}
_LONGER = 1.5  # runs, each time
_FIRST_RUN = 3.8  # s
_PUSH_EVERY = 2.0  # s


@dataclass(frozen=True)
class Fit:
    """What is to be fitted, and how."""

    count: int  # policies, rounded up to whole populations
    assistance: float = 0.0  # share of the root's gains that it begins with
    push: float = 0.0  # N s, each two seconds of the last runs
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
            return replace(self, windows=min(int(self.windows * _LONGER), windows))
        return replace(self, push=fit.push)


@dataclass(frozen=True)
class Run:
    """One run of a policy, from the first state."""

    nudge: FloatArray  # (n,) offset more in the first window, rad
    pushes: tuple[PlannedPush, ...]


@dataclass(frozen=True)
class State:
    """How far a fit is."""

    done: int  # policies
    level: Level
    cost: float  # mean of a window, of the best policy at this level


def fitted(
    problem: Problem,
    settings: Settings,
    fit: Fit,
    workers: int,
    report: Callable[[State], None] = lambda _: None,
) -> Policy:
    """The best policy at the hardest level that was reached.

    The best of the middles of the distribution, as tested every few populations, and the
    problem's own one. The result does not depend on the number of processes.

    Raises:
        ConfigurationError: there is no package `cma`, or a number of the fit is wrong.
    """
    cma = _cma()
    with some_processes(workers) as parallel:
        trials = Trials(problem, settings, parallel)
        space, level = trials.space, trials.first_level(fit)
        best = Policy(problem.feedback, problem.offsets)
        first = space.vector(best)
        # its own generator takes the seed 0 for none
        options = {"popsize": POPULATION, "seed": settings.seed + 1, "verbose": -9}
        evolution = cma.CMAEvolutionStrategy(first, _STEP, options)
        least, _ = trials.test(level, fit, best)
        for population in range(1, -(-fit.count // POPULATION) + 1):
            points = evolution.ask()
            costs = trials.costs(level, fit, [space.policy(point) for point in points], population)
            shrink = [_SHRINK * float(np.sum((point - first) ** 2)) for point in points]
            evolution.tell(points, [sum(pair) for pair in zip(costs, shrink, strict=True)])
            if population % _TEST_EVERY == 0 or population * POPULATION >= fit.count:
                policy = space.policy(evolution.mean)
                tested, held = trials.test(level, fit, policy)
                harder = level.harder(fit, trials.windows)
                if held and harder != level:
                    level, best = harder, policy
                    least, _ = trials.test(level, fit, best)
                elif tested < least:
                    best, least = policy, tested
            report(State(population * POPULATION, level, least))
    return best


@dataclass(frozen=True)
class Tried:
    """What became of a run."""

    cost: float  # mean of the windows
    held: bool  # to its end


class Trials:
    """Tries policies, on some processes; None is this one alone."""

    def __init__(
        self, problem: Problem, settings: Settings, parallel: joblib.Parallel | None = None
    ) -> None:
        self._problem, self._settings = problem, settings
        rollout = rollout_of(_bare(problem, 0.0))
        self.windows = len(rollout.windows)
        self.space = PolicySpace(
            problem, rollout.plan.character, _windows_a_cycle(problem, rollout)
        )
        self._plan = rollout.plan
        self._noise = settings.largest_offsets(rollout.layout)
        self._parallel = parallel

    def first_level(self, fit: Fit) -> Level:
        """Where a fit begins: all windows at once, unless the root is held at first."""
        some = round(_FIRST_RUN / self._problem.window)
        windows = min(some, self.windows) if fit.assistance else self.windows
        return Level(fit.assistance, windows, 0.0 if fit.assistance else fit.push)

    def costs(self, level: Level, fit: Fit, policies: Sequence[Policy], draw: int) -> list[float]:
        """The mean costs of a window of policies, in order, in runs that a number draws."""
        runs = self._runs(level, fit, [self._settings.seed, draw], 1 + (level.push > 0.0))
        tried = self._tried(level, [(policy, run) for policy in policies for run in runs])
        costs = np.array([one.cost for one in tried]).reshape(len(policies), -1)
        return [float(cost) for cost in costs.mean(axis=1)]

    def test(self, level: Level, fit: Fit, policy: Policy) -> tuple[float, bool]:
        """A policy's mean cost of a window, and whether all its runs went to their ends."""
        runs = self._runs(level, fit, [self._settings.seed], _TESTS)
        tried = self._tried(level, [(policy, run) for run in runs])
        return float(np.mean([one.cost for one in tried])), all(one.held for one in tried)

    def _runs(self, level: Level, fit: Fit, seed: list[int], count: int) -> list[Run]:
        """Runs at a level; where there are pushes, every other one is pushed."""
        rng = np.random.default_rng(np.random.SeedSequence(seed))
        return [
            Run(
                fit.nudge * self._noise * rng.uniform(-1.0, 1.0, len(self._noise)),
                self._pushes(level, rng) if number % 2 else (),
            )
            for number in range(count)
        ]

    def _pushes(self, level: Level, rng: np.random.Generator) -> tuple[PlannedPush, ...]:
        """Pushes on the root, each two seconds, from random sides."""
        if not level.push:
            return ()
        end = level.windows * self._problem.duration / self.windows
        root = self._plan.character.links[0].name
        held = self._plan.simulator.number("wrench_duration")
        times = np.arange(rng.uniform(0.5, _PUSH_EVERY), end - held, _PUSH_EVERY).tolist()
        sides = rng.uniform(-np.pi, np.pi, len(times)).tolist()
        force = level.push / held
        return tuple(
            planned_push(self._plan, root, (force * cos(side), force * sin(side), 0.0), time)
            for time, side in zip(times, sides, strict=True)
        )

    def _tried(self, level: Level, pairs: Sequence[tuple[Policy, Run]]) -> list[Tried]:
        bare = _bare(self._problem, level.assistance)
        if self._parallel is None:
            return [tried(bare, self._settings, level.windows, *pair) for pair in pairs]
        work = (
            joblib.delayed(_tried_in_process)(bare, self._settings, level.windows, *pair)
            for pair in pairs
        )
        return list(self._parallel(work))


def _tried_in_process(
    problem: Problem, settings: Settings, windows: int, policy: Policy, run: Run
) -> Tried:
    leave_interrupts_to_the_parent()
    return tried(problem, settings, windows, policy, run)


def tried(problem: Problem, settings: Settings, windows: int, policy: Policy, run: Run) -> Tried:
    """A policy's run over the first windows."""
    rollout = rollout_of(problem)
    rollout.act(policy.feedback, policy.offsets)
    nothing = np.zeros(rollout.layout.size)
    sample = (rollout.plain(0) + run.nudge)[np.newaxis]
    branch = Branch(None, 0, sample[:0], nothing, sample, windows - 1, settings.bounds, run.pushes)
    (ends,) = rollout.expand(branch).features
    total = 0.0
    for window, end in enumerate(ends):
        (value,) = rollout.costs(window, end[np.newaxis], settings).tolist()
        if not np.isfinite(value):
            return Tried((total + _LOST * (windows - window)) / windows, held=False)
        total += min(value, _WORST)
    return Tried(total / windows, held=True)


def _bare(problem: Problem, assistance: float) -> Problem:
    """A problem without a policy, lest an engine is made for each of them; with some assistance."""
    bare = replace(problem, feedback={}, offsets={})
    if not assistance:
        return bare
    gains = {
        f"gains.{vector}.{kind}": assistance * gain
        for vector, pair in _ASSISTANCE.items()
        for kind, gain in zip("pd", pair, strict=True)
    }
    return replace(bare, controller={**problem.controller, "root_assistance": True, **gains})


def _windows_a_cycle(problem: Problem, rollout: Rollout) -> int:
    """Windows of a cycle, if it is cut into whole ones; else 0."""
    frames = read_clip(rollout.plan.character, problem.clip)
    share = len(rollout.windows) * float(frames.times[-1]) / problem.duration
    whole = abs(share - round(share)) < 1e-6
    return round(share) if frames.wraps and whole else 0


def _cma() -> ModuleType:
    try:
        import cma  # type: ignore[import-untyped,unused-ignore]
    except ImportError as error:
        raise ConfigurationError(
            "--fit needs the package 'cma': pip install 'actuated_characters[fit]'"
        ) from error
    module: ModuleType = cma
    return module
