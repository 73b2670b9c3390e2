"""What every reference offers."""

from dataclasses import dataclass
from typing import Protocol

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition


@dataclass(frozen=True)
class ReferenceState:
    """The desired configuration, the velocity that leads on from it, and how that changes."""

    configuration: GeneralizedPosition
    velocity: FloatArray  # (n,), a rotation's in the child frame
    acceleration: FloatArray  # (n,), its rate of change, entry by entry


class Reference(Protocol):
    """A desired motion."""

    def sample(self, time: float) -> ReferenceState:
        """The desired state `time` seconds after the episode's first state."""
        ...
