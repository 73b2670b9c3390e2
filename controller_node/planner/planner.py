"""The planner: offsets to the reference that a model of the world says keep the motion.

At a fixed period it looks ahead from the state in the message: it rolls out samples around the plan
that it has, in a model with contact and the very law that will act, and takes Gauss-Newton steps
towards the reference by how the samples' errors differ. Of all that it has tried the best is the
plan. The offsets are added to the tracking errors of the joints; no force acts on the root.

Sources: Liu et al. 2010, "Sampling-based Contact-rich Motion Control" (corrections of a reference
by samples); Howell et al. 2022, "Predictive Sampling: Real-time Behaviour Synthesis with MuJoCo"
(planning online in a model).
"""

from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from controller_node.control_laws import GainArrays
from controller_node.ground import FELT, TERRAIN
from controller_node.planner.anchor import Anchor
from controller_node.planner.base import DesiredAt, TickState
from controller_node.planner.commands_in_flight import CommandsInFlight
from controller_node.planner.compiled.anchoring import SOON
from controller_node.planner.compiled.rollout import RolloutModel
from controller_node.planner.contact_model import ContactModel
from controller_node.planner.outlook import Outlook
from controller_node.planner.plan import Plan
from controller_node.planner.sampled_reference import ReferenceSample, SampledReference
from controller_node.planner.search.cost import ResidualModel
from controller_node.planner.search.plan_search import PlanSearch, Start
from controller_node.planner.search.rollout_pool import RolloutPool
from controller_node.planner.settings import PlannerSettings
from controller_node.references.base import ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.geometry import fixed_order
from msgs_config.messages.state import StampedState
from msgs_config.shared_parameters import PLANE

_PATIENCE = 0.005  # s between two looks at what else there is to do


@dataclass(frozen=True)
class PlannerSnapshot:
    """All that a planner goes on from that is not seeking a plan."""

    plan: Plan | None
    anchor: Anchor
    sent: Mapping[int, FloatArray]  # commands that have not acted yet


@dataclass(frozen=True)
class PendingPlan:
    """A plan that is being sought."""

    seen: int  # tick of the state that it is sought from
    tick: int  # the first tick in which it acts
    plan: Future[Plan]


class _FoundPlan(Future[Plan]):
    """A plan that was sought elsewhere, and has been found; it can be copied."""

    def __init__(self, plan: Plan) -> None:
        super().__init__()
        self.set_result(plan)

    def __reduce__(self) -> tuple[object, ...]:
        return _FoundPlan, (self.result(),)


