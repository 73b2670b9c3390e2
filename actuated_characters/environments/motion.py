"""The motion of an episode: a reference's states by the ticks since the episode began."""

from controller_node.references.base import Reference, ReferenceState, SampledTogether
from msgs_config.messages.clock import TickClock

_BATCH_TICKS = 64  # ticks that are sampled at once
# Batches are kept of the past, of the present, and of what is looked ahead to.
_MAX_BATCHES = 4


class EpisodeMotion:
    """A reference from some time of it on."""

    def __init__(self, reference: Reference, clock: TickClock) -> None:
        """Begin where the reference does."""
        self._reference, self._clock = reference, clock
        self.begin(0.0)

    def begin(self, start: float) -> None:
        """Begin an episode at a time of the reference, s."""
        self.start = start
        self._batches: dict[int, list[ReferenceState]] = {}

    def at(self, tick: int) -> ReferenceState:
        """The state that is desired so many ticks after the episode's first state."""
        number, place = divmod(tick, _BATCH_TICKS)
        if (batch := self._batches.get(number)) is None:
            batch = self._batches[number] = self._sampled(number * _BATCH_TICKS)
            if len(self._batches) > _MAX_BATCHES:
                del self._batches[next(iter(self._batches))]
        return batch[place]

    def _sampled(self, first: int) -> list[ReferenceState]:
        ticks = range(first, first + _BATCH_TICKS)
        times = [self.start + self._clock.time_after(tick) for tick in ticks]
        if isinstance(self._reference, SampledTogether):
            return self._reference.samples(times)
        return [self._reference.sample(time) for time in times]
