"""The interface of a reference, and the references by name."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias, runtime_checkable

from controller_node.registry import Registry
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Character
from msgs_config.messages.state import StampedState
from msgs_config.parameters import Values


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


@runtime_checkable
class SampledTogether(Reference, Protocol):
    """A desired motion of which several states together take less time than one by one."""

    def samples(self, times: Sequence[float]) -> list[ReferenceState]:
        """The states that `sample` has at rising times in s, to the bit."""
        ...


@dataclass(frozen=True)
class Motion:
    """A reference, and warnings about it for the user."""

    reference: Reference
    warnings: tuple[str, ...] = ()

    def first_state(self) -> StampedState:
        """The state in which a character is to begin, so that it is where the reference is."""
        first = self.reference.sample(0.0)
        return StampedState(0, first.configuration.position, first.velocity, None)


MotionMaker: TypeAlias = Callable[[Character, Values], Motion]

REFERENCES = Registry[MotionMaker]()
