"""Fits the balance feedback to a motion, so that it goes on for longest without corrections.

CMA-ES over the gains, each tried in two runs from the first state. The search then begins from a
feedback with which what it looks ahead at holds for longer.

Source: Hansen 2016, "The CMA Evolution Strategy: A Tutorial"; the package `cma` is its author's.
Liu, van de Panne and Yin 2016, "Guided Learning of Control Graphs", fit such a feedback likewise.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TypeAlias

import joblib
import numpy as np

from controller_node.feedback_gains import FEATURES, OUTPUTS
from experiment.samcon import cost
from experiment.samcon.problem import Problem
from experiment.samcon.rollout import Branch, Rollout
from experiment.samcon.settings import Settings
from experiment.samcon.workers import (
    forget,
    leave_interrupts_to_the_parent,
    processes,
    rollout_of,
)
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError

Gains: TypeAlias = dict[str, float]
"""Gains of the feedback by name."""

POPULATION = 16
"""Gains are tried so many at a time."""

_STEP = 0.16  # of the gains at first, times how large each of them usually is
_USUAL = {"centre_vx": 0.2, "centre_vy": 0.2, "centre_vz": 0.2, "one": 0.1, "side": 0.1}
_SPIN = 0.2
_WORST = 100.0  # cost of a window
_LOST = 150.0  # of each window after that in which it was lost
_SHRINK = 0.005  # a squared step from the first gains, against the cost of a window
_RUNS = 2  # with each gains
_NUDGE = 0.15  # of the search's noise
_DIGITS = 3  # of gains, as they stand in files

# what has something to do with what: about x it leans sideways, about z ahead
_SIDEWAYS = ("centre_y", "centre_vy", "arm_y", "tilt_x", "spin_x", "one")
_AHEAD = ("centre_x", "centre_vx", "arm_x", "tilt_z", "spin_z", "one")
_CANDIDATES = {
    "hip_x": _SIDEWAYS,
    "hip_y": ("tilt_y", "spin_y"),
    "hip_z": _AHEAD,
    "knee": ("centre_z", "centre_vz", "one"),
    "ankle_x": _SIDEWAYS,
    "ankle_z": _AHEAD,
}


def names() -> tuple[str, ...]:
    """The gains that are fitted."""
    assert set(_CANDIDATES) <= set(OUTPUTS)
    return tuple(
        f"{leg}.{output}.{feature}"
        for leg in ("stance", "swing")
        for output, features in _CANDIDATES.items()
        if leg == "stance" or not output.startswith("ankle")
        for feature in features
        if feature in FEATURES
    )


def fitted(
    problem: Problem,
    settings: Settings,
    count: int,
    workers: int,
    report: Callable[[int, float], None] = lambda *_: None,
) -> Gains:
    """The gains that cost least of `count`, rounded up to whole populations, and the problem's own.

    `report` is told how many were tried, and the least mean cost of a window so far. The result
    does not depend on the number of processes.

    Raises:
        ConfigurationError: there is no package `cma`.
    """
    try:
        import cma  # type: ignore[import-untyped,unused-ignore]
    except ImportError as error:
        raise ConfigurationError(
            "--fit needs the package 'cma': pip install 'actuated_characters[fit]'"
        ) from error
    found = tuple(dict.fromkeys((*names(), *problem.feedback)))
    usual = np.array([_usual(name) for name in found])
    first = np.array([problem.feedback.get(name, 0.0) for name in found]) / usual
    best = dict(problem.feedback)
    # its own generator takes the seed 0 for none
    options = {"popsize": POPULATION, "seed": settings.seed + 1, "verbose": -9}
    evolution = cma.CMAEvolutionStrategy(first, _STEP, options)
    with _costs_of(problem, settings, workers) as costs_of:
        (least,) = costs_of([best])
        for done in range(POPULATION, count + POPULATION, POPULATION):
            points = evolution.ask()
            tried = [_gains(found, point * usual) for point in points]
            costs = costs_of(tried)
            shrink = [_SHRINK * float(np.sum((point - first) ** 2)) for point in points]
            evolution.tell(points, [sum(pair) for pair in zip(costs, shrink, strict=True)])
            index = int(np.argmin(costs))
            if costs[index] < least:
                best, least = tried[index], costs[index]
            report(done, least)
    return best


@contextmanager
def _costs_of(
    problem: Problem, settings: Settings, workers: int
) -> Iterator[Callable[[Sequence[Gains]], list[float]]]:
    """What tells the mean costs of gains, in order, by so many processes; 1 is this one."""

    def alone(tried: Sequence[Gains]) -> list[float]:
        return [mean_cost(problem, settings, gains) for gains in tried]

    if workers == 1:
        try:
            yield alone
        finally:
            forget(_without_feedback(problem))
        return
    with processes(workers) as parallel:
        yield lambda tried: list(
            parallel(joblib.delayed(_cost_in_process)(problem, settings, gains) for gains in tried)
        )


def _cost_in_process(problem: Problem, settings: Settings, gains: Gains) -> float:
    leave_interrupts_to_the_parent()
    return mean_cost(problem, settings, gains)


def _without_feedback(problem: Problem) -> Problem:
    """What the engines are made for, lest another one is made for each gains."""
    return replace(problem, feedback={})


def mean_cost(problem: Problem, settings: Settings, gains: Mapping[str, float]) -> float:
    """The mean cost of the windows of runs without corrections but nudges in the first window.

    The nudges keep the feedback from balancing on a knife's edge.
    """
    rollout = rollout_of(_without_feedback(problem))
    rollout.respond(gains)
    count, nothing = len(rollout.windows), np.zeros(rollout.layout.size)
    rng = np.random.default_rng(settings.seed)
    samples = rollout.plain(0) + np.zeros((_RUNS, len(nothing)))
    for name, widths in settings.noise.items():
        entries = rollout.layout.joint(name).entries
        size = (_RUNS - 1, entries.stop - entries.start)
        samples[1:, entries] += _NUDGE * np.array(widths) * rng.uniform(-1.0, 1.0, size)
    branch = Branch(None, 0, samples[:0], nothing, samples, count - 1, settings.bounds)
    runs = rollout.expand(branch).features
    return float(np.mean([_mean_cost(rollout, ends, settings) for ends in runs]))


def _mean_cost(rollout: Rollout, ends: FloatArray, settings: Settings) -> float:
    """The mean cost of a run's windows from their ends (w, f)."""
    total = 0.0
    for window, end in enumerate(ends):
        desired = rollout.desired(window)
        rows = np.nan_to_num(end)[np.newaxis]
        terms = cost.terms(rollout.layout, rollout.height, rows, desired, settings.bounds)
        value = float(terms.cost(settings.weights)[0])
        if not np.isfinite(value) or not np.isfinite(end).all():
            return (total + _LOST * (len(ends) - window)) / len(ends)
        total += min(value, _WORST)
    return total / len(ends)


def _usual(name: str) -> float:
    feature = name.rpartition(".")[2]
    return _USUAL.get(feature, _SPIN if feature.startswith("spin") else 1.0)


def _gains(found: tuple[str, ...], values: FloatArray) -> Gains:
    return {
        name: float(f"{value:.{_DIGITS}g}")
        for name, value in zip(found, values.tolist(), strict=True)
    }
