"""The control laws: their equations, as pure functions to a generalised effort (n,), and by name.

Errors are those of `JointLayout.difference`: in rad or m, a rotation's as a rotation vector in the
child frame. Efforts are in N m or N, in the frames of docs/design.md. A law without stiffness or
integral gain is the one with those gains at zero. A new law is a function of `LawContext`,
`TrackingInput` and `GainArrays`, and a line in `_MEMORYLESS`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np

from controller_node.effort_series import EffortSeries
from controller_node.references.base import ReferenceState
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointLayout
from msgs_config.errors import ConfigurationError

# Equations

Solver: TypeAlias = Callable[[FloatArray, FloatArray], FloatArray]
"""`(force, added) -> a`: the acceleration (n,) of `(M + diag(added)) a = force`."""


def pd_effort(
    stiffness: FloatArray,  # (n,) N m/rad or N/m
    damping: FloatArray,  # (n,) N m s/rad or N s/m
    error: FloatArray,  # (n,) reference against state
    velocity_error: FloatArray,  # (n,) reference minus state
) -> FloatArray:
    """Proportional-derivative control, explicit: `Kp e + Kd de/dt`.

    On a mass m it holds a constant load f at the error `f / kp`, is critically damped at
    `kd = 2 sqrt(kp m)`, and at a control period h is stable for `kp h^2 + 2 kd h < 4 m`.
    """
    return stiffness * error + damping * velocity_error


def pid_effort(
    stiffness: FloatArray,  # (n,) N m/rad or N/m
    damping: FloatArray,  # (n,) N m s/rad or N s/m
    integral_gain: FloatArray,  # (n,) N m/(rad s) or N/(m s)
    error: FloatArray,  # (n,) reference against state
    velocity_error: FloatArray,  # (n,) reference minus state
    integral: FloatArray,  # (n,) of the error over time, rad s or m s
) -> FloatArray:
    """Proportional-integral-derivative control: PD, and `Ki` times the integral of the error.

    It leaves no steady-state error. On a mass m it is stable for `0 < ki < kp kd / m`.
    """
    return pd_effort(stiffness, damping, error, velocity_error) + integral_gain * integral


def anti_windup_mask(
    effort: FloatArray,  # (n,) that the integral takes part in, not clipped
    clipped: FloatArray,  # (n,) what the limits leave of it
    error: FloatArray,  # (n,)
    layout: JointLayout,
) -> BoolArray:
    """Which entries' (n,) integrals must not grow: of vectors that the error drives beyond limits.

    That is anti-windup by conditional integration: Astrom and Hagglund 2006, "Advanced PID
    Control", section 3.5.
    """
    beyond = layout.vector_sums(np.abs(effort - clipped)) > 0.0
    further = layout.vector_sums(effort * error) > 0.0
    return np.repeat(beyond & further, layout.vector_lengths)


def stable_pd_effort(
    solve: Solver,  # with passive damping D of M + D h
    bias: FloatArray,  # (n,) Coriolis, centrifugal and gravity, and D v
    stiffness: FloatArray,  # (n,)
    damping: FloatArray,  # (n,)
    next_error: FloatArray,  # (n,) reference at t + h against the state at t
    velocity: FloatArray,  # (n,)
    reference_velocity: FloatArray,  # (n,) at t + h
    period: float,  # h, s
    feedforward: FloatArray | float = 0.0,  # (n,) F, what acts beside the PD control
) -> FloatArray:
    """Stable PD: the law of the state at the end of the control period, solved for now.

    With the acceleration `a` of `(M + Kd h) a = F + Kp (e - h v) + Kd (vr - v) - C` the effort is
    `F + Kp (e - h v) + Kd (vr - v - h a)`. Contact forces are not foreseen. Joints, ball joints and
    a floating base go through one solve. On a mass m it is stable for `3 kp h^2 < 4 m + 2 kd h`.

    Source: Tan, Liu and Turk 2011, "Stable Proportional-Derivative Controllers". Computed torque is
    the same with inverse dynamics as F: Siciliano et al. 2009, "Robotics", section 8.5.
    """
    implicit = damping * period
    known = (
        feedforward
        + stiffness * (next_error - period * velocity)
        + damping * (reference_velocity - velocity)
    )
    effort: FloatArray = known - implicit * solve(known - bias, implicit)
    return effort


# Laws by name


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
        error = model.compute_error(self.position, desired.configuration.position)
        return error if self.response is None else error + self.response


Law: TypeAlias = Callable[[TrackingInput, GainArrays], FloatArray]
"""The effort (n,) that answers a state, not clipped yet."""


def make_law(name: str, context: LawContext) -> Law:
    """The law of that name, one of `LAWS`, at the beginning of its work.

    Raises:
        ConfigurationError: it is `feedforward`, and there is no series.
    """
    if name == "pid":
        return Pid(context)
    if name == "feedforward" and context.series is None:
        raise ConfigurationError("law 'feedforward' needs the parameter 'feedforward': a CSV file")
    return partial(_MEMORYLESS[name], context)


def _zero(context: LawContext, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    return np.zeros(context.layout.size)


def _feedforward(context: LawContext, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    assert context.series is not None
    return context.series.at(tracking.time)


def _p(context: LawContext, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    error, velocity_error = _errors(context, tracking)
    return pd_effort(gains.stiffness, np.zeros(context.layout.size), error, velocity_error)


def _pd(context: LawContext, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    return pd_effort(gains.stiffness, gains.damping, *_errors(context, tracking))


def _pd_gravity(context: LawContext, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    context.model.update(tracking.position, tracking.velocity)
    return _pd(context, tracking, gains) + context.model.gravity_force()


def _stable_pd(context: LawContext, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    context.model.update(tracking.position, tracking.velocity)
    return _implicit(context, tracking, gains, 0.0)


def _computed_torque(context: LawContext, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    context.model.update(tracking.position, tracking.velocity)
    return _implicit(
        context, tracking, gains, context.model.inverse_dynamics(tracking.now.acceleration)
    )


def _errors(context: LawContext, tracking: TrackingInput) -> tuple[FloatArray, FloatArray]:
    """Errors (n,) of configuration and velocity, of the reference against the state."""
    error = tracking.error(context.model, tracking.now)
    return error, tracking.now.velocity - tracking.velocity


def _implicit(
    context: LawContext, tracking: TrackingInput, gains: GainArrays, feedforward: FloatArray | float
) -> FloatArray:
    period, model = context.period, context.model
    return stable_pd_effort(
        lambda force, added: model.solve(force, added, period),
        model.bias_force(),
        gains.stiffness,
        gains.damping,
        tracking.error(model, tracking.upcoming),
        tracking.velocity,
        tracking.upcoming.velocity,
        period,
        feedforward,
    )


class Pid:
    """PID: the one law that remembers. One is made for each episode, its integral at zero."""

    def __init__(self, context: LawContext) -> None:
        self._context = context
        self._integral = np.zeros(context.layout.size)
        self._last_time: float | None = None

    def __call__(self, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
        """The effort (n,), with the error up to the present in its integral."""
        error, velocity_error = _errors(self._context, tracking)
        if self._last_time is not None:
            self._grow(tracking.time - self._last_time, error, velocity_error, gains)
        self._last_time = tracking.time
        return self._effort(error, velocity_error, self._integral, gains)

    def _grow(
        self, elapsed: float, error: FloatArray, velocity_error: FloatArray, gains: GainArrays
    ) -> None:
        """Add the error over the time elapsed (s), where that does not wind up."""
        layout = self._context.layout
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
COMPENSATES_GRAVITY = ("computed_torque", "pd_gravity")
"""Laws whose efforts hold the character against its weight."""
