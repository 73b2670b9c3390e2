"""Simulates samples: the same simulation and the same controller as a run, window by window."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from controller_node.controller import Controller
from controller_node.feedback import Feedback, Responding, responding
from controller_node.feedback_gains import FeedbackGains
from controller_node.parameters import make_controller
from controller_node.references.base import Reference, ReferenceState
from controller_node.references.corrected import Offset
from controller_node.window_feedback import Deviations, WindowFeedback
from controller_node.window_gains import WindowGains
from experiment.planned_push import PlannedPush, push_schedule
from experiment.samcon import cost
from experiment.samcon.features import Features
from experiment.samcon.feedforward import Feedforward
from experiment.samcon.gains_file import digest, read_gains
from experiment.samcon.problem import Problem
from experiment.samcon.settings import Bounds, Settings
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError, SimulationError
from msgs_config.joint_layout import Configuration
from msgs_config.tick_clock import NANOSECONDS_PER_SECOND
from sim_node.parameters import make_role, make_settings
from sim_node.simulation import Simulation, Snapshot

_LARGEST_PLAIN = 0.8  # rad or m


@dataclass(frozen=True)
class Branch:
    """A kept state, and the samples that are to go on from it."""

    snapshot: Snapshot | None  # a state on the way there; None: the first one
    start: int  # the window that begins in it
    path: FloatArray  # (p, n) offsets of the windows from there on, the last one's first
    before: FloatArray  # (n,) offset of the window before the path, zeros if there is none
    samples: FloatArray  # (s, n) offsets to try in the window after the path
    lookahead: int = 0  # windows without a correction that are simulated after that, to look


@dataclass(frozen=True)
class Expansion:
    """What has become of a branch."""

    snapshot: Snapshot  # the kept state itself
    start: FloatArray  # (f,) its features
    features: FloatArray  # (s, 1 + l, f) at the windows' ends; NaN after a divergence, and the end


@dataclass(frozen=True)
class _Table:
    """The motion itself at the times of a window."""

    index: dict[float, int]  # of each time
    first: ReferenceState
    states: ReferenceState  # (t, n) rows

    @classmethod
    def of(cls, motion: Reference, times: tuple[float, ...]) -> "_Table":
        """The motion at times in s."""
        states = [motion.sample(time) for time in times]
        table = ReferenceState(
            Configuration(
                np.array([state.configuration.position for state in states]),
                np.array([state.configuration.orientations_xyzw for state in states]),
            ),
            np.array([state.velocity for state in states]),
            np.array([state.acceleration for state in states]),
        )
        return cls({time: row for row, time in enumerate(times)}, states[0], table)


class Trial:
    """The reference of a window that is being tried: the motion with one offset."""

    def __init__(self, motion: Reference) -> None:
        self._motion = motion
        self._known: dict[tuple[float, ...], _Table] = {}  # by a window's times, for all samples
        self._index: dict[float, int] = {}
        self._sampled: list[ReferenceState] = []

    def set(self, times: tuple[float, ...], before: Offset | None, offset: Offset) -> None:
        """Have an offset at times in s but the first one, which has that of the window before.

        All times are worked out at once: `Offset` gives each of them the same doubles so.
        """
        known = self._known.get(times)
        if known is None:
            known = self._known[times] = _Table.of(self._motion, times)
        first = known.first if before is None else before.applied(known.first)
        table = offset.applied(known.states)
        rows = zip(
            table.configuration.position,
            table.configuration.orientations_xyzw,
            table.velocity,
            table.acceleration,
            strict=True,
        )
        states = [ReferenceState(Configuration(p, q), v, a) for p, q, v, a in rows]
        self._index, self._sampled = known.index, [first, *states[1:]]

    def sample(self, time: float) -> ReferenceState:
        """The desired state at one of the times, as `CorrectedReference` has it."""
        return self._sampled[self._index[time]]


class Rollout:
    """One engine and one controller, which try offsets from saved states."""

    def __init__(self, problem: Problem) -> None:
        """Build both.

        Raises:
            ActuatedCharactersError: the problem's plan cannot be made.
        """
        plan = problem.plan()
        self.plan = plan
        self.layout = plan.character.layout
        self.windows = problem.windows(plan)
        self.features = Features(plan.character)
        self._trial = Trial(plan.reference)
        self._feedback: Feedback | None = None
        self._deviations: dict[tuple[str, ...], Deviations] = {}  # by what is moved
        self._by_window: WindowFeedback | None = None
        self.window_gains: WindowGains | None = None
        if problem.window_feedback:
            self.window_gains = read_gains(problem.window_feedback)
            if problem.window_digest not in ("", digest(self.window_gains)):
                raise ConfigurationError(
                    f"window feedback {problem.window_feedback} is not what it was at the start"
                )
            self._by_window = self._window_feedback(self.window_gains)
        self._controller = self._responding(problem.feedback)
        self._feedforward = Feedforward(
            plan.character,
            plan.reference,
            self._controller.settings.gains,
            self._controller.clock.period_s,
        )
        self.height = float(self.desired(0)[2]) if self.layout.has_floating_base else 1.0  # m
        self._share = problem.feedforward
        self._needed: dict[int, FloatArray] = {}  # of the inverse dynamics, by window
        self._planned = problem.planned_pushes(plan)
        self._pushes = push_schedule(plan, ())
        self._simulation = self._fresh()
        self._episode_ns = self._simulation.actors[0].state.stamp_ns

    def close(self) -> None:
        """End the engine."""
        self._simulation.close()

    def act(self, gains: Mapping[str, float], by_window: WindowGains | None = None) -> None:
        """Have other feedbacks than the problem's."""
        self._by_window = None if by_window is None else self._window_feedback(by_window)
        self._controller = self._responding(gains)

    def deviations(self, dofs: tuple[str, ...]) -> Deviations:
        """How the character deviates from the motion: what a window feedback looks at."""
        if dofs not in self._deviations:
            self._deviations[dofs] = Deviations(self.plan.character, self.plan.reference, dofs)
        return self._deviations[dofs]

    def _window_feedback(self, gains: WindowGains) -> WindowFeedback:
        return WindowFeedback(self.deviations(gains.dofs), gains, self.windows.ends)

    def _responding(self, gains: Mapping[str, float]) -> Controller:
        plan = self.plan
        feedbacks: list[Responding] = []
        if any(gains.values()):
            found = FeedbackGains.of(gains)
            if self._feedback is None:
                known = plan.ticks + 1
                self._feedback = Feedback(plan.character, plan.reference, found, known_ticks=known)
            feedbacks.append(self._feedback.with_gains(found))
        if self._by_window is not None:
            feedbacks.append(self._by_window)
        return make_controller(plan.character, responding(self._trial, feedbacks), plan.controller)

    def time_of(self, push: PlannedPush) -> float:
        """Time in s of a push since the first state."""
        return (push.stamp_ns - self._episode_ns) / NANOSECONDS_PER_SECOND

    def desired(self, window: int) -> FloatArray:
        """The features (f,) of the motion at a window's end."""
        end = self.windows.time(int(self.windows.bounds[window + 1]))
        state = self.plan.reference.sample(end)
        return self.features.row(state.configuration.position, state.velocity)

    def costs(self, window: int, ends: FloatArray, settings: Settings) -> FloatArray:
        """The costs (s,) of features (s, f) at a window's end; infinite of what is lost."""
        rows, desired = np.nan_to_num(ends), self.desired(window)
        terms = cost.terms(self.layout, self.height, rows, desired, settings.bounds)
        sound = np.all(np.isfinite(ends), axis=1)
        return np.where(sound, terms.cost(settings.weights), np.inf)

    def plain(self, window: int) -> FloatArray:
        """The offset (n,) of a window without a correction: a share of the inverse dynamics'."""
        if not self._share:
            return np.zeros(self.layout.size)
        if window not in self._needed:
            found = self._share * self._feedforward.offset(self.windows.times(window))
            self._needed[window] = np.clip(found, -_LARGEST_PLAIN, _LARGEST_PLAIN)
        return self._needed[window]

    def expand(self, branch: Branch) -> Expansion:
        """Try a branch's samples."""
        if branch.snapshot is None:
            self._begin_anew()
        else:
            self._simulation.take_over(branch.snapshot)
        simulation = self._simulation
        self._pushes = push_schedule(self.plan, self._planned)
        window, before = branch.start, self._offset(branch.start - 1, branch.before)
        for row in branch.path:
            offset = Offset(self.layout, row)
            self._advance(window, before, offset)
            window, before = window + 1, offset
        saved, snapshot, start = simulation.save(), simulation.snapshot(), self._features()
        rows = np.full((len(branch.samples), 1 + branch.lookahead, self.features.width), np.nan)
        for row, sample in zip(rows, branch.samples, strict=True):
            simulation.restore(saved)
            self._pushes = push_schedule(self.plan, self._planned)
            ahead = range(window + 1, min(window + len(row), len(self.windows)))
            offsets = [sample, *(self.plain(later) for later in ahead)]
            self._follow(window, before, offsets, row)
        simulation.forget(saved)
        return Expansion(snapshot, start, rows)

    def follow(
        self, offsets: FloatArray, pushes: Sequence[PlannedPush] = (), bounds: Bounds | None = None
    ) -> FloatArray:
        """A run from the first state with offsets (w, n) of its windows: features (w, f) at ends.

        The pushes come beside the problem's. Once it is lost the features are NaN.
        """
        self._begin_anew()
        self._pushes = push_schedule(self.plan, (*self._planned, *pushes))
        rows = np.full((len(offsets), self.features.width), np.nan)
        self._follow(0, None, list(offsets), rows, bounds)
        return rows

    def _begin_anew(self) -> None:
        """Return to the first state: only a new world returns to a state without a step."""
        self._simulation.close()
        self._simulation = self._fresh()

    def _follow(
        self,
        window: int,
        before: Offset | None,
        offsets: Sequence[FloatArray],
        rows: FloatArray,
        bounds: Bounds | None = None,
    ) -> None:
        """Fill in the features (w, f) that offsets lead to, as far as it goes well."""
        for row, numbers in zip(rows, offsets, strict=False):
            offset = Offset(self.layout, numbers)
            try:
                self._advance(window, before, offset)
            except SimulationError:
                return
            row[:] = self._features()
            if bounds is not None and self._is_lost(window, row, bounds):
                row[:] = np.nan
                return
            window, before = window + 1, offset

    def _is_lost(self, window: int, row: FloatArray, bounds: Bounds) -> bool:
        rows, desired = row[np.newaxis], self.desired(window)
        return bool(cost.terms(self.layout, self.height, rows, desired, bounds).lost[0])

    def _features(self) -> FloatArray:
        state = self._simulation.actors[0].state
        return self.features.row(state.position, state.velocity)

    def _fresh(self) -> Simulation:
        role = make_role(self.plan.character, self.plan.simulator)
        return Simulation([role], make_settings(self.plan.simulator))

    def _offset(self, window: int, row: FloatArray) -> Offset | None:
        return Offset(self.layout, row) if window >= 0 else None

    def _advance(self, window: int, before: Offset | None, offset: Offset) -> None:
        """Simulate one window from the present state. Raises SimulationError if it diverges."""
        first, last = self.windows.bounds[window : window + 2].tolist()
        self._trial.set(self.windows.times(window), before, offset)
        simulation, controller = self._simulation, self._controller
        (actor,) = simulation.actors
        for _ in range(last - first):
            effort, _ = controller.answer(actor.state, self._episode_ns)
            simulation.step(
                [np.where(actor.commanded, effort, 0.0)], [self._pushes.take(simulation.tick)]
            )
