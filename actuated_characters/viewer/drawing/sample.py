"""What is drawn of a character at one moment."""

from dataclasses import dataclass

from msgs_config.arrays import FloatArray
from msgs_config.messages.state import StampedState
from msgs_config.messages.wrenches import WrenchArrays


@dataclass
class CharacterSample:
    """What is known of a character at present; None where nothing has come."""

    state: StampedState | None = None
    reference: FloatArray | None = None  # (n,) position, message form
    contacts: WrenchArrays | None = None
    pushes: WrenchArrays | None = None
    mode: str = ""  # of the behaviour, as the controller has told it
