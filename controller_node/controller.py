"""The controller without ROS: state in, effort and reference out."""

from dataclasses import dataclass

import numpy as np

from controller_node.agreement import check_agreement
from controller_node.control_laws import pd_effort, stable_pd_effort
from controller_node.dynamics import DynamicsModel
from controller_node.references.base import Reference, ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.character import Character
from msgs_config.errors import CharacterError
from msgs_config.probe import Probe
from msgs_config.stamped import StampedReference, StampedState
from msgs_config.tick_clock import NANOSECONDS_PER_SECOND, TickClock


@dataclass(frozen=True)
class GainArrays:
    """Gains and limits in force, one entry a degree of freedom or a physical vector."""

    stiffness: FloatArray  # (n,) N m/rad or N/m
    damping: FloatArray  # (n,) N m s/rad or N s/m
    effort_limits: FloatArray  # (b,) N m or N


class Controller:
    """Inverse dynamics in ticks: `(q, v, desired state) -> effort`.

    A function of what the state's message holds and of the tick, so that the same state always
    gets the same answer.
    """

    def __init__(
        self,
        character: Character,
        reference: Reference,
        gains: GainArrays,
        *,
        law: str,
        rate_hz: int,
        gravity: float,
    ) -> None:
        """Build the model of the dynamics; `law` is 'stable_pd' or 'pd'.

        Raises:
            CharacterError: a joint moves neither mass nor inertia.
        """
        self.layout = character.layout
        self.gains = gains
        self.clock = TickClock(rate_hz)
        self._reference = reference
        self._law = _LAWS[law]
        self._model = DynamicsModel(character, gravity)
        self._check_inertia(character)
        self._next: tuple[int, ReferenceState] | None = None

    def _check_inertia(self, character: Character) -> None:
        """A joint that moves no inertia would make the mass matrix singular."""
        rest = self.layout.configuration(np.array(character.rest_position))
        self._model.update(rest, np.zeros(self.layout.size))
        diagonal = np.diag(self._model.mass_matrix())
        if self.layout.size and diagonal.min() <= 0.0:
            name = self.layout.dof_names[int(diagonal.argmin())]
            raise CharacterError(
                f"{character.file}: nothing with mass or inertia moves at '{name}'"
            )

    def check_agreement(self, probe: Probe) -> None:
        """Raise CharacterError if a simulator's probe is not what the model expects; says why."""
        check_agreement(self._model, self.layout, probe)

    def answer(self, state: StampedState, episode_ns: int) -> tuple[FloatArray, StampedReference]:
        """The effort (n,) that answers a state, and the reference at the state's stamp.

        `episode_ns` is the stamp of the episode's first state, from which the reference counts.

        Raises:
            ClockError: the state's stamp is no tick at this controller's rate.
        """
        now = self._reference_at(state.stamp_ns, episode_ns)
        next_stamp = self.clock.stamp_ns(self.clock.tick(state.stamp_ns) + 1)
        upcoming = self._reference_at(next_stamp, episode_ns)
        self._next = next_stamp - episode_ns, upcoming
        effort = self._law(self, state, now, upcoming)
        reference = StampedReference(state.stamp_ns, now.configuration.position, now.velocity)
        return self.layout.clipped(effort, self.gains.effort_limits), reference

    def _reference_at(self, stamp_ns: int, episode_ns: int) -> ReferenceState:
        """The reference; the one of the next tick is this tick's when the tick has come."""
        since_ns = stamp_ns - episode_ns
        if self._next is not None and self._next[0] == since_ns:
            return self._next[1]
        return self._reference.sample(since_ns / NANOSECONDS_PER_SECOND)

    def _pd(self, state: StampedState, now: ReferenceState, upcoming: ReferenceState) -> FloatArray:
        del upcoming  # the explicit law looks at the present alone
        configuration = self.layout.configuration(state.position)
        error = self.layout.difference(configuration, now.configuration)
        velocity_error = now.velocity - state.velocity
        return pd_effort(self.gains.stiffness, self.gains.damping, error, velocity_error)

    def _stable_pd(
        self, state: StampedState, now: ReferenceState, upcoming: ReferenceState
    ) -> FloatArray:
        del now  # the implicit law looks at the end of the control period
        configuration = self.layout.configuration(state.position)
        self._model.update(configuration, state.velocity)
        return stable_pd_effort(
            self._model.implicit_mass_matrix(self.clock.period_s),
            self._model.bias_force(),
            self.gains.stiffness,
            self.gains.damping,
            self.layout.difference(configuration, upcoming.configuration),
            state.velocity,
            upcoming.velocity,
            self.clock.period_s,
        )


_LAWS = {"pd": Controller._pd, "stable_pd": Controller._stable_pd}
LAWS = tuple(_LAWS)
