"""Where a character begins: as parameters say, or as its controller's reference does. No ROS."""

from collections.abc import Mapping

import numpy as np

from msgs_config.arrays import BoolArray
from msgs_config.character.layout import JointLayout
from msgs_config.character.lowest_points import describe_start_below_ground
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, MessageError
from msgs_config.messages.state import StampedState
from msgs_config.parameters import Parameter, Value, Values
from msgs_config.shared_parameters import PLANE

GIVEN, REFERENCE = "given", "reference"
INITIAL_STATE, POSITION, VELOCITY = "initial_state", "initial_position", "initial_velocity"
_LIMIT_ROUNDING = 1e-9  # rad or m by which a position may be beyond its limits


def initial_state_parameters(character: Character) -> list[Parameter]:
    """The parameters that say where a character begins."""
    return [
        Parameter(
            INITIAL_STATE,
            GIVEN,
            f"where it begins: given by {POSITION} and {VELOCITY}, or reference: in the state in "
            "which the reference of its controller_node begins",
            choices=(GIVEN, REFERENCE),
            at_reset=True,
        ),
        Parameter(
            POSITION,
            list(character.rest_position),
            "position of each degree of freedom at the start",
            unit="rad or m",
            minimum=-1e12,
            at_reset=True,
        ),
        Parameter(
            VELOCITY,
            [0.0] * character.layout.size,
            "velocity of each degree of freedom at the start",
            unit="rad/s or m/s",
            minimum=-1e12,
            at_reset=True,
        ),
    ]


def begins_with_reference(values: Values) -> bool:
    """Whether the controller has to say in which state the character begins."""
    return values.text(INITIAL_STATE) == REFERENCE


def check_given(values: Values, given: Mapping[str, object]) -> None:
    """Raise ConfigurationError if a state is given to a character that begins elsewhere."""
    for name in (POSITION, VELOCITY):
        if begins_with_reference(values) and name in given:
            raise ConfigurationError(
                f"parameter '{name}' is given, and '{INITIAL_STATE}' is {REFERENCE}; leave out "
                f"'{name}', or set '{INITIAL_STATE}' to {GIVEN}"
            )


def check_length(name: str, length: int, layout: JointLayout) -> None:
    """Raise ConfigurationError unless a parameter has an entry for each degree of freedom."""
    if length != layout.size:
        raise ConfigurationError(
            f"parameter '{name}' has {length} entries; it must have {layout.size}: "
            f"{', '.join(layout.dof_names)}"
        )


def check_state(character: Character, state: StampedState, speed_limit: float) -> None:
    """Raise MessageError unless a character can begin in a state.

    `speed_limit` in rad/s or m/s is the largest velocity of a degree of freedom.
    """
    lower, upper = character.position_bounds()
    low, high = lower - _LIMIT_ROUNDING, upper + _LIMIT_ROUNDING

    def first_of(wrong: BoolArray) -> int | None:
        return int(np.argmax(wrong)) if wrong.any() else None

    names, position, velocity = character.layout.dof_names, state.position, state.velocity
    unsound = ~(np.isfinite(position) & np.isfinite(velocity))
    if (entry := first_of(unsound)) is not None:
        raise MessageError(
            f"'{names[entry]}' is at {position[entry]:g} with velocity {velocity[entry]:g}; both "
            "must be finite"
        )
    if (entry := first_of((position < low) | (position > high))) is not None:
        raise MessageError(
            f"'{names[entry]}' is at {position[entry]:g}; its limits are {lower[entry]:g} to "
            f"{upper[entry]:g}"
        )
    if (entry := first_of(np.abs(velocity) > speed_limit)) is not None:
        raise MessageError(
            f"'{names[entry]}' has the velocity {velocity[entry]:g}; the parameter 'speed_limit' "
            f"is {speed_limit:g}"
        )


def describe_start(character: Character, values: Values) -> tuple[str, ...]:
    """A warning if a character begins below the ground where its parameters put it.

    Raises:
        CharacterError: a mesh cannot be used.
    """
    if values.text("terrain") != PLANE:
        return ()
    return describe_start_below_ground(character, np.array(values.numbers(POSITION)))


def changed_start(before: Values, after: Values) -> StampedState | None:
    """The state in which a character begins by its values, where it is another than before."""
    starts = [(each.numbers(POSITION), each.numbers(VELOCITY)) for each in (before, after)]
    if starts[0] == starts[1]:
        return None
    position, velocity = starts[1]
    return StampedState(0, np.array(position), np.array(velocity), None)


def as_values(state: StampedState) -> dict[str, Value]:
    """The parameters of a character that begins in a state."""
    return {POSITION: state.position.tolist(), VELOCITY: state.velocity.tolist()}
