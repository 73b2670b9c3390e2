"""Compares replayed states with recorded ones where their last bits may differ."""

from collections.abc import Sequence

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.replay.comparison import (
    POSITION,
    VELOCITY,
    Difference,
    differences,
    state_difference,
    unit_of,
)
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState


def compare_within(
    recording: Recording,
    first: int,
    states: Sequence[StampedState],
    tolerance: float,
    clock: TickClock,
) -> tuple[Difference | None, dict[str, float]]:
    """The first entry that is further from the recorded one than a tolerance; rotations as such.

    Args:
        recording: What was recorded.
        first: Row in it of the first of the states.
        states: What has come again.
        tolerance: rad, m, rad/s and m/s.
        clock: The recording's.

    Returns:
        The difference, None if there is none, and the largest difference by unit.
    """
    layout, rows = recording.layout, slice(first, first + len(states))
    found_first: Difference | None = None
    largest: dict[str, float] = {}
    for quantity, recorded, found in (
        (POSITION, recording.position[rows], np.stack([state.position for state in states])),
        (VELOCITY, recording.velocity[rows], np.stack([state.velocity for state in states])),
    ):
        apart = np.abs(differences(layout, quantity, recorded, found))
        for index in range(layout.size):
            unit, worst = unit_of(layout, index, quantity), float(apart[:, index].max())
            largest[unit] = max(worst, largest.get(unit, 0.0))
        beyond = np.flatnonzero(~(apart <= tolerance).all(axis=1))  # NaN is beyond
        if not len(beyond):
            continue
        row = int(beyond[0])
        stamp_ns = states[row].stamp_ns
        if found_first is None or stamp_ns < found_first.stamp_ns:
            found_first = state_difference(
                layout,
                clock.tick(stamp_ns),
                stamp_ns,
                quantity,
                int(np.argmax(apart[row])),
                recorded[row],
                found[row],
                recording.name,
            )
    return found_first, largest
