"""The controller without ROS: state in, effort and reference out."""

from collections.abc import Callable

import numpy as np

from controller_node.balance import BalanceController
from controller_node.behaviours.asked import ASKABLE, AskedBehaviour, behaviour_schedule
from controller_node.behaviours.base import (
    BehaviourChoice,
    BehaviourOutput,
    ModeReport,
    Observation,
    Surroundings,
)
from controller_node.control_laws import LAWS, GainArrays, LawContext, TrackingInput
from controller_node.controller_settings import (
    ControllerSettings,
    EffectiveGains,
    check_planned,
    check_unaided,
    effective_gains,
)
from controller_node.effort_series import EffortSeries
from controller_node.model_check import check_agreement, check_inertia
from controller_node.planner.base import Planner, TickState
from controller_node.planner.outlook import Outlook
from controller_node.references.base import Reference
from controller_node.references.steering.reference import SteeredReference
from controller_node.references.steering.velocity import VelocityCommand
from controller_node.references.trajectory import TrajectoryPoints
from controller_node.references.transformed import PlanarTransform
from controller_node.strength import Strengths, strength_schedule
from controller_node.tracked_reference import TrackedReference
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.joints.effort_limits import EffortLimits
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, MotionError
from msgs_config.messages.clock import TickClock
from msgs_config.messages.probe import DynamicsSample
from msgs_config.messages.state import StampedReference, StampedState


