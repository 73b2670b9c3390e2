"""Replays a recording without ROS: the torques and pushes that really acted, tick by tick."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.run_metrics import StateHash
from actuated_characters.replay.comparison import (
    Difference,
    ReplayResult,
    compare_balls,
    compare_contacts,
    compare_states,
)
from actuated_characters.replay.completeness import check_pushes, check_throws, first_uncommanded
from actuated_characters.replay.tolerance import compare_within
from actuated_characters.replay.world import (
    common_rows,
    left_out,
    make_simulation,
    pushes_of,
    worlds,
)
from msgs_config.arrays import IntArray
from msgs_config.errors import SimulationError
from msgs_config.messages.state import StampedState
from msgs_config.messages.wrenches import WrenchArrays, select
from sim_node.physics.simulated_character import SimulatedCharacter
from sim_node.physics.simulation import Simulation
from sim_node.physics.wrenches import ExternalWrench

Progress = Callable[[int], None]
"""Is told how many ticks are done, of all worlds together."""

_PROGRESS_TICKS = 100


def replay(
    recordings: Sequence[Recording],
    *,
    tolerance: float | None = None,
    progress: Progress = lambda done: None,
) -> ReplayResult:
    """Simulate a bag's recordings again, and compare every state; contacts too, where recorded.

    Args:
        recordings: All of a bag, see `read_recordings`.
        tolerance: How far a position or a velocity may be from the recorded one (rad, m, rad/s,
            m/s), on another machine than the one that recorded; None: not by one bit.
        progress: See `Progress`.

    Raises:
        RecordingError: the recording lacks what a replay needs; says what.
        ActuatedCharactersError: a file of the character cannot be used.
    """
    results: list[ReplayResult] = []
    for together in worlds(recordings):
        done = sum(result.states - 1 for result in results)
        results.append(_WorldReplay(together, tolerance).run(progress, done))
        if results[-1].difference is not None:
            break
    return _joined(results)


def tick_count(recordings: Sequence[Recording]) -> int:
    """How many ticks a replay takes, of all worlds together."""
    return sum(common_rows(together)[1] - 1 for together in worlds(recordings))


def _joined(results: Sequence[ReplayResult]) -> ReplayResult:
    """The results of several worlds as one."""
    hashes: dict[str, str] = {}
    largest: dict[str, float] = {}
    for result in results:
        hashes |= result.state_hashes
        for unit, value in result.largest.items():
            largest[unit] = max(value, largest.get(unit, 0.0))
    return ReplayResult(
        difference=results[-1].difference,
        states=sum(result.states for result in results),
        episodes=sum(result.episodes for result in results),
        state_hashes=hashes,
        largest=largest,
        notes=tuple(dict.fromkeys(note for result in results for note in result.notes)),
    )


@dataclass(frozen=True)
class _Part:
    """One character's part in the replay of a world."""

    recording: Recording
    first: int  # row of the first state that is replayed
    links: tuple[str, ...]
    hash: StateHash = field(default_factory=StateHash)
    states: list[StampedState] = field(default_factory=list)  # kept where a tolerance is given


