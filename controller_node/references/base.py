"""What every reference offers."""

from dataclasses import dataclass
from typing import Protocol

from msgs_config.arrays import FloatArray
from msgs_config.joint_layout import Configuration


@dataclass(frozen=True)
class ReferenceState:
    """The desired configuration, and the velocity (n,) that leads on from it."""

    configuration: Configuration
    velocity: FloatArray


class Reference(Protocol):
    """A desired motion."""

    def sample(self, time: float) -> ReferenceState:
        """The desired state `time` seconds after the episode's first state."""
        ...
