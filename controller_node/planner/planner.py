"""The planner: offsets to the reference that a model of the world says keep the motion.

At a fixed period it looks ahead from the state in the message: it rolls out samples around the plan
that it has, in a model with contact and the very law that will act, and takes Gauss-Newton steps
towards the reference by how the samples' errors differ. Of all that it has tried the best is the
plan. The offsets are added to the tracking errors of the joints; no force acts on the root.

Sources: Liu et al. 2010, "Sampling-based Contact-rich Motion Control" (corrections of a reference
by samples); Howell et al. 2022, "Predictive Sampling: Real-time Behaviour Synthesis with MuJoCo"
(planning online in a model).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from controller_node.laws import GainArrays
from controller_node.planner.anchor import Anchor, Balance, balance_of
from controller_node.planner.comparison import Comparison
from controller_node.planner.compiled.draws import normal_draws
from controller_node.planner.compiled.rollout import Body
from controller_node.planner.contact_model import ContactModel
from controller_node.planner.course import Course, DesiredAt, Foreseen, Target
from controller_node.planner.late_commands import LateCommands
from controller_node.planner.offsets import Offsets
from controller_node.planner.outlook import Outlook
from controller_node.planner.rollouts import Rollouts
from controller_node.planner.search import Found, Problem, improve
from controller_node.planner.settings import PlannerSettings
from controller_node.references.base import ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.character import Character
from msgs_config.geometry import fixed_order
from msgs_config.stamped import StampedState

_FIRST_ROUNDS = 6  # of the first plan: nothing has moved yet
_LARGEST = 0.9  # sigma, of an offset
_PENALTY = 0.2  # of an offset, for each sigma
_FADING = 0.7  # of sensitivities, from plan to plan
_FEWEST_DRAWS = 6


@dataclass(frozen=True)
class Plan:
    """Offsets over a horizon, and what was learned while they were found."""

    tick: int  # at which it was made, since the episode began
    offsets: Offsets
    sensitivities: FloatArray | None  # (k (n - 6), checks f) of features to offsets
    areas: FloatArray  # (k,) ticks of the horizon that each knot counts for
    outlook: Outlook


@dataclass(frozen=True)
class PlannerMemory:
    """All that a planner goes on from."""

    plan: Plan | None
    anchor: Anchor
    sent: Mapping[int, FloatArray]  # commands that have not acted yet


class PredictivePlanner:
    """Plans for one character. It remembers its last plan, until an episode begins."""

    def __init__(
        self, character: Character, settings: PlannerSettings, *, rate_hz: int, gravity: float
    ) -> None:
        """Build the model of the world, once for each thread.

        The first time on a machine the rollouts are compiled, which takes half a minute.
        """
        self.settings = settings
        self._model = ContactModel(
            character, period_s=1.0 / rate_hz, gravity=gravity, friction=settings.friction
        )
        self._rollouts = Rollouts(self._model, settings.workers)
        self.late_commands = (
            LateCommands(character, self._model, settings.delay) if settings.delay else None
        )
        self._comparison = Comparison(character, self._model, settings)
        self._rate_hz = rate_hz
        self._unit = settings.noise * settings.sigma  # (n - 6,) of what is looked for
        self._seed = settings.seed
        self._episode = 0
        self._plan: Plan | None = None
        self._anchor = Anchor()
        self._course = Course(self._model, self._rollouts, settings)
        self._compile(character)

    @property
    def outlook(self) -> Outlook | None:
        """What is expected of the plan in force, the same object as long as it is."""
        return None if self._plan is None else self._plan.outlook

    def between_rollouts(self, act: Callable[[], None]) -> None:
        """Have something done again and again while it plans."""
        self._rollouts.between = act

    def begin_episode(self, episode: int) -> None:
        """Forget plan and reference; `episode` is the tick of the episode's first state."""
        self._episode = episode
        self._plan = None
        self._anchor = Anchor()
        self._course.forget()
        if self.late_commands is not None:
            self.late_commands.forget()

    @property
    def plan(self) -> Plan | None:
        """The plan in force."""
        return self._plan

    def memory(self) -> PlannerMemory:
        """What it goes on from, to be recalled by this planner or an equal one."""
        late = self.late_commands
        return PlannerMemory(self._plan, self._anchor, {} if late is None else late.sent())

    def recall(self, memory: PlannerMemory, seed: int) -> None:
        """Go on from a memory, with samples of a seed."""
        self._seed, self._plan, self._anchor = seed, memory.plan, memory.anchor
        if self.late_commands is not None:
            self.late_commands.recall(memory.sent)

    def change_reference(self) -> None:
        """Say that the reference is another one from now on; the plan stays."""
        self._course.forget()

    def rest(self) -> None:
        """Forget the plan, and where the reference had given way to: nothing is tracked."""
        self._plan, self._anchor = None, Anchor()

    def offset(
        self, tick: int, state: StampedState, gains: GainArrays, desired_at: DesiredAt
    ) -> FloatArray:
        """What is added to the tracking errors (n,) of a state; zero for the root.

        Args:
            tick: Of the state, since the episode began.
            state: In which the offset acts.
            gains: In force.
            desired_at: The reference.
        """
        if self._plan is not None and tick < self._plan.tick:
            self._plan = None  # a state of before comes once more: what was planned since is over
        if self._plan is None or tick >= self._plan.tick + self.settings.period:
            self._plan = self._planned(tick, state, gains, desired_at)
        return np.concatenate((np.zeros(6), self._plan.offsets.at(tick)))

    def _compile(self, character: Character) -> None:
        """Have all compiled before the first state waits for an answer: one rollout at rest."""
        layout = character.layout
        rest, nothing = np.array(character.rest_position), np.zeros(layout.size)
        still = ReferenceState(layout.configuration(rest), nothing, nothing)
        gains = GainArrays(nothing, nothing, nothing, character.effort_limits())
        position, body = self._model.position_of(rest), self._model.body(gains)
        desired = self._course.ahead(0, lambda _: still, body)
        problem = self._problem(position, nothing, desired, body, gives_way=False)
        place = np.zeros(self._knot_count(0) * len(self._unit))
        draws = normal_draws((0, 0), (0, 0), _FEWEST_DRAWS * place.size).reshape(-1, place.size)
        found = improve(problem, place, draws, None)
        improve(problem, found.place, draws, found.sensitivities)
        self._course.forget()

    def cost(
        self, tick: int, state: StampedState, gains: GainArrays, desired_at: DesiredAt
    ) -> float:
        """What a state costs against the reference where it is, without giving way.

        The arguments are those of `offset`.
        """
        body, position = self._model.body(gains), self._model.position_of(state.position)
        features = self._rollouts.features_of(position, state.velocity.copy(), body)
        wanted = self._course.target(tick, desired_at, body).features
        residuals = self._comparison.residuals(features - wanted, gives_way=False)
        return self.settings.checks * float(fixed_order.dot(residuals, residuals))

    def cost_ahead(
        self, tick: int, state: StampedState, gains: GainArrays, desired_at: DesiredAt
    ) -> float:
        """What a state will cost, on average, in going on with the plan in force.

        As `cost`; infinite where that leads to nothing.
        """
        body, position = self._model.body(gains), self._model.position_of(state.position)
        desired = self._course.ahead(tick, desired_at, body)
        problem = self._problem(position, state.velocity.copy(), desired, body, gives_way=False)
        residuals = problem.residuals(problem.deviations(self._left(tick).ravel()[np.newaxis])[0])
        cost = float(fixed_order.dot(residuals, residuals))
        return cost if math.isfinite(cost) else math.inf

    def _planned(
        self, tick: int, state: StampedState, gains: GainArrays, desired_at: DesiredAt
    ) -> Plan:
        """A plan from a state."""
        settings, old = self.settings, self._plan
        body = self._model.body(gains)
        desired = self._course.ahead(tick, desired_at, body)
        position, velocity = self._look(
            tick, state, body, self._course.target(tick, desired_at, body)
        )
        gives_way = self._anchor.gives_way(tick / self._rate_hz)
        problem = self._problem(position, velocity, desired, body, gives_way=gives_way)
        place = self._left(tick)
        first_knot = desired.rollout.first_knot
        areas = _areas(tick - first_knot * settings.knots, settings, len(place))
        sensitivities, rounds, enough = None, _FIRST_ROUNDS, 0.0
        if old is not None:
            sensitivities = self._faded(old, tick, first_knot, areas)
            rounds, enough = settings.rounds, settings.tolerance
        best = place.ravel()
        for number in range(rounds):
            draws = normal_draws(
                (self._seed, self._episode), (number, tick), settings.samples * place.size
            )
            samples = draws.reshape(settings.samples, place.size)
            found = improve(problem, best, samples, sensitivities)
            best, sensitivities = found.place, found.sensitivities
            if found.cost < enough:
                break
        offsets = Offsets(settings.knots, first_knot, best.reshape(place.shape) * self._unit)
        outlook = self._outlook(found, problem, desired)
        return Plan(tick, offsets, sensitivities, areas, outlook)

    def _left(self, tick: int) -> FloatArray:
        """What is left of the plan in force at a tick, in units (k, n - 6); zero beyond its end."""
        place = np.zeros((self._knot_count(tick), len(self._unit)))
        if self._plan is not None:
            known = self._plan.offsets
            rows = np.arange(len(place)) + (tick // known.knot_ticks - known.first_knot)
            there = rows < len(known.rows)
            place[there] = known.rows[np.maximum(rows[there], 0)] / self._unit
        return place

    def _outlook(self, found: Found, problem: Problem, desired: Foreseen) -> Outlook:
        """What is expected of a plan."""
        settings, checks = self.settings, self.settings.checks
        residuals = problem.residuals(found.deviations).reshape(2, checks, -1)
        best = found.deviations[0].reshape(checks, -1)
        centres, _ = self._comparison.balance(desired.features + best)
        numbers: FloatArray = np.arange(1.0, checks + 1.0)
        times = (settings.delay + settings.period * numbers) / self._rate_hz
        costs, others = fixed_order.dot(residuals, residuals)
        return Outlook(times, self._anchor.out_of(centres), costs, others, self._anchor)

    def _look(
        self, tick: int, state: StampedState, body: Body, target: Target
    ) -> tuple[FloatArray, FloatArray]:
        """A state in the reference's world, (q,) and (n,), which may have given way to it."""
        position = self._model.position_of(state.position)
        velocity = state.velocity.copy()  # a message's cannot be written to: another type
        seen = self._anchor.into(position, velocity)
        features = self._rollouts.features_of(*seen, body)
        since_plan = tick - (tick if self._plan is None else self._plan.tick)
        self._anchor = self._anchor.follow(
            self._balance(seen[0], features),
            self._balance(target.position, target.features),
            tick / self._rate_hz,
            since_plan / self._rate_hz,
        )
        return self._anchor.into(position, velocity)

    def _balance(self, position: FloatArray, features: FloatArray) -> Balance:
        centre, velocity = self._comparison.balance(features)
        return balance_of(position, velocity, centre)

    def _problem(
        self,
        position: FloatArray,
        velocity: FloatArray,
        desired: Foreseen,
        body: Body,
        *,
        gives_way: bool,
    ) -> Problem:
        """What a plan from a state is to make small."""
        settings, checks = self.settings, self.settings.checks

        def deviations(places: FloatArray) -> FloatArray:
            plans = places.reshape(len(places), -1, len(self._unit)) * self._unit
            found, sound = self._rollouts.simulate(position, velocity, plans, desired.rollout, body)
            rows = (found - desired.features).reshape(len(places), -1)
            rows[~sound] = np.nan
            return rows

        def residuals(rows: FloatArray) -> FloatArray:
            by_check = rows.reshape(*rows.shape[:-1], checks, -1)
            return self._comparison.residuals(by_check, gives_way=gives_way).reshape(rows.shape)

        knots = self._knot_count(desired.rollout.first_tick)
        penalty = _PENALTY * settings.noise
        largest = _LARGEST / settings.noise
        return Problem(deviations, residuals, penalty * penalty / knots, largest)

    def _knot_count(self, tick: int) -> int:
        """How many knots a plan has that is made at a tick."""
        settings = self.settings
        return (tick + settings.horizon - 1) // settings.knots + 2 - tick // settings.knots

    def _faded(self, old: Plan, tick: int, first_knot: int, areas: FloatArray) -> FloatArray | None:
        """The sensitivities (d, m) of the plan before, at this one's knots and checks.

        A knot's go with its part in the horizon. A new knot's are zero, a new check has the last
        one's.
        """
        if old.sensitivities is None:
            return None
        settings = self.settings
        known = old.sensitivities.reshape(len(old.areas), len(self._unit), settings.checks, -1)
        passed = (tick - old.tick) // settings.period
        checks = np.minimum(np.arange(settings.checks) + passed, settings.checks - 1)
        faded = np.zeros((len(areas), *known.shape[1:]))
        for knot, area in enumerate(areas):
            before = knot + first_knot - old.offsets.first_knot
            if before < len(known) and old.areas[before] > 0.0:
                share = _FADING * min(1.0, area / old.areas[before])
                faded[knot] = share * known[before][:, checks]
        return faded.reshape(len(areas) * len(self._unit), -1)


def _areas(since_knot: int, settings: PlannerSettings, count: int) -> FloatArray:
    """For how many ticks of the horizon each knot (k,) counts, by its weight in each."""
    ticks = (since_knot + np.arange(settings.horizon)) / settings.knots
    from_knots = np.abs(ticks - np.arange(count)[:, np.newaxis])
    return np.array([float(np.add.accumulate(row)[-1]) for row in np.maximum(1.0 - from_knots, 0)])
