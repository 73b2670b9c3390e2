"""The search for a plan: rounds of rollouts from one state, Gauss-Newton steps, the best of all."""

import math
from dataclasses import dataclass

import numpy as np

from controller_node.planner.anchor import Anchor
from controller_node.planner.compiled.draws import normal_draws
from controller_node.planner.compiled.rollout import RolloutModel
from controller_node.planner.outlook import Outlook
from controller_node.planner.plan import Plan, areas_of
from controller_node.planner.sampled_reference import Foreseen
from controller_node.planner.search.cost import ResidualModel
from controller_node.planner.search.rollout_pool import RolloutPool
from controller_node.planner.search.round import Found, LeastSquaresProblem, improve
from controller_node.planner.settings import PlannerSettings
from controller_node.references.offsets import Offsets
from msgs_config.arrays import FloatArray
from msgs_config.geometry import fixed_order

_FIRST_ROUNDS = 6  # rounds for the first plan: nothing has moved yet
_WIDE_FACTOR = 2.5  # every other round looks so much farther: it may find another way out
_MORE = 3  # times as many samples in the rounds after the first
_MAX_OFFSET = 0.9  # sigma, the largest offset
_PENALTY = 0.2  # residual of an offset, for each sigma
_FEWEST_DRAWS = 6


@dataclass(frozen=True)
class Start:
    """Where a plan begins, in the world of the reference, and what is to be followed from there."""

    seen: int  # tick of the state that the plan is sought from
    position: FloatArray  # (q,) as MuJoCo has it
    velocity: FloatArray  # (n,)
    desired: Foreseen
    body: RolloutModel
    anchor: Anchor
    perturbed: bool  # whether the character is pushed off: then its feet go where they catch it


class PlanSearch:
    """Finds plans. It remembers nothing."""

    def __init__(
        self,
        rollouts: RolloutPool,
        residual_model: ResidualModel,
        settings: PlannerSettings,
    ) -> None:
        self._rollouts, self._residual_model = rollouts, residual_model
        self._settings = settings
        self._unit = settings.parameters.noise * settings.sigma  # (n - 6,) rad or m: the unit of x

    def find(
        self,
        start: Start,
        old: Plan | None,
        seed: tuple[int, int],
        guess: FloatArray | None = None,
    ) -> Plan:
        """A plan from a state, sought around what is left of an old one.

        Without an old one it is sought around a guess: offsets (n - 6,) that are held, or zero.
        `seed` is of its draws: the planner's and the episode.
        """
        settings, tick = self._settings, start.desired.rollout.first_tick
        problem = self._problem(start)
        count = self._knot_count(tick)
        areas = areas_of(tick, count, settings)
        place, sensitivities = self._left(old, tick), None
        if old is None and guess is not None:
            place = np.tile(guess / self._unit, count)
        rounds, enough = _FIRST_ROUNDS, 0.0
        if old is not None:
            sensitivities = old.faded(tick, areas, settings)
            rounds, enough = settings.parameters.rounds, settings.parameters.tolerance
        for number in range(rounds):
            found = improve(problem, place, self._samples(seed, number, tick), sensitivities)
            place, sensitivities = found.place, found.sensitivities
            if found.cost < (number + 1) * enough:
                break
        rows = place.reshape(count, -1) * self._unit
        offsets = Offsets(settings.knots, start.desired.rollout.first_knot, rows)
        outlook = self._outlook(found, problem, start)
        return Plan(start.seen, tick, offsets, sensitivities, areas, outlook)

    def rehearse(self, start: Start) -> None:
        """Have all compiled that a search needs."""
        problem = self._problem(start)
        place = self._left(None, start.desired.rollout.first_tick)
        draws = normal_draws((0, 0), (0, 0), _FEWEST_DRAWS * place.size)
        samples = draws.reshape(_FEWEST_DRAWS, place.size)
        found = improve(problem, place, samples, None)
        improve(problem, found.place, samples, found.sensitivities)

    def cost_ahead(self, start: Start, plan: Plan | None) -> float:
        """What going on with a plan will cost, on average; infinite if it leads to nothing."""
        problem = self._problem(start)
        place = self._left(plan, start.desired.rollout.first_tick)
        residuals = problem.residuals(problem.deviations(place[np.newaxis])[0])
        cost = float(fixed_order.dot(residuals, residuals))
        return cost if math.isfinite(cost) else math.inf

    def _samples(self, seed: tuple[int, int], number: int, tick: int) -> FloatArray:
        """The draws (s, d) of a round, by its number."""
        count = self._settings.parameters.samples * (_MORE if number else 1)
        size = self._knot_count(tick) * len(self._unit)
        draws = normal_draws(seed, (number, tick), count * size).reshape(count, size)
        return _WIDE_FACTOR * draws if number % 2 else draws

    def _left(self, plan: Plan | None, tick: int) -> FloatArray:
        """What is left of a plan at a tick (d,), in units."""
        count = self._knot_count(tick)
        if plan is None:
            return np.zeros(count * len(self._unit))
        return (plan.left(tick, count) / self._unit).ravel()

    def _problem(self, start: Start) -> LeastSquaresProblem:
        """What a plan from a state is to make small."""
        noise, checks, desired = (
            self._settings.parameters.noise,
            self._settings.checks,
            start.desired,
        )

        def deviations(places: FloatArray) -> FloatArray:
            plans = places.reshape(len(places), -1, len(self._unit)) * self._unit
            found, sound = self._rollouts.simulate(
                start.position, start.velocity, plans, desired.rollout, start.body
            )
            rows = (found - desired.features).reshape(len(places), -1)
            rows[~sound] = np.nan
            return rows

        def residuals(rows: FloatArray) -> FloatArray:
            by_check = rows.reshape(*rows.shape[:-1], checks, -1)
            weighted = self._residual_model.residuals(by_check, perturbed=start.perturbed)
            return weighted.reshape(rows.shape)

        penalty = _PENALTY * noise
        knots = self._knot_count(desired.rollout.first_tick)
        return LeastSquaresProblem(
            deviations, residuals, penalty * penalty / knots, _MAX_OFFSET / noise
        )

    def _knot_count(self, tick: int) -> int:
        """How many knots a plan has that acts from a tick on."""
        settings = self._settings
        return (tick + settings.horizon - 1) // settings.knots + 2 - tick // settings.knots

    def _outlook(self, found: Found, problem: LeastSquaresProblem, start: Start) -> Outlook:
        """What is expected of a plan."""
        settings, checks = self._settings, self._settings.checks
        residuals = problem.residuals(found.deviations).reshape(2, checks, -1)
        best = found.deviations[0].reshape(checks, -1)
        centres, _ = self._residual_model.balance(start.desired.features + best)
        numbers: FloatArray = np.arange(1.0, checks + 1.0)
        given = settings.parameters
        times = (given.delay + settings.period * numbers) / given.rate_hz
        costs, others = fixed_order.dot(residuals, residuals)
        return Outlook(times, start.anchor.to_world(centres), costs, others, start.anchor)
