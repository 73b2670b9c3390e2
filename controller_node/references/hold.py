"""A reference that stands still."""

import numpy as np

from controller_node.references.base import REFERENCES, Motion, ReferenceState
from msgs_config.character.model import Character
from msgs_config.parameters import Values


class HoldReference:
    """The character's rest pose, forever."""

    def __init__(self, character: Character) -> None:
        rest = character.layout.configuration(np.array(character.rest_position))
        still = np.zeros(character.layout.size)
        self._state = ReferenceState(rest, still, still)

    def sample(self, time: float) -> ReferenceState:
        """The rest pose at zero velocity, at whatever time."""
        return self._state


@REFERENCES.register("hold")
def _hold(character: Character, values: Values) -> Motion:
    return Motion(HoldReference(character))
