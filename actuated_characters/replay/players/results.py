"""Compares the states that a simulator has answered a bag with, with those in the bag. No ROS."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.run_metrics import StateHash
from actuated_characters.replay.comparison import (
    EFFORT,
    POSITION,
    VELOCITY,
    Difference,
    ReplayResult,
    differences,
    state_difference,
    unit_of,
)
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from msgs_config.shared_parameters import RATE


@dataclass(frozen=True)
class FoundStates:
    """The states of a character that have come back, m of them."""

    position: FloatArray  # (m, n)
    velocity: FloatArray  # (m, n)
    effort: FloatArray  # (m, n), as applied in the tick before; NaN in an episode's first state


def compare_found(
    together: Sequence[Recording],
    found: Sequence[FoundStates],
    tolerance: float | None = None,
    notes: Sequence[str] = (),
) -> ReplayResult:
    """Compare all states that have come, with the efforts that have led to them.

    With a `tolerance`, in rad, m, rad/s and m/s, it is positions and velocities alone, the
    rotations among them as rotations; without one it is every bit.
    """
    pairs = list(zip(together, found, strict=True))
    count = min(len(states.position) for states in found)
    firsts = [_first_difference(*pair, count, tolerance) for pair in pairs]
    largest: dict[str, float] = {}
    for pair in pairs if tolerance is not None else ():
        for unit, size in _largest(*pair, count).items():
            largest[unit] = max(size, largest.get(unit, 0.0))
    return ReplayResult(
        difference=min(filter(None, firsts), key=lambda each: each.tick, default=None),
        states=count,
        episodes=int((together[0].episode_rows < count).sum()),
        state_hashes={recording.name: _hash(recording, states) for recording, states in pairs},
        largest=largest,
        notes=notes,
    )


def _quantities(
    recording: Recording, found: FoundStates, count: int
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """What was and what is, (count, n) each; of a row the efforts first, then what they led to."""
    nothing = np.full((1, recording.layout.size), np.nan)
    return {
        EFFORT: (np.concatenate((nothing, recording.effort))[:count], found.effort[:count]),
        POSITION: (recording.position[:count], found.position[:count]),
        VELOCITY: (recording.velocity[:count], found.velocity[:count]),
    }


def _first_difference(
    recording: Recording, found: FoundStates, count: int, tolerance: float | None
) -> Difference | None:
    quantities = _quantities(recording, found, count)
    places = {}
    for quantity, (before, now) in quantities.items():
        if tolerance is None:
            differs = _other_bits(before, now)
        elif quantity == EFFORT:
            continue
        else:
            apart = differences(recording.layout, quantity, before, now)
            differs = ~(np.abs(apart) <= tolerance)
        if differs.any():
            places[quantity] = divmod(int(np.argmax(differs)), differs.shape[1])
    if not places:
        return None
    quantity = min(places, key=lambda each: places[each][0])
    row, entry = places[quantity]
    before, now = quantities[quantity]
    stamp_ns = int(recording.stamps_ns[row])
    tick = TickClock(int(recording.parameters[RATE.name])).tick(stamp_ns)
    return state_difference(
        recording.layout, tick, stamp_ns, quantity, entry, before[row], now[row], recording.name
    )


def _other_bits(before: FloatArray, now: FloatArray) -> BoolArray:
    """Where two arrays are not the same doubles; NaN is NaN."""
    bits = (np.ascontiguousarray(values).view(np.int64) for values in (before, now))
    other: BoolArray = np.not_equal(*bits) & ~(np.isnan(before) & np.isnan(now))
    return other


def _largest(recording: Recording, found: FoundStates, count: int) -> dict[str, float]:
    """The largest difference of positions and velocities, by its unit."""
    layout, largest = recording.layout, dict[str, float]()
    for quantity, (before, now) in _quantities(recording, found, count).items():
        if quantity == EFFORT:
            continue
        sizes = np.abs(differences(layout, quantity, before, now)).max(axis=0, initial=0.0)
        for entry, size in enumerate(sizes.tolist()):
            unit = unit_of(layout, entry, quantity)
            largest[unit] = max(size, largest.get(unit, 0.0))
    return largest


def _hash(recording: Recording, found: FoundStates) -> str:
    """Of the states with the stamps that they had."""
    state_hash = StateHash()
    for stamp_ns, position, velocity in zip(
        recording.stamps_ns.tolist(), found.position, found.velocity, strict=False
    ):
        state_hash.add(StampedState(stamp_ns, position, velocity, None))
    return state_hash.hexdigest()
