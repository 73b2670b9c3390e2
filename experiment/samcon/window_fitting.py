"""Fits a window feedback to a motion that repeats itself: identify, regulate, try, and again.

Runs with random offsets show how the motion's deviations go on (`identification.py`); the feedback
of least cost follows from that (`regulator.py`). Its own runs, pushed and not, are data for the
next one, which knows better what happens where the character really is. The rounds' mean is in the
end better than most of them.

Sources: Liu, van de Panne and Yin 2016, "Guided Learning of Control Graphs" (feedback fitted to
samples, again and again); Ross and Bagnell 2012, "Agnostic System Identification for Model-Based
Reinforcement Learning" (data of the controller that the model makes).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from controller_node.window_gains import WindowGains
from experiment.samcon.identification import Transitions, identified
from experiment.samcon.problem import Problem
from experiment.samcon.regulator import regulator, rounded
from experiment.samcon.settings import Settings
from experiment.samcon.trials import headings
from experiment.samcon.window_trials import WindowRun, WindowTrials
from experiment.samcon.workers import some_processes

_FIRST_RUNS = 40  # at each heading, which look around
_FIRST_NOISE = 0.15
_PUSHED = 3  # of each round's runs at each heading; they count
_NOISES = (0.01, 0.02, 0.04)  # of those that explore, instead of being pushed
_MOST_TRANSITIONS = 150_000  # the last ones count
_FINALISTS = 4
_FINAL_RUNS = 6  # at each heading


@dataclass(frozen=True)
class WindowFit:
    """How a window feedback is fitted."""

    rounds: int
    push: float = 5.0  # N s, each two seconds
    headings: int = 6


@dataclass(frozen=True)
class WindowFitState:
    """How far a fit is."""

    round: int
    held: float  # windows, mean of the last feedback's pushed runs
    best: float
    windows: int  # of a run
    gains: WindowGains  # the best ones so far; `first`, if no others are better


def fitted_windows(
    problem: Problem,
    settings: Settings,
    cycles: int,
    fit: WindowFit,
    workers: int,
    report: Callable[[WindowFitState], None] = lambda _: None,
    first: WindowGains | None = None,
) -> tuple[WindowGains, float]:
    """The window feedback whose pushed runs hold for longest, and for which share of their time.

    The motion is of so many equal `cycles`; `first` is a feedback to begin from. The result does
    not depend on the number of processes.

    Raises:
        ConfigurationError: the cycles have not equally many windows, or `first` is of others.
        RunError: all runs fall in their first two windows.
        ActuatedCharactersError: a name or value is wrong.
    """
    turns = headings(fit.headings)
    with some_processes(workers) as parallel:
        trials = WindowTrials(problem, settings, cycles, parallel)
        gains = first or trials.nothing()
        trials.check(gains)
        found: list[tuple[float, WindowGains]] = []
        given = (
            [] if first is None else [(_tested(trials, first, fit, turns, settings.seed), first)]
        )
        data = _explored(trials, gains, turns, settings.seed)
        for number in range(1, fit.rounds + 1):
            model = identified(data, trials.largest, trials.cycle)
            gains = regulator(model, trials.dofs)
            runs = [
                WindowRun(turn, (settings.seed, number, kind, index), noise, push)
                for kind, (noise, push) in enumerate(_kinds(fit.push))
                for index, turn in enumerate(turns)
            ]
            tried = trials.tried((gains, run) for run in runs)
            held = float(np.mean([one.windows for one in tried[: _PUSHED * len(turns)]]))
            found.append((held, gains))
            data = Transitions.joined([data, *(one.transitions for one in tried)])
            data = data.last(_MOST_TRANSITIONS)
            best, leading = max([*given, *found], key=lambda pair: pair[0])
            report(WindowFitState(number, held, best, trials.windows, leading))
        finalists = [one for _, one in sorted(found, key=lambda pair: -pair[0])[:_FINALISTS]]
        if len(found) > 2:
            finalists.append(_mean([one for _, one in found[len(found) // 2 :]]))
        finalists += [one for _, one in given]
        return _best_of(trials, finalists, fit, turns, settings.seed)


def _kinds(push: float) -> list[tuple[float, float]]:
    """Noise and push of a round's runs at each heading: those that count come first."""
    return [*[(0.0, push)] * _PUSHED, *((noise, 0.0) for noise in _NOISES)]


def _explored(
    trials: WindowTrials, gains: WindowGains, turns: list[float], seed: int
) -> Transitions:
    """Runs with random offsets, small ones and large ones."""
    runs = [
        WindowRun(turn, (seed, 0, number, index), _FIRST_NOISE * (number + 1) / _FIRST_RUNS)
        for number in range(_FIRST_RUNS)
        for index, turn in enumerate(turns)
    ]
    return Transitions.joined([one.transitions for one in trials.tried((gains, r) for r in runs)])


def _tested(
    trials: WindowTrials, gains: WindowGains, fit: WindowFit, turns: list[float], seed: int
) -> float:
    """Windows that a feedback holds for on average, pushed as often as a round's."""
    runs = [
        WindowRun(turn, (seed, 0, _FIRST_RUNS + number, index), 0.0, fit.push)
        for number in range(_PUSHED)
        for index, turn in enumerate(turns)
    ]
    return float(np.mean([one.windows for one in trials.tried((gains, run) for run in runs)]))


def _mean(gains: list[WindowGains]) -> WindowGains:
    """Of rounds whose samples differ: what is chance in their gains averages out."""
    constants = np.mean([one.constants for one in gains], axis=0)
    return replace(
        gains[0],
        constants=rounded(constants),
        gains=rounded(np.mean([one.gains for one in gains], axis=0)),
    )


def _best_of(
    trials: WindowTrials,
    finalists: list[WindowGains],
    fit: WindowFit,
    turns: list[float],
    seed: int,
) -> tuple[WindowGains, float]:
    """The one of some feedbacks that holds for longest in many runs, the same for all of them."""
    runs = [
        WindowRun(turn, (seed, fit.rounds + 1, number, index), 0.0, fit.push)
        for number in range(_FINAL_RUNS)
        for index, turn in enumerate(turns)
    ]
    tried = trials.tried((gains, run) for gains in finalists for run in runs)
    means = np.array([one.windows for one in tried]).reshape(len(finalists), -1).mean(axis=1)
    best = int(np.argmax(means))
    return finalists[best], float(means[best]) / trials.windows
