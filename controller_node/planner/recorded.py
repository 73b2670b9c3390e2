"""A plan that was made beforehand, a reconstruction's, and is played without looking ahead."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from controller_node.control_laws import GainArrays
from controller_node.planner.base import DesiredAt, TickState
from controller_node.planner.outlook import Outlook
from controller_node.references.offsets import RecordedPlan
from msgs_config.arrays import FloatArray

if TYPE_CHECKING:
    from controller_node.planner.commands_in_flight import CommandsInFlight


class RecordedPlanner:
    """Plays a recorded plan where a planner would plan; it looks at no state."""

    outlook: Outlook | None = None
    needs_contacts = False

    def __init__(self, plan: RecordedPlan, in_flight: "CommandsInFlight | None" = None) -> None:
        self._plan = plan
        self.in_flight = in_flight

    @property
    def parts(self) -> tuple[object, ...]:
        """What is large in it and does not change."""
        return (self._plan,)

    def while_waiting(self, act: Callable[[], None]) -> None:
        """It waits for no plan."""

    def begin_episode(self, episode: int) -> None:
        """Start over."""
        del episode
        if self.in_flight is not None:
            self.in_flight.clear()

    def change_reference(self, since: int = 0, clip: str = "") -> None:
        """The offsets are added to whatever is tracked."""

    def rest(self) -> None:
        """It goes on by the tick, whatever is tracked."""

    def offset(
        self, acting: TickState, seen: TickState, gains: GainArrays, desired_at: DesiredAt
    ) -> FloatArray:
        """What is added to the tracking errors (n,) at a tick; zero for the root."""
        del seen, gains, desired_at
        return np.concatenate((np.zeros(6), self._plan.at(acting.tick)))
