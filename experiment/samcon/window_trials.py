"""Runs of a window feedback from the first state, pushed and with random offsets; what they tell.

The motion begins at several headings, as the engine's friction is not the same in all directions
of the world (docs/reconstruction.md).
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import joblib
import numpy as np

from controller_node.window_gains import WindowGains
from experiment.planned_push import PlannedPush
from experiment.samcon.gains_file import check_cycle
from experiment.samcon.identification import Transitions
from experiment.samcon.problem import Problem, windows_a_cycle
from experiment.samcon.rollout import Rollout
from experiment.samcon.settings import Settings
from experiment.samcon.trials import random_pushes, turned
from experiment.samcon.workers import leave_interrupts_to_the_parent, rollout_of
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError

_NUDGE = 0.03  # of the largest offsets, in the first window of each run


@dataclass(frozen=True)
class WindowRun:
    """One run of a window feedback."""

    heading: float  # rad, by which the motion is turned
    seed: tuple[int, ...]
    noise: float = 0.0  # of the largest offsets, in each window
    push: float = 0.0  # N s, each two seconds, from any side


@dataclass(frozen=True)
class WindowTried:
    """What became of a run."""

    windows: int  # that it held
    transitions: Transitions  # without the windows in which it was pushed


class WindowTrials:
    """Runs window feedbacks of a problem's motion, on some processes; None is this one alone."""

    def __init__(
        self,
        problem: Problem,
        settings: Settings,
        cycles: int,
        parallel: joblib.Parallel | None = None,
    ) -> None:
        self._problem = replace(problem, window_feedback="", pushes=())
        self._settings = settings
        self._parallel = parallel
        rollout = rollout_of(self._problem)
        self.windows = len(rollout.windows)
        self.cycle = windows_a_cycle(self.windows, cycles)
        largest = settings.largest_offsets(rollout.layout)
        moved = np.flatnonzero(largest)
        self.largest: FloatArray = largest[moved]
        self.dofs = tuple(rollout.layout.dof_names[index] for index in moved)

    def nothing(self) -> WindowGains:
        """The gains of no feedback at all."""
        moved, width = len(self.dofs), rollout_of(self._problem).deviations(self.dofs).width
        constants = np.zeros((self.cycle, moved))
        return WindowGains(self.dofs, self.largest, constants, np.zeros((*constants.shape, width)))

    def check(self, gains: WindowGains) -> None:
        """Raise ConfigurationError if a feedback is of other windows or degrees of freedom."""
        check_cycle(gains.windows, self.cycle)
        if gains.dofs != self.dofs:
            raise ConfigurationError(
                f"the window feedback moves {', '.join(gains.dofs)}; here it is "
                f"{', '.join(self.dofs)}"
            )

    def tried(self, pairs: Iterable[tuple[WindowGains, WindowRun]]) -> list[WindowTried]:
        """What became of runs of window feedbacks, in order."""
        one = partial(_tried, self._problem, self._settings)
        if self._parallel is None:
            return [one(gains, run) for gains, run in pairs]
        work = (joblib.delayed(_in_process)(one, gains, run) for gains, run in pairs)
        return list(self._parallel(work))


def _in_process(one: "partial[WindowTried]", gains: WindowGains, run: WindowRun) -> WindowTried:
    leave_interrupts_to_the_parent()
    return one(gains, run)


def _tried(problem: Problem, settings: Settings, gains: WindowGains, run: WindowRun) -> WindowTried:
    """A window feedback's run over the whole problem."""
    rollout = rollout_of(turned(problem, run.heading))
    rollout.act(problem.feedback, gains)
    rng = np.random.default_rng(np.random.SeedSequence(run.seed))
    largest = settings.largest_offsets(rollout.layout)
    offsets = run.noise * largest * rng.normal(size=(len(rollout.windows), len(largest)))
    offsets[0] += _NUDGE * largest * rng.uniform(-1.0, 1.0, len(largest))
    pushes = random_pushes(rollout.plan, rng, run.push, problem.duration) if run.push else ()
    plain = np.array([rollout.plain(window) for window in range(len(offsets))])
    ends = rollout.follow(plain + offsets, pushes, settings.bounds)
    held = int(np.isfinite(ends).all(axis=1).sum())
    return WindowTried(held, _transitions(rollout, gains, offsets, ends[:held], pushes))


def _transitions(
    rollout: Rollout,
    gains: WindowGains,
    offsets: FloatArray,
    ends: FloatArray,
    pushes: Sequence[PlannedPush],
) -> Transitions:
    """What happened in the windows of a run, but for the first one and those with a push."""
    deviations, size = rollout.deviations(gains.dofs), rollout.layout.size
    times = rollout.windows.ends
    seen = [
        deviations.of(time, end[:size], end[size : 2 * size])
        for time, end in zip(times, ends, strict=False)
    ]
    features = np.array(seen).reshape(len(ends), deviations.width)
    used = np.arange(1, len(ends))
    used = used[~np.isin(used, _pushed(rollout, pushes))]
    acting = [gains.offset(int(window), features[window - 1]) for window in used]
    moved = offsets[used][:, deviations.entries]
    return Transitions(
        used % gains.windows,
        features[used - 1],
        moved + np.array(acting).reshape(moved.shape),
        features[used],
    )


def _pushed(rollout: Rollout, pushes: Sequence[PlannedPush]) -> list[int]:
    """The windows in which a push acts."""
    held = rollout.plan.simulator.number("wrench_duration")
    starts = [rollout.time_of(push) for push in pushes]
    ends = rollout.windows.ends
    windows = [(bisect_right(ends, time), bisect_left(ends, time + held)) for time in starts]
    return [window for first, last in windows for window in range(first, last + 1)]
