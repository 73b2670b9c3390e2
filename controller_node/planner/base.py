"""What a controller asks of a planner."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from controller_node.control_laws import GainArrays
from controller_node.planner.outlook import Outlook
from controller_node.references.base import ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.messages.state import StampedState

if TYPE_CHECKING:
    from controller_node.planner.commands_in_flight import CommandsInFlight

DesiredAt = Callable[[int], ReferenceState]
"""The desired state of a tick, counted from the episode's first state."""


@dataclass(frozen=True)
class TickState:
    """A state, and its tick, counted from the episode's first state."""

    tick: int
    state: StampedState
    contacts: FloatArray | None = None
    """The net wrenches (links, 6) of the tick before, N and N m, world axes, where they count."""


class Planner(Protocol):
    """What keeps a motion by offsets to the tracking errors. It remembers the ticks before."""

    @property
    def in_flight(self) -> "CommandsInFlight | None":
        """The commands that have not acted yet; None where they act at once."""

    @property
    def needs_contacts(self) -> bool:
        """Whether states are to come with contacts."""

    @property
    def parts(self) -> tuple[object, ...]:
        """What is large in it and does not change: a keyframe goes without."""

    def while_waiting(self, act: Callable[[], None]) -> None:
        """Have something done again and again while it waits for a plan."""

    def begin_episode(self, episode: int) -> None:
        """Forget all; `episode` is the tick of the episode's first state."""

    def change_reference(self, since: int = 0, clip: str = "") -> None:
        """Say that the reference is another one from a tick on.

        `clip` is the one that a behaviour has it go over to; empty: the own motion.
        """

    def rest(self) -> None:
        """Say that nothing is tracked in this tick: what was planned is over."""

    @property
    def outlook(self) -> Outlook | None:
        """What is expected of the plan in force, the same object as long as it is."""

    def offset(
        self, acting: TickState, seen: TickState, gains: GainArrays, desired_at: DesiredAt
    ) -> FloatArray:
        """What is added to the tracking errors (n,) of the state in which it acts.

        That is foreseen from the state that is seen, and the same where commands act at once.
        """
