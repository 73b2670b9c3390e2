"""A character with its gains, reference and model, for labs whose law is the student's."""

from collections.abc import Mapping
from types import MappingProxyType

from actuated_characters.runs.plan import choose_reference
from controller_node import parameters as controller_parameters
from controller_node.behaviours.factory import make_motion
from controller_node.references.base import ReferenceState
from lecture.labs.simulated import PERIOD
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.messages.state import StampedState

_NOTHING: Mapping[str, object] = MappingProxyType({})


class Body:
    """What a law of `controller_node` knows in each tick."""

    def __init__(self, character: Character, parameters: Mapping[str, object] = _NOTHING) -> None:
        """Have what the parameters of `controller_node` say of a character."""
        given = {**choose_reference(parameters), **parameters}
        values = controller_parameters.resolve_for(character, given)
        motion = make_motion(character, values)
        gains = controller_parameters.make_gains(character, values)
        self.character = character
        self.model = DynamicsModel(character)
        self.start: StampedState = motion.first_state()
        self.stiffness: FloatArray = gains.stiffness
        self.damping: FloatArray = gains.damping
        self._reference = motion.reference

    def desired(self, tick: int) -> ReferenceState:
        """The reference so many ticks after the first state."""
        return self._reference.sample(tick * PERIOD)
