"""Test signals: a step and a sine away from the rest pose."""

import math
from collections.abc import Sequence

import numpy as np

from controller_node.references.base import REFERENCES, Motion, ReferenceState
from controller_node.references.limits import LARGEST_NUMBER, JointLimits
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.character.model import Character
from msgs_config.errors import MotionError, one_of
from msgs_config.geometry import rotations
from msgs_config.parameters import Values
from msgs_config.settings import Settings, parameter


class StepReference:
    """The rest pose, and from `time` on one that is away from it, at rest too.

    The entries of a ball joint that are named make one rotation vector in its child frame, by
    which it is turned from its rest pose.
    """

    def __init__(
        self, character: Character, dof_names: Sequence[str], size: float, time: float
    ) -> None:
        """A step of each degree of freedom named by `size`, in rad or m, at `time` in s.

        Raises:
            MotionError: a name is unknown or repeated, a number is of no use, or the step would
                leave a joint's limits.
        """
        _check_number("the step's size", size)
        _check_number("the step's time", time, minimum=0.0)
        chosen = _chosen(character, dof_names, [size], "step")
        rest = character.layout.configuration(np.array(character.rest_position))
        still = np.zeros(character.layout.size)
        away = _moved(character.layout, rest, size * chosen)
        self._time = time
        self._before = ReferenceState(rest, still, still)
        self._after = ReferenceState(away, still, still)

    def sample(self, time: float) -> ReferenceState:
        """The desired state `time` seconds after the episode's first state."""
        return self._after if time >= self._time else self._before


class SineReference:
    """An oscillation about the rest pose that begins there: `amplitude sin(2 pi f t)`.

    The entries of a ball joint that are named make one rotation vector in its child frame, so
    that it turns about a fixed axis.
    """

    def __init__(
        self, character: Character, dof_names: Sequence[str], amplitude: float, frequency_hz: float
    ) -> None:
        """An oscillation of each degree of freedom named; `amplitude` in rad or m.

        Raises:
            MotionError: a name is unknown or repeated, a number is of no use, or the oscillation
                would leave a joint's limits.
        """
        _check_number("the sine's amplitude", amplitude)
        _check_number("the sine's frequency", frequency_hz, minimum=0.0)
        chosen = _chosen(character, dof_names, [amplitude, -amplitude], "sine")
        self._layout = character.layout
        self._rest = character.layout.configuration(np.array(character.rest_position))
        self._amplitudes = amplitude * chosen
        self._angular_frequency = 2.0 * math.pi * frequency_hz

    def sample(self, time: float) -> ReferenceState:
        """The desired state `time` seconds after the episode's first state."""
        rate = self._angular_frequency
        sine, cosine = math.sin(rate * time), math.cos(rate * time)
        return ReferenceState(
            _moved(self._layout, self._rest, sine * self._amplitudes),
            rate * cosine * self._amplitudes,
            -rate * rate * sine * self._amplitudes,
        )


class SignalSettings(Settings, prefix="signal."):
    """What any test signal moves."""

    dofs: tuple[str, ...] = parameter(
        (), "degrees of freedom that step or sine moves; none named: all that have a motor and may"
    )


class StepSettings(Settings, prefix="step."):
    """The step of `StepReference`."""

    size: float = parameter(0.1, "how far the step goes", unit="rad or m", minimum=-1e6)
    time: float = parameter(0.5, "when, since the episode began", unit="s")


class SineSettings(Settings, prefix="sine."):
    """The sine of `SineReference`."""

    amplitude: float = parameter(0.1, "how far the sine goes", unit="rad or m", minimum=-1e6)
    frequency: float = parameter(0.5, "how often a second", unit="Hz")


@REFERENCES.register("step", StepSettings)
def _step(character: Character, values: Values) -> Motion:
    step = StepSettings.of(values)
    dofs, warnings = _signal_dofs(character, values, [step.size])
    return Motion(StepReference(character, dofs, step.size, step.time), warnings)


@REFERENCES.register("sine", SignalSettings, SineSettings)
def _sine(character: Character, values: Values) -> Motion:
    sine = SineSettings.of(values)
    dofs, warnings = _signal_dofs(character, values, [sine.amplitude, -sine.amplitude])
    return Motion(SineReference(character, dofs, sine.amplitude, sine.frequency), warnings)


def _signal_dofs(
    character: Character, values: Values, offsets: Sequence[float]
) -> tuple[Sequence[str], tuple[str, ...]]:
    """The degrees of freedom that a signal moves, and a warning of those that it cannot move.

    If none are named: all that have a motor, except those whose limits an offset would leave.
    """
    named = SignalSettings.of(values).dofs
    if named:
        return named, ()
    layout, rest = character.layout, np.array(character.rest_position)
    lower, upper = character.position_bounds()
    reached = [rest + offset for offset in offsets]
    free = np.all([(lower <= there) & (there <= upper) for there in reached], axis=0)
    actuated = layout.mask(layout.actuated_joint_names)
    chosen = [layout.dof_names[index] for index in np.flatnonzero(actuated & free)]
    fixed = [layout.dof_names[index] for index in np.flatnonzero(actuated & ~free)]
    warnings = (f"kept still within their limits: {', '.join(fixed)}",) if fixed else ()
    return chosen, warnings


def _moved(
    layout: JointLayout, rest: GeneralizedPosition, offset: FloatArray
) -> GeneralizedPosition:
    """The rest pose moved by an offset (n,), a rotation's in its child frame."""
    position, entries = rest.position + offset, layout.rotation_entries
    turned = rotations.multiply(rest.orientations_xyzw, rotations.exp(offset[entries]))
    position[entries] = rotations.log(turned)
    return GeneralizedPosition(position, turned)


def _chosen(
    character: Character, dof_names: Sequence[str], sizes: list[float], signal: str
) -> FloatArray:
    """One (n,) at each degree of freedom named, zero elsewhere; the sizes must be within limits."""
    names = character.layout.dof_names
    if not dof_names:
        raise MotionError("no degree of freedom is named; there must be one or more")
    chosen = np.zeros(len(names))
    for name in dof_names:
        if name not in names:
            raise MotionError(one_of("degree of freedom", name, list(names)))
        if chosen[names.index(name)]:
            raise MotionError(f"degree of freedom '{name}' is named twice; once is enough")
        if name in character.leaders:
            raise MotionError(f"'{name}' mimics '{character.leaders[name]}'; name that one")
        chosen[names.index(name)] = 1.0
    _check_limits(character, chosen, sizes, signal)
    return chosen


def _check_number(what: str, value: float, minimum: float = -LARGEST_NUMBER) -> None:
    if not minimum <= value <= LARGEST_NUMBER:  # NaN is not within
        raise MotionError(f"{what} is {value:g}; it must be from {minimum:g} to {LARGEST_NUMBER:g}")


def _check_limits(
    character: Character, chosen: FloatArray, sizes: list[float], signal: str
) -> None:
    limits, rest = JointLimits(character), np.array(character.rest_position)
    for size in sizes:
        excess = limits.excess(rest + size * chosen) * chosen
        for index in np.flatnonzero(excess)[:1].tolist():
            down, up = limits.lower[index] - rest[index], limits.upper[index] - rest[index]
            right = f"its size must be from {down:g} to {up:g}"
            if signal == "sine":
                right = f"its amplitude must be at most {max(0.0, min(-down, up)):g}"
            raise MotionError(
                f"the {signal} leads '{character.layout.dof_names[index]}' to "
                f"{rest[index] + size:g}, {excess[index]:.3g} {limits.unit(index)} beyond its "
                f"limits, {limits.text(index)}; {right}"
            )
