"""The controller without ROS: state in, effort and reference out."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from controller_node.balance import Balance, BalanceGains
from controller_node.behaviours.base import ModeReport, Observation, Phase
from controller_node.behaviours.factory import BehaviourChoice
from controller_node.behaviours.targets import AS_IT_IS, Target
from controller_node.control_laws import (
    COMPENSATES_GRAVITY,
    GainArrays,
    Law,
    LawContext,
    TrackingInput,
    make_law,
)
from controller_node.effort_series import EffortSeries
from controller_node.model_check import check_agreement
from controller_node.planner.base import Planner
from controller_node.planner.outlook import Outlook
from controller_node.references.base import Reference, ReferenceState
from controller_node.references.trajectory import TrajectoryPoints, TrajectoryReference
from controller_node.references.transformed import PlanarTransform, TransformedReference
from controller_node.strength import Strengths, StrengthSchedule, weakened
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.errors import CharacterError, ConfigurationError
from msgs_config.messages.clock import TickClock
from msgs_config.messages.probe import DynamicsSample
from msgs_config.messages.state import StampedReference, StampedState


@dataclass(frozen=True)
class Settings:
    """What may change from one tick to the next."""

    law: str
    gains: GainArrays
    follows_velocity: bool  # the reference's; else the desired velocity is zero
    balance: BalanceGains | None = None  # None: nothing but the law
    strengths: FloatArray | None = None  # (b,) shares of the gains that count; None: all of them


@dataclass(frozen=True)
class _EffectiveGains:
    """How firmly it is driven, as long as nothing changes."""

    said: FloatArray  # (b,) the strengths that messages say
    gains: GainArrays  # weakened by all strengths
    strengths: FloatArray  # (b,) all of them
    assisted: bool  # whether the gains drive a floating base


class Controller:
    """Inverse dynamics in ticks: `(q, v, desired state) -> effort`.

    A function of what the state's message holds and of the tick, so that the same state always
    gets the same answer; only the law `pid`, a behaviour that reacts and a planner remember the
    ticks before, and a trajectory or strengths that were taken hold until the episode ends.
    """

    def __init__(
        self,
        character: Character,
        reference: Reference,
        settings: Settings,
        *,
        rate_hz: int,
        gravity: float,
        series: EffortSeries | None = None,
        behaviour: BehaviourChoice | None = None,
        planner: Planner | None = None,
    ) -> None:
        """Build the model of the dynamics; `series` is what the law `feedforward` applies.

        Without a behaviour it tracks the reference, whatever comes. A planner goes with the law
        `stable_pd`.

        Raises:
            CharacterError: a joint moves neither mass nor inertia, or a foot is none.
            ConfigurationError: the law needs a series, or the balance feet, and there are none.
        """
        self._choice = behaviour or BehaviourChoice()
        self.layout = character.layout
        self._character = character
        self.clock = TickClock(rate_hz)
        self._own_reference = self._reference = reference
        self._episode_ns: int | None = None
        self._model = DynamicsModel(character, gravity)
        self._check_inertia(character)
        self._plant = LawContext(self.layout, self._model, self.clock.period_s, series)
        self._balance = Balance(character, character.feet) if character.feet else None
        self._law: Law = make_law(settings.law, self._plant)
        self._planner = planner
        self.check(settings)
        self._settings = settings
        self._drive: _EffectiveGains | None = None
        self._next: tuple[float, ReferenceState] | None = None
        self._behaviour = self._choice.make()
        self._way = AS_IT_IS
        self._strengths = StrengthSchedule(self.layout)
        self._no_contacts = np.zeros((len(character.links), 6))
        self.mode: ModeReport | None = None  # since which state what is done; None before the first

    @property
    def planner(self) -> Planner | None:
        """What keeps the motion by offsets; None without."""
        return self._planner

    def while_planning(self, act: Callable[[], None]) -> None:
        """Have something done again and again while a plan is waited for; not to change this."""
        if self._planner is not None:
            self._planner.while_waiting(act)

    @property
    def outlook(self) -> Outlook | None:
        """What a planner expects of its plan; None without one."""
        return None if self._planner is None else self._planner.outlook

    @property
    def needs_contacts(self) -> bool:
        """Whether the answer to a state depends on the contacts of the tick before."""
        return self._choice.needs_contacts

    @property
    def settings(self) -> Settings:
        """Law, gains and limits in force."""
        return self._settings

    @settings.setter
    def settings(self, settings: Settings) -> None:
        """Take others from the next state on. Raises as `check` does."""
        self.check(settings)
        if settings.law != self._settings.law:
            self._law = make_law(settings.law, self._plant)
        self._settings = settings
        self._drive = None
        if self._planner is not None:
            self._planner.change_reference()  # its velocity may count, or no more

    def check(self, settings: Settings) -> None:
        """Raise ConfigurationError if settings cannot be taken."""
        make_law(settings.law, self._plant)
        if settings.balance is not None and self._balance is None:
            raise ConfigurationError(
                f"parameter 'balance.enabled' needs the key 'feet' in {self._character.file}"
            )
        if self._planner is not None and settings.law != "stable_pd":
            raise ConfigurationError(
                f"a planner foresees the law stable_pd alone; 'law' is {settings.law}"
            )
        if self._planner is not None and settings.balance is not None:
            raise ConfigurationError(
                "a planner keeps balance itself; 'balance.enabled' must be false"
            )

    def _check_inertia(self, character: Character) -> None:
        """A joint that moves no inertia would make the mass matrix singular."""
        self._model.update(np.array(character.rest_position), np.zeros(self.layout.size))
        diagonal = np.diag(self._model.mass_matrix())
        if self.layout.size and diagonal.min() <= 0.0:
            name = self.layout.dof_names[int(diagonal.argmin())]
            raise CharacterError(
                f"{character.file}: nothing with mass or inertia moves at '{name}'"
            )

    def check_agreement(self, probe: DynamicsSample) -> None:
        """Raise CharacterError if a simulator's probe is not what the model expects; says why."""
        check_agreement(self._model, self.layout, probe)

    def set_trajectory(
        self, points: TrajectoryPoints, *, start_ns: int, now_ns: int, episode_ns: int
    ) -> None:
        """Track a trajectory from a stamp on, instead of what is tracked, until the episode ends.

        The reference goes on without a jump: first from where it is then to the first point. What
        a behaviour had carried to another place is there, and the points are not carried.

        Raises:
            MotionError: the character cannot follow it.
            LayoutError: a degree of freedom does not exist, or part of a ball joint is missing.
        """
        self._enter_episode(episode_ns)
        carry, before = self._behaviour.carry, self._reference
        if carry != PlanarTransform():
            before = TransformedReference(self.layout, before, carry)
        if not isinstance(before, TrajectoryReference):
            before = TrajectoryReference(self._character, before)
        start, now = self._time(start_ns), self._time(now_ns)
        self._reference = before.replaced(points, start, now)
        self._behaviour.carry = PlanarTransform()
        self._next = None
        if self._planner is not None:
            self._planner.change_reference()

    def set_strengths(self, strengths: Strengths, *, episode_ns: int) -> None:
        """Take strengths that count from their stamp on, until the next ones or the episode's end.

        Raises:
            MotionError: too many wait for their stamps.
        """
        self._enter_episode(episode_ns)
        self._strengths.add(strengths)

    def begin_episode(self, episode_ns: int) -> None:
        """Begin an episode, its first state of a stamp in ns: all of another one is forgotten.

        A simulator that was started again begins with the same stamp as before.
        """
        self._behaviour = self._choice.make()
        self._way = AS_IT_IS
        self._strengths.clear()
        self.mode = None
        self._episode_ns = episode_ns
        self._reference = self._own_reference
        if self._planner is not None:
            self._planner.begin_episode(self.clock.first_tick_from(episode_ns))
        self._law = make_law(self._settings.law, self._plant)
        self._next = None

    def _enter_episode(self, episode_ns: int) -> None:
        """Begin an episode whose stamp says that it is another one."""
        if episode_ns != self._episode_ns:
            self.begin_episode(episode_ns)

    def _time(self, stamp_ns: int) -> float:
        """Time in s of a stamp's tick since the episode's first state.

        Not the stamps' difference: rounded to whole ns, it is another one in another episode.
        """
        ticks = self.clock.first_tick_from(stamp_ns) - self._episode_tick
        return self.clock.time_after(ticks)

    @property
    def _episode_tick(self) -> int:
        return self.clock.first_tick_from(self._episode_ns or 0)

    def compute_effort(
        self, state: StampedState, episode_ns: int, contacts: FloatArray | None = None
    ) -> tuple[FloatArray, StampedReference]:
        """The effort (n,) that answers a state, and the reference at the state's stamp.

        `episode_ns` is the stamp of the episode's first state, from which the reference counts;
        `contacts` (links, 6) are the net wrenches of the tick before, N and N m, world axes, which
        a behaviour may need.

        Raises:
            ClockError: the state's stamp is no tick at this controller's rate.
            ConfigurationError: the behaviour needs contacts, and there are none.
        """
        self._enter_episode(episode_ns)
        tick = self.clock.tick(state.stamp_ns)
        told, state = state, self._state_then(tick, state)
        next_stamp = self.clock.stamp_ns(self.clock.tick(state.stamp_ns) + 1)
        time, next_time = self._time(state.stamp_ns), self._time(next_stamp)
        now, upcoming = self._reference_at(time), self._reference_at(next_time)
        self._next = next_time, upcoming
        if contacts is None and self.needs_contacts:
            raise ConfigurationError("the behaviour needs the contacts of each state's tick")
        drive = self._drive_at(told.stamp_ns)
        directive = self._behaviour.advance(
            Observation(
                time=time,
                next_time=next_time,
                position=state.position,
                velocity=state.velocity,
                contacts=self._no_contacts if contacts is None else contacts,
                now=now,
                upcoming=upcoming,
                gains=drive.gains,
                whole_gains=self._settings.gains,
                strengths=drive.strengths,
                assisted=drive.assisted,
            )
        )
        self._report(directive.phase, told.stamp_ns)
        self._take(directive.way)
        instant = TrackingInput(
            time=time,
            position=state.position,
            velocity=state.velocity,
            now=self._desired(self._way.target(time, now)),
            upcoming=self._desired(self._way.target(next_time, upcoming)),
            response=self._response(state, directive.gains),
        )
        effort = self._effort(instant, directive.gains)
        if self._planner is not None and self._planner.late_commands is not None:
            self._planner.late_commands.send(tick, effort)
        desired = instant.now if state is told else self._desired_at(tick - self._episode_tick)
        return effort, StampedReference(
            told.stamp_ns, desired.configuration.position, desired.velocity
        )

    def _state_then(self, tick: int, state: StampedState) -> StampedState:
        """The state in which the answer to a tick's state acts, as far as it can be foreseen."""
        late = None if self._planner is None else self._planner.late_commands
        if late is None:
            return state
        position, velocity = late.state_then(tick, state.position, state.velocity)
        stamp_ns = self.clock.stamp_ns(tick + late.delay_ticks)
        return StampedState(stamp_ns, position, velocity, state.effort)

    def _drive_at(self, stamp_ns: int) -> _EffectiveGains:
        """What drives it at a stamp; worked out where the settings or the strengths change."""
        said = self._strengths.at(stamp_ns)
        if self._drive is None or self._drive.said is not said:
            gains, own = self._settings.gains, self._settings.strengths
            strengths = said if own is None else own * said
            if own is not None:
                gains = weakened(self.layout, gains, own)
            gains = weakened(self.layout, gains, said)
            root = gains.stiffness[:6].any() or gains.damping[:6].any()
            assisted = self.layout.has_floating_base and bool(root)
            self._drive = _EffectiveGains(said, gains, strengths, assisted)
        return self._drive

    def _report(self, phase: Phase, stamp_ns: int) -> None:
        """Keep since which state a phase lasts."""
        if self.mode is None or self.mode.phase is not phase:
            self.mode = ModeReport(phase, stamp_ns)

    def _take(self, way: Target) -> None:
        """Track another way from now on."""
        if way is not self._way:
            self._way = way
            if self._planner is not None:
                self._planner.change_reference()

    def _effort(self, instant: TrackingInput, gains: GainArrays) -> FloatArray:
        """The effort (n,) of law and balance, within the limits."""
        effort = self._law(instant, gains)
        if self._settings.balance is not None and self._balance is not None:
            self._model.update(instant.position, instant.velocity)
            bias = self._settings.law not in COMPENSATES_GRAVITY
            effort = effort + self._balance.effort(
                self._model, self._settings.balance, with_bias=bias
            )
        return self.layout.clipped(effort, gains.effort_limits)

    def _response(self, state: StampedState, gains: GainArrays) -> FloatArray | None:
        """What a planner adds to the tracking errors (n,); None without."""
        if self._planner is None:
            return None
        if not gains.stiffness[6:].any():
            self._planner.rest()
            return None
        tick = self.clock.tick(state.stamp_ns) - self._episode_tick
        return self._planner.offset(tick, state, gains, self._desired_at)

    def _reference_at(self, time: float) -> ReferenceState:
        """The reference; the one of the next tick is this tick's when the tick has come."""
        if self._next is not None and self._next[0] == time:
            return self._next[1]
        return self._reference.sample(time)

    def _desired_at(self, tick: int) -> ReferenceState:
        """What is to be tracked at a tick, counted from the episode's first state."""
        time = self.clock.time_after(tick)
        return self._desired(self._way.target(time, self._reference.sample(time)))

    def _desired(self, reference: ReferenceState) -> ReferenceState:
        """The reference as the settings have it tracked."""
        if self._settings.follows_velocity:
            return reference
        return replace(reference, velocity=np.zeros(self.layout.size))