class PredictivePlanner:
    """Plans for one character. It remembers its last plan, until an episode begins.

    Plans are sought by a thread of their own. For the ticks of `planning_delay` the plan before
    goes on acting; a plan that has not been found by then is waited for.
    """

    def __init__(self, character: Character, settings: PlannerSettings) -> None:
        """Build the model of the world, once for each thread.

        The first time on a machine the rollouts are compiled, which takes half a minute.
        """
        self._made_of = (character, settings)
        self.settings, given = settings, settings.parameters
        self._model = ContactModel.of(character, given)
        self._stepped = (  # what plans are tried in
            self._model if settings.step == 1 else ContactModel.of(character, given, settings.step)
        )
        self._rollouts = RolloutPool(self._stepped, given.threads, self._model)
        self.in_flight = (
            CommandsInFlight(character, self._model, given.delay) if given.delay else None
        )
        self._residual_model = ResidualModel(character, self._model, settings)
        self._search = PlanSearch(self._rollouts, self._residual_model, settings)
        self._reference = SampledReference(self._model, self._rollouts, settings)
        self._thread = ThreadPoolExecutor(1)
        self._act: Callable[[], object] = int  # called while it waits; `int` does nothing
        self._rate_hz = given.rate_hz
        self.needs_contacts = given.terrain == FELT
        self._gives_way = given.gives_way and given.terrain in (PLANE, FELT)
        self._seed = given.seed
        self._episode = 0
        self._plan: Plan | None = None
        self._coming: PendingPlan | None = None
        self._guess: FloatArray | None = None  # offsets (n - 6,) of the first plan
        self.anchor = Anchor()
        """Where the reference's world is, for the next plan."""
        self._compile(character)

    def __reduce__(self) -> tuple[object, ...]:
        """For a copy, in this process or another: it goes on alike, with threads of its own."""
        coming = self._coming
        if coming is not None:
            coming = replace(coming, plan=_FoundPlan(coming.plan.result()))
        sent = {} if self.in_flight is None else self.in_flight.sent()
        state = (self._seed, self._episode, self._plan, coming, self.anchor, sent)
        return _copy_of, (self._made_of, state)

    @property
    def outlook(self) -> Outlook | None:
        """What is expected of the plan in force, the same object as long as it is."""
        return None if self._plan is None else self._plan.outlook

    @property
    def parts(self) -> tuple[object, ...]:
        """Nothing that is large and does not change."""
        return ()

    def while_waiting(self, act: Callable[[], None]) -> None:
        """Have something done again and again while it waits for a plan."""
        self._act = act

    def begin_episode(self, episode: int) -> None:
        """Forget plan and reference; `episode` is the tick of the episode's first state."""
        self._episode = episode
        self.rest()
        self._reference.clear()
        if self.in_flight is not None:
            self.in_flight.clear()

    @property
    def plan(self) -> Plan | None:
        """The plan in force."""
        return self._plan

    def snapshot(self) -> PlannerSnapshot:
        """What it goes on from while no plan is sought, for this planner or an equal one."""
        assert self._coming is None
        late = self.in_flight
        return PlannerSnapshot(self._plan, self.anchor, {} if late is None else late.sent())

    def restore(self, snapshot: PlannerSnapshot, seed: int) -> None:
        """Go on from a snapshot, with samples of a seed."""
        self._seed, self._plan, self.anchor = seed, snapshot.plan, snapshot.anchor
        self._coming = None
        if self.in_flight is not None:
            self.in_flight.restore(snapshot.sent)

    def change_reference(self, since: int = 0, clip: str = "") -> None:
        """Say that the reference is another one from a tick on; the plan in force stays."""
        del clip
        self._reference.clear(since)
        if self._coming is not None and since <= self._coming.tick + self.settings.horizon:
            self._abandon_search()

    def rest(self) -> None:
        """Forget the plan, and where the reference had given way to: nothing is tracked."""
        self._plan, self._coming, self.anchor = None, None, Anchor()
        self._guess = None

    def offset(
        self, acting: TickState, seen: TickState, gains: GainArrays, desired_at: DesiredAt
    ) -> FloatArray:
        """What is added to the tracking errors (n,) of a state; zero for the root.

        Args:
            acting: The state in which the offset acts, from which it plans.
            seen: What that is foreseen from does not matter to it.
            gains: In force.
            desired_at: The reference.
        """
        del seen
        tick = acting.tick
        self._forget_what_is_over(tick)
        self._take(tick)
        if self._plan is None:
            self._coming = self._start_search(acting, tick, gains, desired_at)
            self._take(tick)
        assert self._plan is not None
        acts = tick + self.settings.parameters.planning_delay
        if self._coming is None and acts >= self._plan.tick + self.settings.period:
            self._coming = self._start_search(acting, acts, gains, desired_at)
            self._take(tick)
        return np.concatenate((np.zeros(6), self._plan.offsets.at(tick)))

    def take_over(self, anchor: Anchor, offset: FloatArray) -> None:
        """Begin at the next state where another planner ends.

        Its reference's world is where the anchor says, and the first plan is sought around its
        offset (n,), as if that went on.
        """
        self.rest()
        self.anchor, self._guess = anchor, offset[6:]

    def cost(
        self, tick: int, state: StampedState, gains: GainArrays, desired_at: DesiredAt
    ) -> float:
        """What a state costs against the reference where it is, without giving way.

        The arguments are of the state, as in `offset`.
        """
        body, position = self._model.body(gains), self._model.position_of(state.position)
        features = self._rollouts.features_of(position, state.velocity.copy(), body)
        wanted = self._reference.target(tick, desired_at, body).features
        residuals = self._residual_model.residuals(features - wanted, perturbed=False)
        return self.settings.checks * float(fixed_order.dot(residuals, residuals))

    def cost_ahead(
        self, tick: int, state: StampedState, gains: GainArrays, desired_at: DesiredAt
    ) -> float:
        """What a state will cost, on average, in going on with the plan in force.

        As `cost`; infinite where that leads to nothing.
        """
        assert self._coming is None
        body, position = self._model.body(gains), self._model.position_of(state.position)
        desired = self._reference.ahead(tick, desired_at, body)
        velocity, stepped = state.velocity.copy(), self._stepped.body(gains)
        start = Start(tick, position, velocity, desired, stepped, Anchor(), perturbed=False)
        return self._search.cost_ahead(start, self._plan)

    def _compile(self, character: Character) -> None:
        """Have all compiled before the first state waits for an answer: one rollout at rest."""
        layout = character.layout
        rest, nothing = np.array(character.rest_position), np.zeros(layout.size)
        still = ReferenceState(layout.configuration(rest), nothing, nothing)
        gains = GainArrays(nothing, nothing, nothing, character.effort_limits())
        body = self._model.body(gains)
        desired = self._reference.ahead(0, lambda _: still, body)
        position = self._model.position_of(rest)
        stepped = self._stepped.body(gains)
        self._search.rehearse(
            Start(0, position, nothing, desired, stepped, self.anchor, perturbed=False)
        )
        self._reference.clear()

    def _forget_what_is_over(self, tick: int) -> None:
        """Plan again from a state of before, which comes once more, or beyond the plan's end."""
        plan, settings = self._plan, self.settings
        if plan is None:
            return
        if tick < plan.tick:
            self.rest()
        elif tick - plan.tick >= settings.horizon - settings.parameters.planning_delay:
            self._abandon_search()
            self._plan = None
        elif self._coming is not None and tick < self._coming.seen:
            self._abandon_search()

    def _abandon_search(self) -> None:
        """Seek no plan, as if none had been sought since the one in force."""
        if self._coming is not None and self._plan is not None:
            self.anchor = self._plan.outlook.anchor
        self._coming = None

    def _take(self, tick: int) -> None:
        """Take the plan that acts from a tick on, if there is one; wait for it if need be."""
        if self._coming is None or tick < self._coming.tick:
            return
        sought = self._coming.plan
        while not wait((sought,), timeout=_PATIENCE).done:
            self._act()
        plan, self._coming = sought.result(), None
        if tick > plan.tick:  # in real time states are skipped
            late = (tick - plan.tick) / self._rate_hz
            plan = replace(plan, outlook=replace(plan.outlook, times=plan.outlook.times - late))
        self._plan = plan

    def _start_search(
        self, seen: TickState, acts: int, gains: GainArrays, desired_at: DesiredAt
    ) -> PendingPlan:
        """A plan that acts from a later tick on, from the state to which this one will lead."""
        tick, body = seen.tick, self._model.body(gains)
        target = self._reference.target(tick, desired_at, body)
        later = round(SOON * self._rate_hz)
        soon = self._reference.target(tick + later, desired_at, body)
        position, velocity = self._observe(seen, body, target, soon)
        if self._plan is not None and acts > tick:
            offsets = self._plan.offsets
            between = self._reference.between(tick, acts, offsets.first_knot, desired_at, body)
            position, velocity = self._rollouts.state_after(
                position, velocity, offsets, between, body
            )
        desired = self._reference.ahead(acts, desired_at, body)
        perturbed = self.anchor.is_perturbed(tick / self._rate_hz)
        stepped = self._stepped.body(gains)
        start = Start(tick, position, velocity, desired, stepped, self.anchor, perturbed)
        seed, guess, self._guess = (self._seed, self._episode), self._guess, None
        return PendingPlan(
            tick, acts, self._thread.submit(self._search.find, start, self._plan, seed, guess)
        )

    def _observe(
        self,
        at: TickState,
        body: RolloutModel,
        target: ReferenceSample,
        soon: ReferenceSample,
    ) -> tuple[FloatArray, FloatArray]:
        """A state in the reference's world, (q,) and (n,), which may have given way to it."""
        tick, position = at.tick, self._model.position_of(at.state.position)
        # A message's array cannot be written to, which is another type to compiled code.
        velocity, centre = at.state.velocity.copy(), self._residual_model.centre
        elapsed = 0.0 if self._plan is None else (tick - self._plan.seen) / self._rate_hz
        if self.needs_contacts:
            self._feel(position, at.contacts)
        seen = self.anchor.to_reference_world(position, velocity)
        if not self._gives_way:
            return seen
        look = ReferenceSample(*seen, self._rollouts.features_of(*seen, body))
        self.anchor = self.anchor.advanced(
            look.planar(centre),
            target.planar(centre),
            soon.planar(centre),
            tick / self._rate_hz,
            elapsed,
        )
        return self.anchor.to_reference_world(position, velocity)

    def _feel(self, position: FloatArray, contacts: FloatArray | None) -> None:
        """Have the ground of both models where the feet stand in a position (q,)."""
        if contacts is None:
            raise ConfigurationError(
                f"'{TERRAIN.name}' {FELT} needs the contacts of each state's tick"
            )
        ground = self.anchor.ground.after(self._model.soles(position, contacts))
        self.anchor = replace(self.anchor, ground=ground)
        for model in (self._model, self._stepped):
            model.put_planes(ground.planes)


def _copy_of(made_of: tuple[Character, PlannerSettings], state: Any) -> object:
    """The copy of a planner that was made of these, in its state."""
    copy = PredictivePlanner(*made_of)
    copy._seed, copy._episode, copy._plan, copy._coming, copy.anchor, sent = state
    if copy.in_flight is not None:
        copy.in_flight.restore(sent)
    return copy
