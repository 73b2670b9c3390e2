"""A character's own parameters: its masses, and where it begins. No ROS."""

from collections.abc import Mapping

import numpy as np

from msgs_config.arrays import BoolArray
from msgs_config.character.layout import JointLayout
from msgs_config.character.lowest_points import describe_start_below_ground
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, MessageError
from msgs_config.messages.state import StampedState
from msgs_config.parameters import Value, Values
from msgs_config.settings import Settings, parameter
from msgs_config.shared_parameters import PLANE
from sim_node.physics.settings import SimulationSettings

GIVEN, REFERENCE = "given", "reference"
INITIAL_STATE, POSITION, VELOCITY = "initial_state", "initial_position", "initial_velocity"
_LIMIT_ROUNDING = 1e-9  # rad or m by which a position may be beyond its limits


class CharacterSettings(Settings):
    """How heavy a character is, what of it is commanded, and where it begins.

    The defaults are the character's.
    """

    mass_factors: tuple[str, ...] = parameter(
        (),
        "links that are so many times as heavy as the character's file says, and no controller "
        "knows of it: LINK:FACTOR, or all:FACTOR",
    )

    commanded_joints: tuple[str, ...] = parameter(
        (), "the joints that must be commanded, and that alone may be; with 'root': assistance"
    )
    initial_state: str = parameter(
        GIVEN,
        f"where it begins: given by {POSITION} and {VELOCITY}, or reference: in the state in "
        "which the reference of its controller_node begins",
        choices=(GIVEN, REFERENCE),
        at_reset=True,
    )
    initial_position: tuple[float, ...] = parameter(
        (),
        "position of each degree of freedom at the start",
        unit="rad or m",
        minimum=-1e12,
        at_reset=True,
    )
    initial_velocity: tuple[float, ...] = parameter(
        (),
        "velocity of each degree of freedom at the start",
        unit="rad/s or m/s",
        minimum=-1e12,
        at_reset=True,
    )

    @property
    def begins_with_reference(self) -> bool:
        """Whether the controller has to say in which state the character begins."""
        return self.initial_state == REFERENCE


def check_given(values: Values, given: Mapping[str, object]) -> None:
    """Raise ConfigurationError if a state is given to a character that begins elsewhere."""
    for name in (POSITION, VELOCITY):
        if CharacterSettings.of(values).begins_with_reference and name in given:
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
    if SimulationSettings.of(values).terrain != PLANE:
        return ()
    return describe_start_below_ground(
        character, np.array(CharacterSettings.of(values).initial_position)
    )


def changed_start(before: Values, after: Values) -> StampedState | None:
    """The state in which a character begins by its values, where it is another than before."""
    old, new = CharacterSettings.of(before), CharacterSettings.of(after)
    position, velocity = new.initial_position, new.initial_velocity
    if (position, velocity) == (old.initial_position, old.initial_velocity):
        return None
    return StampedState(0, np.array(position), np.array(velocity), None)


def as_values(state: StampedState) -> dict[str, Value]:
    """The parameters of a character that begins in a state."""
    return {POSITION: state.position.tolist(), VELOCITY: state.velocity.tolist()}
