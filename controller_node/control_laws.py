"""The control laws: their equations, as pure functions to a generalised effort (n,), and by name.

Errors are those of `JointLayout.difference`: in rad or m, a rotation's as a rotation vector in the
child frame. Efforts are in N m or N, in the frames of docs/topics.md. A law without stiffness or
integral gain is the one with those gains at zero. A new law is a function of `LawContext`,
`TrackingInput` and `GainArrays` under `@equation(NAME)`, or what makes one under `@law(NAME)`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Protocol, TypeAlias, TypeVar

import numpy as np

from controller_node.effort_series import EffortSeries
from controller_node.references.base import ReferenceState
from controller_node.registry import Registry
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointLayout
from msgs_config.errors import ConfigurationError
from msgs_config.settings import Settings

# Equations


class Dynamics(Protocol):
    """Mass matrix M and bias force C in the present state, as `DynamicsModel` has them."""

    def solve(self, force: FloatArray, added: FloatArray, period: float) -> FloatArray:
        """The acceleration (n,) of `(M + D h + diag(added)) a = force`, with passive damping D."""
        ...

    def bias_force(self) -> FloatArray:
        """C (n,): Coriolis, centrifugal, gravity, and D v."""
        ...


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
    model: Dynamics,
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
    effort: FloatArray = known - implicit * model.solve(
        known - model.bias_force(), implicit, period
    )
    return effort


# Gains


@dataclass(frozen=True)
class GainArrays:
    """Gains and limits in force, one entry a degree of freedom or a physical vector."""

    stiffness: FloatArray  # (n,) N m/rad or N/m
    damping: FloatArray  # (n,) N m s/rad or N s/m
    integral: FloatArray  # (n,) N m/(rad s) or N/(m s)
    effort_limits: FloatArray  # (b,) N m or N


def scale_gains(layout: JointLayout, gains: GainArrays, strengths: FloatArray) -> GainArrays:
    """Gains and limits times strengths (b,), 0 to 1, one a physical vector.

    At strength 0 a vector has no effort, whatever the law adds to its gains. If all strengths are
    1, the result is the same object.
    """
    if (strengths == 1.0).all():
        return gains
    entries = np.repeat(strengths, layout.vector_lengths)
    return GainArrays(
        gains.stiffness * entries,
        gains.damping * entries,
        gains.integral * entries,
        scale_limits(gains.effort_limits, strengths),
    )


def scale_limits(limits: FloatArray, strengths: FloatArray) -> FloatArray:
    """Effort limits (b,) scaled by strengths (b,); infinity times 0 is 0."""
    driven = strengths > 0.0
    return np.where(driven, limits * np.where(driven, strengths, 1.0), 0.0)


# Laws by name


@dataclass(frozen=True)
class LawContext:
    """The character that a law controls, and the model and series that the law computes with."""

    layout: JointLayout
    model: DynamicsModel
    period: float  # control period, s
    series: EffortSeries | None = None  # what the law `feedforward` plays


class TrackingInput(NamedTuple):
    """State and reference in one tick."""

    time: float  # s since the episode's first state
    position: FloatArray  # (n,)
    velocity: FloatArray  # (n,)
    now: ReferenceState
    upcoming: ReferenceState  # desired one tick later
    offset: FloatArray | None = None  # (n,) of a planner, added to the errors
    effort: FloatArray | None = None  # (n,) of a behaviour, added to the law's

    def error(self, model: DynamicsModel, desired: ReferenceState) -> FloatArray:
        """The error (n,) of the configuration against a desired state, with the offset."""
        return self._moved(model.compute_error(self.position, desired.configuration.position))

    def next_error(self, model: DynamicsModel) -> FloatArray:
        """The error (n,) against the reference of the next tick, of a model in this state."""
        return self._moved(model.error_of_state(self.upcoming.configuration.position))

    def _moved(self, error: FloatArray) -> FloatArray:
        """An error (n,) with the offset."""
        return error if self.offset is None else error + self.offset


Law: TypeAlias = Callable[[TrackingInput, GainArrays], FloatArray]
"""The effort (n,) that answers a state, not clipped yet."""


@dataclass(frozen=True)
class LawKind:
    """A law by name: what makes it, and what others must know of it."""

    make: Callable[..., Law]  # of `LawContext`, and of each of the settings that it registers
    compensates_gravity: bool = False  # its efforts hold the character against its weight
    # Its effort follows from the state and a target alone, which an environment's actions may move.
    is_static_feedback: bool = False


LAWS = Registry[LawKind]()

_Equation: TypeAlias = Callable[[LawContext, TrackingInput, GainArrays], FloatArray]
_Maker = TypeVar("_Maker", bound=Callable[..., Law])


def law(name: str, *settings: type[Settings], **known: bool) -> Callable[[_Maker], _Maker]:
    """Decorate what makes the law of a name, anew for each episode: a class, or a function.

    It gets the `LawContext`, and then the values of the settings, whose live parameters make it
    anew when they change. It raises ConfigurationError if it cannot be made. `known` is of
    `LawKind`.
    """

    def add(make: _Maker) -> _Maker:
        LAWS.register(name, *settings)(LawKind(make, **known))
        return make

    return add


def equation(name: str, **known: bool) -> Callable[[_Equation], _Equation]:
    """Decorate the law of a name that is one equation: it remembers nothing, and has no settings.

    `known` is of `LawKind`.
    """

    def add(compute: _Equation) -> _Equation:
        law(name, **known)(lambda context: partial(compute, context))
        return compute

    return add


@equation("stable_pd", is_static_feedback=True)
def _stable_pd(context: LawContext, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    return _implicit(context, tracking, gains)


@equation("computed_torque", compensates_gravity=True, is_static_feedback=True)
def _computed_torque(context: LawContext, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    context.model.update(tracking.position, tracking.velocity)
    inverse_dynamics = context.model.inverse_dynamics(tracking.now.acceleration)
    return _implicit(context, tracking, gains, inverse_dynamics)


@equation("pd_gravity", compensates_gravity=True, is_static_feedback=True)
def _pd_gravity(context: LawContext, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    context.model.update(tracking.position, tracking.velocity)
    return _pd(context, tracking, gains) + context.model.gravity_force()


@equation("pd", is_static_feedback=True)
def _pd(context: LawContext, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    return pd_effort(gains.stiffness, gains.damping, *_errors(context, tracking))


@equation("p", is_static_feedback=True)
def _p(context: LawContext, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    return pd_effort(gains.stiffness, np.zeros(context.layout.size), *_errors(context, tracking))


@law("feedforward")
def _feedforward(context: LawContext) -> Law:
    if context.series is None:
        raise ConfigurationError("law 'feedforward' needs the parameter 'feedforward': a CSV file")
    return partial(_play, context.series)


def _play(series: EffortSeries, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    return series.at(tracking.time)


@equation("zero")
def _zero(context: LawContext, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
    return np.zeros(context.layout.size)


def _errors(context: LawContext, tracking: TrackingInput) -> tuple[FloatArray, FloatArray]:
    """Errors (n,) of configuration and velocity, of the reference against the state."""
    error = tracking.error(context.model, tracking.now)
    return error, tracking.now.velocity - tracking.velocity


def _implicit(
    context: LawContext,
    tracking: TrackingInput,
    gains: GainArrays,
    feedforward: FloatArray | None = None,
) -> FloatArray:
    """Stable PD with a feedforward (n,)."""
    model, upcoming = context.model, tracking.upcoming
    if not model.is_coupled:
        return model.stable_pd(
            tracking.position,
            tracking.velocity,
            upcoming.configuration.position,
            upcoming.velocity,
            gains.stiffness,
            gains.damping,
            context.period,
            tracking.offset,
            feedforward,
        )
    model.update(tracking.position, tracking.velocity)
    return stable_pd_effort(
        model,
        gains.stiffness,
        gains.damping,
        tracking.next_error(model),
        tracking.velocity,
        upcoming.velocity,
        context.period,
        0.0 if feedforward is None else feedforward,
    )


@law("pid")
class Pid:
    """Proportional-integral-derivative control: PD, and `Ki` times the integral of the error.

    It leaves no steady-state error. On a mass m it is stable for `0 < ki < kp kd / m`. It is the
    one law with a memory: its integral is zero at the beginning of an episode.
    """

    def __init__(self, context: LawContext) -> None:
        self._context = context
        self._integral = np.zeros(context.layout.size)
        self._last_time: float | None = None

    def __call__(self, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
        """The effort (n,), with the error up to the present in its integral."""
        error, velocity_error = _errors(self._context, tracking)
        direct = pd_effort(gains.stiffness, gains.damping, error, velocity_error)
        if self._last_time is not None:
            layout = self._context.layout
            grown = self._integral + (tracking.time - self._last_time) * error
            effort = direct + gains.integral * grown
            clipped = layout.clipped(effort, gains.effort_limits)
            stays = anti_windup_mask(effort, clipped, error, layout)
            self._integral = np.where(stays, self._integral, grown)
        self._last_time = tracking.time
        return direct + gains.integral * self._integral
