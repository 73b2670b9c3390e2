"""The control laws by name: each fetches from model and reference what its equation needs."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np

from controller_node.control_laws import anti_windup_mask, pd_effort, pid_effort, stable_pd_effort
from controller_node.effort_series import EffortSeries
from controller_node.references.base import ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointLayout
from msgs_config.errors import ConfigurationError


@dataclass(frozen=True)
class GainArrays:
    """Gains and limits in force, one entry a degree of freedom or a physical vector."""

    stiffness: FloatArray  # (n,) N m/rad or N/m
    damping: FloatArray  # (n,) N m s/rad or N s/m
    integral: FloatArray  # (n,) N m/(rad s) or N/(m s)
    effort_limits: FloatArray  # (b,) N m or N


@dataclass(frozen=True)
class LawContext:
    """What a law controls, and by which means."""

    layout: JointLayout
    model: DynamicsModel
    period: float  # s, of control
    series: EffortSeries | None = None  # of the law `feedforward`


@dataclass(frozen=True)
class TrackingInput:
    """What a law looks at in one tick."""

    time: float  # s since the episode's first state
    position: FloatArray  # (n,)
    velocity: FloatArray  # (n,)
    now: ReferenceState
    upcoming: ReferenceState  # one tick later
    response: FloatArray | None = None  # (n,) a planner's offset to the errors; None: without

    def error(self, model: DynamicsModel, desired: ReferenceState) -> FloatArray:
        """The error (n,) of the configuration against a desired state, with the response."""
        error = model.error_of(self.position, desired.configuration.position)
        return error if self.response is None else error + self.response


Law: TypeAlias = Callable[[TrackingInput, GainArrays], FloatArray]
"""The effort (n,) that answers a state, not clipped yet."""


def make_law(name: str, plant: LawContext) -> Law:
    """The law of that name, one of `LAWS`, at the beginning of its work.

    Raises:
        ConfigurationError: it is `feedforward`, and there is no series.
    """
    if name == "pid":
        return Pid(plant)
    if name == "feedforward" and plant.series is None:
        raise ConfigurationError("law 'feedforward' needs the parameter 'feedforward': a CSV file")
    return partial(_MEMORYLESS[name], plant)


def _zero(plant: LawContext, instant: TrackingInput, gains: GainArrays) -> FloatArray:
    return np.zeros(plant.layout.size)


def _feedforward(plant: LawContext, instant: TrackingInput, gains: GainArrays) -> FloatArray:
    assert plant.series is not None
    return plant.series.at(instant.time)


def _p(plant: LawContext, instant: TrackingInput, gains: GainArrays) -> FloatArray:
    error, velocity_error = _errors(plant, instant)
    return pd_effort(gains.stiffness, np.zeros(plant.layout.size), error, velocity_error)


def _pd(plant: LawContext, instant: TrackingInput, gains: GainArrays) -> FloatArray:
    return pd_effort(gains.stiffness, gains.damping, *_errors(plant, instant))


def _pd_gravity(plant: LawContext, instant: TrackingInput, gains: GainArrays) -> FloatArray:
    plant.model.update(instant.position, instant.velocity)
    return _pd(plant, instant, gains) + plant.model.gravity_force()


def _stable_pd(plant: LawContext, instant: TrackingInput, gains: GainArrays) -> FloatArray:
    plant.model.update(instant.position, instant.velocity)
    return _implicit(plant, instant, gains, 0.0)


def _computed_torque(plant: LawContext, instant: TrackingInput, gains: GainArrays) -> FloatArray:
    plant.model.update(instant.position, instant.velocity)
    return _implicit(plant, instant, gains, plant.model.inverse_dynamics(instant.now.acceleration))


def _errors(plant: LawContext, instant: TrackingInput) -> tuple[FloatArray, FloatArray]:
    """Errors (n,) of configuration and velocity, of the reference against the state."""
    error = instant.error(plant.model, instant.now)
    return error, instant.now.velocity - instant.velocity


def _implicit(
    plant: LawContext, instant: TrackingInput, gains: GainArrays, feedforward: FloatArray | float
) -> FloatArray:
    period, model = plant.period, plant.model
    return stable_pd_effort(
        lambda force, added: model.solve(force, added, period),
        model.bias_force(),
        gains.stiffness,
        gains.damping,
        instant.error(model, instant.upcoming),
        instant.velocity,
        instant.upcoming.velocity,
        period,
        feedforward,
    )


class Pid:
    """PID: the one law that remembers. One is made for each episode, its integral at zero."""

    def __init__(self, plant: LawContext) -> None:
        self._plant = plant
        self._integral = np.zeros(plant.layout.size)
        self._last_time: float | None = None

    def __call__(self, instant: TrackingInput, gains: GainArrays) -> FloatArray:
        """The effort (n,), with the error up to the present in its integral."""
        error, velocity_error = _errors(self._plant, instant)
        if self._last_time is not None:
            self._grow(instant.time - self._last_time, error, velocity_error, gains)
        self._last_time = instant.time
        return self._effort(error, velocity_error, self._integral, gains)

    def _grow(
        self, elapsed: float, error: FloatArray, velocity_error: FloatArray, gains: GainArrays
    ) -> None:
        """Add the error over the time elapsed (s), where that does not wind up."""
        layout = self._plant.layout
        grown = self._integral + elapsed * error
        effort = self._effort(error, velocity_error, grown, gains)
        clipped = layout.clipped(effort, gains.effort_limits)
        stays = anti_windup_mask(effort, clipped, error, layout)
        self._integral = np.where(stays, self._integral, grown)

    def _effort(
        self, error: FloatArray, velocity_error: FloatArray, integral: FloatArray, gains: GainArrays
    ) -> FloatArray:
        return pid_effort(
            gains.stiffness, gains.damping, gains.integral, error, velocity_error, integral
        )


_MEMORYLESS: dict[str, Callable[[LawContext, TrackingInput, GainArrays], FloatArray]] = {
    "stable_pd": _stable_pd,
    "computed_torque": _computed_torque,
    "pd_gravity": _pd_gravity,
    "pd": _pd,
    "p": _p,
    "feedforward": _feedforward,
    "zero": _zero,
}
LAWS = (*_MEMORYLESS, "pid")
HAS_BIAS = ("computed_torque", "pd_gravity")
"""Laws whose efforts hold the character against its weight."""