class _WorldReplay:
    """The replay of the characters of one world. An offset counts states from the first one."""

    def __init__(self, together: Sequence[Recording], tolerance: float | None) -> None:
        rows, count = common_rows(together)
        self._together, self._tolerance = together, tolerance
        self._parts = [
            _Part(recording, row, tuple(link.name for link in recording.character.links))
            for recording, row in zip(together, rows, strict=True)
        ]
        lead, first = together[0], rows[0]
        self._stamps_ns: IntArray = lead.stamps_ns[first : first + count]
        offsets = {row - first for row in lead.episode_rows.tolist()}
        self._begins = {offset for offset in offsets if 0 <= offset < count}

    def run(self, progress: Progress, done: int) -> ReplayResult:
        """Replay all ticks, or until something differs; `done` is what was done before."""
        ticks = len(self._stamps_ns) - 1
        notes = left_out(self._together, [part.first for part in self._parts])
        notes += [
            note
            for part in self._parts
            for note in check_pushes(part.recording, range(part.first, part.first + ticks))
        ]
        notes += check_throws(self._together[0])
        uncommanded, more = first_uncommanded(self._together)
        if uncommanded is not None and uncommanded.stamp_ns > self._stamps_ns[-1]:
            uncommanded = None
        last = ticks
        if uncommanded is not None:  # then what comes before it is of interest alone
            last = int(np.searchsorted(self._stamps_ns, uncommanded.stamp_ns)) - 1
        largest: dict[str, float] = {}
        with make_simulation(self._together, int(self._stamps_ns[0])) as simulation:
            states, difference = self._simulate(
                simulation, last, lambda offset: progress(done + offset)
            )
            if self._tolerance is not None and difference is None:
                difference, largest = self._compare_within(simulation, self._tolerance)
        return ReplayResult(
            difference=difference or uncommanded,
            states=states,
            episodes=len(self._begins),
            state_hashes={part.recording.name: part.hash.hexdigest() for part in self._parts},
            largest=largest,
            notes=(*notes, *more),
        )

    def _simulate(
        self, simulation: Simulation, last: int, progress: Progress
    ) -> tuple[int, Difference | None]:
        """Replay up to the state of offset `last`; the number of states and what differs."""
        for offset in range(last + 1):
            if offset and offset in self._begins:
                simulation.reset()
            elif offset:
                diverged = self._step(simulation, offset - 1)
                if diverged is not None:
                    return offset, diverged
            difference = self._compare_balls(simulation, offset)
            for part, actor in zip(self._parts, simulation.characters, strict=True):
                difference = self._compare(simulation, part, actor, offset) or difference
                if difference is not None:
                    return offset + 1, difference
            if offset % _PROGRESS_TICKS == 0 or offset == last:
                progress(offset)
        return last + 1, None

    def _step(self, simulation: Simulation, offset: int) -> Difference | None:
        """Take the tick that begins with the state of an offset; says so if that ends badly."""
        efforts, pushes = [], []
        simulation.watches_contacts = False
        for part in self._parts:
            row, recording = part.first + offset, part.recording
            efforts.append(recording.effort[row])
            pushes.append(_pushes(part, row, simulation.tick))
            if recording.contacts and recording.contacts[row] is not None:
                simulation.watches_contacts = self._tolerance is None
        lead = self._parts[0]
        throws = lead.recording.throws[lead.first + offset] if lead.recording.throws else ()
        try:
            simulation.step(efforts, pushes, throws)
        except SimulationError as error:
            tick = simulation.tick + 1
            sentence = f"the recording went on, but the replay {error}"
            stamp_ns = simulation.clock.stamp_ns(tick)
            return Difference(tick, stamp_ns, "state", "", np.nan, np.nan, sentence)
        return None

    def _compare(
        self, simulation: Simulation, part: _Part, actor: SimulatedCharacter, offset: int
    ) -> Difference | None:
        """What differs in one character's state, and in the contacts of the tick before it."""
        part.hash.add(actor.state)
        if self._tolerance is not None:
            part.states.append(actor.state)
            return None
        row, recording = part.first + offset, part.recording
        return compare_states(
            recording.layout,
            simulation.tick,
            actor.state.stamp_ns,
            (recording.position[row], recording.velocity[row]),
            (actor.state.position, actor.state.velocity),
            recording.name,
        ) or _compare_contacts(simulation, part, actor, row)

    def _compare_balls(self, simulation: Simulation, offset: int) -> Difference | None:
        """What differs in where the balls are, of which a tolerance says nothing."""
        lead = self._parts[0]
        recorded = lead.recording.balls[lead.first + offset] if lead.recording.balls else None
        if recorded is None or self._tolerance is not None:
            return None
        return compare_balls(simulation.tick, recorded, simulation.ball_motion())

    def _compare_within(
        self, simulation: Simulation, tolerance: float
    ) -> tuple[Difference | None, dict[str, float]]:
        """The first difference of all characters beyond the tolerance, and the largest ones."""
        found: list[Difference] = []
        largest: dict[str, float] = {}
        for part in self._parts:
            difference, its = compare_within(
                part.recording, part.first, part.states, tolerance, simulation.clock
            )
            found += [] if difference is None else [difference]
            largest |= {unit: max(its[unit], largest.get(unit, 0.0)) for unit in its}
        return min(found, key=lambda difference: difference.tick, default=None), largest


def _pushes(part: _Part, row: int, tick: int) -> Sequence[ExternalWrench]:
    applied = part.recording.applied_wrench[row] if part.recording.applied_wrench else None
    if applied is None or not applied.links:
        return ()
    return pushes_of(part.recording.character, applied, tick)


def _compare_contacts(
    simulation: Simulation, part: _Part, actor: SimulatedCharacter, row: int
) -> Difference | None:
    """Compare what touched in the tick that led to the state of a row."""
    recorded = part.recording.contacts[row - 1] if part.recording.contacts and row else None
    if recorded is None or actor.contacts is None:
        return None
    contacts = actor.contacts
    found = select(simulation.stamp_ns, part.links, contacts.wrenches, contacts.touching)
    if _same_contacts(recorded, found):
        return None
    return compare_contacts(simulation.tick, recorded, found, part.recording.name)


def _same_contacts(one: WrenchArrays, other: WrenchArrays) -> bool:
    return one.links == other.links and np.array_equal(one.wrenches, other.wrenches)
