"""Fits the feedback to a motion, so that it goes on for longest without corrections.

CMA-ES over its gains. Each feedback is tried in runs from the first state (`trials.py`), which get
harder step by step, each time that the one in the middle gets to the end of most of its runs: some
of the root's assistance is withdrawn, then the runs get longer, and pushed. The search then begins
from a feedback with which what it looks ahead at holds for longer.

Sources: Hansen 2016, "The CMA Evolution Strategy: A Tutorial"; the package `cma` is its author's.
Liu, van de Panne and Yin 2016, "Guided Learning of Control Graphs", fit such a feedback likewise;
van de Panne and Lamouret 1995, "Guided Optimization for Balanced Locomotion", help at first, too.
"""

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from experiment.samcon.gain_space import Gains, GainSpace
from experiment.samcon.problem import Problem
from experiment.samcon.settings import Settings
from experiment.samcon.trials import Fit, Level, Trials
from experiment.samcon.workers import some_processes
from msgs_config.errors import ConfigurationError

POPULATION = 16
"""Feedbacks are tried so many at a time."""

_STEP = 0.1  # of the vector at first
_SHRINK = 0.005  # a squared step from the first feedback, against the cost of a window
_TEST_EVERY = 3  # populations


@dataclass(frozen=True)
class State:
    """How far a fit is."""

    done: int  # feedbacks
    level: Level
    cost: float  # mean of a window, of the best feedback at this level


def fitted(
    problem: Problem,
    settings: Settings,
    fit: Fit,
    workers: int,
    report: Callable[[State], None] = lambda _: None,
) -> Gains:
    """The best feedback at the hardest level that was reached, gains by name.

    The best of the middles of the distribution, as tested every few populations, and the
    problem's own one. The result does not depend on the number of processes.

    Raises:
        ConfigurationError: there is no package `cma`, or a number of the fit is wrong.
    """
    cma = _cma()
    space = GainSpace(problem.feedback)
    with some_processes(workers) as parallel:
        trials = Trials(problem, settings, fit, parallel)
        level, best = trials.first_level(), problem.feedback
        first = space.vector(best)
        # its own generator takes the seed 0 for none
        options = {"popsize": POPULATION, "seed": settings.seed + 1, "verbose": -9}
        evolution = cma.CMAEvolutionStrategy(first, _STEP, options)
        least, _ = trials.test(level, best)
        for population in range(1, -(-fit.count // POPULATION) + 1):
            points = evolution.ask()
            costs = trials.costs(level, [space.gains(point) for point in points], population)
            shrink = [_SHRINK * float(np.sum((point - first) ** 2)) for point in points]
            evolution.tell(points, [sum(pair) for pair in zip(costs, shrink, strict=True)])
            if population % _TEST_EVERY == 0 or population * POPULATION >= fit.count:
                middle = space.gains(evolution.mean)
                tested, held = trials.test(level, middle)
                harder = level.harder(fit, trials.windows)
                if held and harder != level:
                    level = harder
                    costs = [trials.test(level, gains)[0] for gains in (best, middle)]
                    best, least = (best, middle)[int(np.argmin(costs))], min(costs)
                elif tested < least:
                    best, least = middle, tested
            report(State(population * POPULATION, level, least))
    return best


def _cma() -> ModuleType:
    try:
        import cma  # type: ignore[import-untyped,unused-ignore]
    except ImportError as error:
        raise ConfigurationError(
            "--fit needs the package 'cma': pip install 'actuated_characters[fit]'"
        ) from error
    module: ModuleType = cma
    return module
