"""The reference of an episode, as trajectories and behaviours alter it."""

from dataclasses import replace

import numpy as np

from controller_node.behaviours.targets import Target
from controller_node.references.base import Reference, ReferenceState
from controller_node.references.trajectory import TrajectoryPoints, TrajectoryReference
from controller_node.references.transformed import PlanarTransform, TransformedReference
from msgs_config.character.model import Character
from msgs_config.messages.clock import TickClock


class TrackedReference:
    """The state to track at each tick of an episode; times in s since the episode's first state."""

    def __init__(
        self, character: Character, reference: Reference, clock: TickClock, episode_ns: int
    ) -> None:
        """Begin with a reference; `episode_ns` is the stamp of the episode's first state."""
        self.follows_velocity = True  # the reference's; else the velocity to track is zero
        self.target: Target | None = None  # of a behaviour, instead of the reference itself
        self._character, self._reference, self._clock = character, reference, clock
        self._first_tick = clock.first_tick_from(episode_ns)
        self._next: tuple[float, ReferenceState] | None = None

    def tick(self, stamp_ns: int) -> int:
        """Ticks from the episode's first state to the first tick from a stamp on."""
        return self._clock.first_tick_from(stamp_ns) - self._first_tick

    def time(self, stamp_ns: int) -> float:
        """Time of a stamp's tick.

        Not the stamps' difference: rounded to whole ns, it is another one in another episode.
        """
        return self._clock.time_after(self.tick(stamp_ns))

    def replace(
        self, points: TrajectoryPoints, start_ns: int, now_ns: int, carry: PlanarTransform
    ) -> None:
        """Go over to a trajectory, from where a behaviour had carried the reference to.

        Raises:
            MotionError: the character cannot follow it.
            LayoutError: a degree of freedom does not exist, or part of a ball joint is missing.
        """
        before = self._reference
        if carry != PlanarTransform():
            before = TransformedReference(self._character.layout, before, carry)
        if not isinstance(before, TrajectoryReference):
            before = TrajectoryReference(self._character, before)
        self._reference = before.replaced(points, self.time(start_ns), self.time(now_ns))
        self._next = None

    def own(self, time: float, next_time: float) -> tuple[ReferenceState, ReferenceState]:
        """The reference's states in a tick and in the next one, without the behaviour's target."""
        # the state of the next tick is this tick's when the tick has come
        is_known = self._next is not None and self._next[0] == time
        now = self._next[1] if self._next and is_known else self._reference.sample(time)
        self._next = next_time, self._reference.sample(next_time)
        return now, self._next[1]

    def desired(self, time: float, own: ReferenceState) -> ReferenceState:
        """The state to track, where the reference's own at that time is known."""
        desired = own if self.target is None else self.target.state_at(time, own)
        if self.follows_velocity:
            return desired
        return replace(desired, velocity=np.zeros(self._character.layout.size))

    def desired_at(self, tick: int) -> ReferenceState:
        """The state to track at a tick, counted from the episode's first state."""
        time = self._clock.time_after(tick)
        return self.desired(time, self._reference.sample(time))