class Controller:
    """Inverse dynamics in ticks: `(q, v, desired state) -> effort`.

    A function of the state's message and of the tick: the same state always gets the same answer.
    Only the law `pid`, a behaviour and a planner remember the ticks before; a trajectory,
    velocities or strengths that were taken hold until the episode ends.
    """

    def __init__(
        self,
        character: Character,
        reference: Reference,
        settings: ControllerSettings,
        *,
        rate_hz: int,
        gravity: float,
        series: EffortSeries | None = None,
        behaviour: BehaviourChoice | None = None,
        planner: Planner | None = None,
    ) -> None:
        """Build the model of the dynamics; `series` is what the law `feedforward` applies.

        Without a behaviour it tracks the reference. A planner goes with the law `stable_pd`.

        Raises:
            CharacterError: a joint moves neither mass nor inertia, or a foot is none.
            ConfigurationError: the law needs a series, or the balance feet, and there are none.
        """
        self.layout, self.clock = character.layout, TickClock(rate_hz)
        self.planner = planner
        self._character = character
        self._model = DynamicsModel(character, gravity)
        check_inertia(self._model, character)
        self._context = LawContext(self.layout, self._model, self.clock.period_s, series)
        self._balance = BalanceController(character, character.feet) if character.feet else None
        self._choice = behaviour or BehaviourChoice()
        self.check(settings)
        self._settings = settings
        # The limits of the gains that were in force last.
        self._limits = EffortLimits(self.layout, settings.gains.effort_limits)
        # Whether the answer to a state needs the contacts of the tick before.
        planned = self.planner is not None and self.planner.needs_contacts
        self.needs_contacts = self._choice.needs_contacts or planned
        self.opponent = self._choice.opponent  # the character whose place it needs too; or none
        self._own_reference = reference
        # Whether commanded velocities steer the reference.
        self.is_steered = isinstance(reference, SteeredReference)
        self._no_contacts = np.zeros((len(character.links), 6))
        self.begin_episode(0)  # the first state says of which episode it is

    @property
    def parts(self) -> tuple[object, ...]:
        """What it is made of, and does not change."""
        planned = () if self.planner is None else self.planner.parts
        return self._character, self._own_reference, self._choice, self._model, *planned

    @property
    def episode_ns(self) -> int:
        """Stamp of the first state of the episode."""
        return self._episode_ns

    def _enter_episode(self, episode_ns: int) -> None:
        """Begin the episode of a stamp, unless it has begun."""
        if episode_ns != self._episode_ns:
            self.begin_episode(episode_ns)

    def begin_episode(self, episode_ns: int) -> None:
        """Begin an episode, its first state of a stamp in ns: all of another one is forgotten."""
        self._episode_ns = episode_ns
        self.mode: ModeReport | None = None  # since which state which mode holds
        self._law = self._settings.make_law(self._context)
        self._behaviour = self._choice.make()
        self._strengths = strength_schedule(self.layout)
        self._asked = behaviour_schedule()
        self._effective: EffectiveGains | None = None
        self._tracked = TrackedReference(
            self._character, self._own_reference, self.clock, episode_ns
        )
        self._tracked.follows_velocity = self._settings.follows_velocity
        if self.planner is not None:
            self.planner.begin_episode(self.clock.first_tick_from(episode_ns))

    def while_planning(self, act: Callable[[], None]) -> None:
        """Call a function, which must not change this, repeatedly while waiting for a plan."""
        if self.planner is not None:
            self.planner.while_waiting(act)

    @property
    def outlook(self) -> Outlook | None:
        """The expectation of the plan in force; None without a planner."""
        return None if self.planner is None else self.planner.outlook

    @property
    def settings(self) -> ControllerSettings:
        """Law, gains and limits in force."""
        return self._settings

    @settings.setter
    def settings(self, settings: ControllerSettings) -> None:
        """Take others from the next state on. Raises as `check` does."""
        self.check(settings)
        before = self._settings.law, self._settings.law_settings
        if (settings.law, settings.law_settings) != before:
            self._law = settings.make_law(self._context)
        self._settings = settings
        self._effective = None
        self._tracked.follows_velocity = settings.follows_velocity
        self._change_reference()  # the reference's velocity may count now, or no longer

    def check(self, settings: ControllerSettings) -> None:
        """Raise ConfigurationError if settings cannot be taken."""
        settings.make_law(self._context)
        if settings.balance is not None and self._balance is None:
            raise ConfigurationError(
                f"parameter 'balance.enabled' needs the key 'feet' in {self._character.file}"
            )
        if self.planner is not None:
            check_planned(settings)
        if self._choice.makes_effort:
            check_unaided(settings)

    def check_agreement(self, probe: DynamicsSample) -> None:
        """Raise CharacterError if a simulator's probe is not what the model expects."""
        check_agreement(self._model, self.layout, probe)

    def set_trajectory(
        self, points: TrajectoryPoints, *, start_ns: int, now_ns: int, episode_ns: int
    ) -> None:
        """Track a trajectory from a stamp on, instead of what is tracked, until the episode ends.

        The reference goes on without a jump, first to the first point. What a behaviour had
        carried to another place is there, and the points are not carried.

        Raises:
            MotionError: the character cannot follow it.
            LayoutError: a degree of freedom does not exist, or part of a ball joint is missing.
        """
        if not self._choice.follows_motion:
            remedy = "; cmd_vel steers it" if self.is_steered else ""
            raise MotionError(f"the behaviour tracks no trajectory{remedy}")
        self._enter_episode(episode_ns)
        self._tracked.replace(points, start_ns, now_ns, self._behaviour.carry)
        self._behaviour.carry = PlanarTransform()
        self._change_reference()

    def wanted_position(self, stamp_ns: int) -> FloatArray:
        """Where the reference is (n,) at a stamp, in the episode that goes on."""
        tick = self._tracked.tick(stamp_ns)
        return self._tracked.desired_at(tick).configuration.position

    def steer(
        self, velocity: tuple[float, float, float], *, start_ns: int, now_ns: int, episode_ns: int
    ) -> VelocityCommand:
        """Take a velocity (m/s ahead, m/s and rad/s to the left) from a stamp on; as it is taken,
        within the limits. Raises MotionError if it cannot be.
        """
        self._enter_episode(episode_ns)
        command = VelocityCommand(self._tracked.tick(start_ns), *velocity)
        steered = self._tracked.steer(command, self._tracked.tick(now_ns))
        self._change_reference(steered.since)
        return steered.command

    def set_strengths(self, strengths: Strengths, *, episode_ns: int) -> None:
        """Take strengths that count from their stamp on, until the next ones or the episode's end.

        Raises:
            MotionError: too many wait for their stamps.
        """
        self._enter_episode(episode_ns)
        self._strengths.add(strengths)

    def ask(self, asked: AskedBehaviour, *, episode_ns: int) -> None:
        """Ask the behaviour for something from a stamp on, until the next time or episode's end.

        Raises:
            MotionError: it cannot be asked, or too many wait for their stamps.
        """
        if not self._choice.can_be_asked:
            raise MotionError(
                "behaviour: the parameter 'behaviour' is none that can be asked for others; it "
                f"must be {' or '.join(ASKABLE)}"
            )
        self._enter_episode(episode_ns)
        self._asked.add(asked)

    def compute_effort(
        self,
        state: StampedState,
        episode_ns: int,
        contacts: FloatArray | None = None,
        opponent: FloatArray | None = None,
    ) -> tuple[FloatArray, StampedReference]:
        """The effort (n,) that answers a state, and the reference at the state's stamp.

        `episode_ns` is the stamp of the episode's first state, from which the reference counts; a
        behaviour or planner may need `contacts` (links, 6), the net wrenches of the tick before, N
        and N m, world axes, and a behaviour `opponent` (3,), where the root of its opponent is, m,
        world.

        Raises:
            ClockError: the state's stamp is no tick at this controller's rate.
            ConfigurationError: the behaviour needs contacts or an opponent, and there are none.
        """
        self._enter_episode(episode_ns)
        tick, stamp_ns = self.clock.tick(state.stamp_ns), state.stamp_ns
        late = None if self.planner is None else self.planner.in_flight
        acting = state if late is None else late.acting_state(tick, state, self.clock)
        seen = self._observe(acting, stamp_ns, Surroundings(contacts, opponent))
        output = self._behaviour.advance(seen)
        self._take(output, stamp_ns)
        gains = seen.gains if output.gains is None else output.gains
        tracking = TrackingInput(
            time=seen.time,
            position=acting.position,
            velocity=acting.velocity,
            now=self._tracked.desired(seen.time, seen.now),
            upcoming=self._tracked.desired(seen.next_time, seen.upcoming),
            offset=self._offset(acting, state, gains, contacts),
            effort=output.effort,
        )
        effort = self._effort(tracking, gains)
        if late is not None:
            late.send(tick, effort)
        now = tracking.now
        if acting is not state:  # the published reference is that of the state's stamp
            now = self._tracked.desired_at(self._tracked.tick(stamp_ns))
        return effort, StampedReference(stamp_ns, now.configuration.position, now.velocity)

    def _observe(self, state: StampedState, stamp_ns: int, around: Surroundings) -> Observation:
        """The behaviour's view of a state, for the answer to a stamp."""
        self._choice.check(around)
        tick = self._tracked.tick(state.stamp_ns)
        (time, now), (next_time, upcoming) = self._tracked.own(tick)
        effective = self._effective_gains(stamp_ns)
        return Observation(
            time=time,
            next_time=next_time,
            position=state.position,
            velocity=state.velocity,
            contacts=self._no_contacts if around.contacts is None else around.contacts,
            now=now,
            upcoming=upcoming,
            gains=effective.gains,
            whole_gains=self._settings.gains,
            strengths=effective.strengths,
            assisted=effective.assisted,
            opponent=around.opponent,
            course=self._tracked.course(tick),
            asked=self._asked.at(stamp_ns),
        )

    def _effective_gains(self, stamp_ns: int) -> EffectiveGains:
        """The gains in force at a stamp, computed where settings or strengths change."""
        strengths = self._strengths.at(stamp_ns).values
        if self._effective is None or self._effective.from_messages is not strengths:
            self._effective = effective_gains(self.layout, self._settings, strengths)
        return self._effective

    def _take(self, output: BehaviourOutput, stamp_ns: int) -> None:
        """Take a behaviour's phase and target from now on."""
        # A phase or a target that goes on is the same object: a new one has begun in this tick.
        if self.mode is None or self.mode.phase is not output.phase:
            self.mode = ModeReport(output.phase, stamp_ns)
        if output.target is not self._tracked.target:
            self._tracked.target = output.target
            self._change_reference()

    def _change_reference(self, since: int = 0) -> None:
        if self.planner is not None:
            self.planner.change_reference(since, self._tracked.clip)

    def _effort(self, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
        """The effort (n,) of law, behaviour and balance, within the limits; a follower has none."""
        effort = self._law(tracking, gains)
        if tracking.effort is not None:
            effort = effort + tracking.effort
        if self._settings.balance is not None and self._balance is not None:
            self._model.update(tracking.position, tracking.velocity)
            bias = not LAWS[self._settings.law].compensates_gravity
            effort = effort + self._balance.effort(
                self._model, self._settings.balance, with_bias=bias
            )
        if self._character.coupling:
            effort = self._character.coupling.effort(effort)
        if self._limits.values is not gains.effort_limits:
            self._limits = EffortLimits(self.layout, gains.effort_limits)
        return self._limits.clipped(effort)

    def _offset(
        self,
        acting: StampedState,
        seen: StampedState,
        gains: GainArrays,
        contacts: FloatArray | None,
    ) -> FloatArray | None:
        """The offset of a planner to the tracking errors (n,); None without."""
        if self.planner is None:
            return None
        if not gains.stiffness[6:].any():
            self.planner.rest()
            return None
        then, now = (
            TickState(self._tracked.tick(each.stamp_ns), each, contacts) for each in (acting, seen)
        )
        return self.planner.offset(then, now, gains, self._tracked.desired_at)
