"""What an environment is made with and given: parameters of both sides, options, actions."""

import math
from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any

import numpy as np

from actuated_characters.render.engine.camera_pose import Size
from actuated_characters.runs.plan import choose_reference
from controller_node import parameters
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.parameters import Values

RENDER_MODES = ["rgb_array"]

_RESET_OPTIONS = ["start"]
# Parameters of the controller that would act beside an action, and the one value that does not.
UNAIDED_PARAMETERS = {"planner": "none", "behaviour": "tracking", "root_assistance": False}


def controller_values(character: Character, given: Mapping[str, object]) -> Values:
    """The controller's parameters where nothing but an action helps the law.

    Raises:
        ActuatedCharactersError: a name or a value is wrong, or one would act beside the action.
    """
    for name, alone in UNAIDED_PARAMETERS.items():
        if given.get(name, alone) != alone:
            raise ConfigurationError(
                f"parameter '{name}' is {given[name]}; in an environment it must be {alone}, "
                "because the action takes its place"
            )
    given = {**choose_reference(given), **given, **UNAIDED_PARAMETERS}
    return parameters.resolve_for(character, given)


def checked_action(action: FloatArray, shape: tuple[int, ...] | None) -> FloatArray:
    """An action (a,) of finite numbers; raises ConfigurationError if it is none."""
    try:
        numbers = np.asarray(action, dtype=float)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape != shape or not np.isfinite(numbers).all():
        raise ConfigurationError(f"an action must have shape {shape} and finite numbers")
    return numbers


def start_of(options: Mapping[str, Any]) -> float:
    """The time of the reference in s at which options of `reset` begin an episode."""
    for name in options:
        if name not in _RESET_OPTIONS:
            raise ConfigurationError(one_of("option of reset", name, _RESET_OPTIONS))
    start = options["start"]
    try:
        time = float(start)
    except (TypeError, ValueError):
        time = math.nan
    if not 0.0 <= time < math.inf:
        raise ConfigurationError(f"start is {start} s; it must be 0 or later")
    return time


def check_drawing(mode: str, size: Size) -> None:
    """Raise ConfigurationError if there is no such mode, or the size is not sensible."""
    from actuated_characters.render.stills import check_size

    if mode not in RENDER_MODES:
        raise ConfigurationError(one_of("render_mode", mode, RENDER_MODES))
    if np.shape(size) != (2,) or not all(isinstance(edge, Integral) for edge in size):
        raise ConfigurationError(f"render_size is {size}; it must be width and height in pixels")
    check_size(size, 1)


def check_options(duration: float, ticks_per_step: int, simulator: Mapping[str, object]) -> None:
    """Raise ConfigurationError if an option is wrong."""
    if not isinstance(ticks_per_step, Integral) or ticks_per_step < 1:
        raise ConfigurationError(f"ticks_per_step is {ticks_per_step}; it must be 1 or more")
    if not isinstance(duration, Real) or not 0.0 < duration < math.inf:
        raise ConfigurationError(f"duration is {duration} s; it must be a time above 0")
    for name in ("initial_position", "initial_velocity", "initial_state"):
        if name in simulator:
            raise ConfigurationError(f"'{name}' is where the reference begins; leave it out")
