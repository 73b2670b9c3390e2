"""The reference of an episode, as trajectories and behaviours alter it."""

from dataclasses import replace
from typing import TypeAlias

import numpy as np

from controller_node.behaviours.targets import Target
from controller_node.references.base import Reference, ReferenceState, SampledTogether
from controller_node.references.steering.course import Course
from controller_node.references.steering.reference import Steered, SteeredReference
from controller_node.references.steering.velocity import VelocityCommand
from controller_node.references.trajectory import TrajectoryPoints, TrajectoryReference
from controller_node.references.transformed import PlanarTransform, TransformedReference
from msgs_config.character.model import Character
from msgs_config.errors import MotionError
from msgs_config.messages.clock import TickClock

# Ticks that are sampled at once. Most of a sampling's time goes into its beginning: 64 take not
# twice as long as 16 do, and more would be felt in the tick in which it is done.
_BATCH_TICKS = 64

TimedState: TypeAlias = tuple[float, ReferenceState]
"""A reference's state, and its time in s since the episode's first state."""


class TrackedReference:
    """The state to track at each tick of an episode; times in s since the episode's first state."""

    def __init__(
        self, character: Character, reference: Reference, clock: TickClock, episode_ns: int
    ) -> None:
        """Begin with a reference; `episode_ns` is the stamp of the episode's first state."""
        self.follows_velocity = True  # the reference's; else the velocity to track is zero
        self.target: Target | None = None  # a behaviour's, instead of the reference itself
        self._character, self._reference, self._clock = character, reference, clock
        self._together = _sampled_together(reference)  # None: it samples one state at a time
        self._first_tick = clock.first_tick_from(episode_ns)
        self._known_from, self._known = 0, list[TimedState]()  # a tick, the states from there on

    def __getstate__(self) -> dict[str, object]:
        """All but the states that are known: they are sampled again."""
        return vars(self) | {"_known": []}

    def tick(self, stamp_ns: int) -> int:
        """Ticks from the episode's first state to the first tick from a stamp on."""
        return self._clock.first_tick_from(stamp_ns) - self._first_tick

    def time(self, tick: int) -> float:
        """Time of a tick, counted from the episode's first state.

        Not the stamps' difference: rounded to whole ns, it is another one in another episode.
        """
        return self._clock.time_after(tick)

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
        start, now = self.time(self.tick(start_ns)), self.time(self.tick(now_ns))
        self._reference = before.replaced(points, start, now)
        self._together = _sampled_together(self._reference)
        self._known = []

    def steer(self, command: VelocityCommand, now: int) -> Steered:
        """Take a command; ticks are counted from the episode's first state.

        Raises:
            MotionError: the reference is not one that is steered, or the command cannot be taken.
        """
        if not isinstance(self._reference, SteeredReference):
            raise MotionError(
                "cmd_vel: the reference is not steered; parameter 'reference' must be 'steered' or "
                "'commanded', and no trajectory may have replaced it"
            )
        steered = self._reference.steered(command, now)
        self._reference, self._known = steered.reference, []
        return steered

    def course(self, tick: int) -> Course | None:
        """The motion over the ground at a tick, of a reference that is steered."""
        steered = self._reference
        return steered.course(tick) if isinstance(steered, SteeredReference) else None

    @property
    def clip(self) -> str:
        """The clip that a behaviour has it go over to; empty: the reference itself."""
        return "" if self.target is None else self.target.clip

    def own(self, tick: int) -> tuple[TimedState, TimedState]:
        """The reference's states at a tick and at the next one, without the behaviour's target."""
        return self._at(tick), self._at(tick + 1)

    def _at(self, tick: int) -> TimedState:
        """The reference's state at a tick; what is sampled together is known for some ticks."""
        if not 0 <= tick - self._known_from < len(self._known):
            self._known_from, self._known = tick, self._samples(tick)
        return self._known[tick - self._known_from]

    def _samples(self, tick: int) -> list[TimedState]:
        """The reference's states from a tick on, at least its own."""
        if self._together is None:
            time = self.time(tick)
            return [(time, self._coupled(self._reference.sample(time)))]
        times = [self.time(each) for each in range(tick, tick + _BATCH_TICKS)]
        states = self._together.samples(times)
        if self._character.coupling:
            states = [self._coupled(state) for state in states]
        return list(zip(times, states, strict=True))

    def _coupled(self, state: ReferenceState) -> ReferenceState:
        """A state of the reference with the followers where their leaders are."""
        coupling, configuration = self._character.coupling, state.configuration
        if not coupling:
            return state
        return ReferenceState(
            replace(configuration, position=coupling.position(configuration.position)),
            coupling.velocity(state.velocity),
            coupling.velocity(state.acceleration),
        )

    def desired(self, time: float, own: ReferenceState) -> ReferenceState:
        """The state to track, where the reference's own at that time is known."""
        desired = own if self.target is None else self.target.state_at(time, own)
        if self.follows_velocity:
            return desired
        return replace(desired, velocity=np.zeros(self._character.layout.size))

    def desired_at(self, tick: int) -> ReferenceState:
        """The state to track at a tick, counted from the episode's first state."""
        time = self._clock.time_after(tick)
        return self.desired(time, self._coupled(self._reference.sample(time)))


def _sampled_together(reference: Reference) -> SampledTogether | None:
    """A reference whose states can be sampled together; else None. To ask takes microseconds."""
    return reference if isinstance(reference, SampledTogether) else None
