"""Replays a recording without ROS: the torques and pushes that really acted, tick by tick."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.replay.comparison import (
    POSITION,
    VELOCITY,
    Difference,
    ReplayResult,
    States,
    compare_balls,
    compare_contacts,
    compare_world,
    first_difference,
)
from actuated_characters.replay.effort_check import first_uncommanded
from actuated_characters.replay.world import (
    changes_of_reset,
    check_pushes,
    check_throws,
    cut_world,
    make_pushes,
    make_simulation,
    worlds,
)
from msgs_config.errors import SimulationError
from msgs_config.messages.state import StampedState
from msgs_config.messages.wrenches import select
from sim_node.physics.simulated_character import SimulatedCharacter
from sim_node.physics.simulation import Simulation

_PROGRESS_TICKS = 100


def replay(
    recordings: Sequence[Recording],
    *,
    tolerance: float | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> ReplayResult:
    """Simulate a bag's recordings again, and compare every state; contacts too, where recorded.

    Args:
        recordings: All of a bag, see `read_recordings`.
        tolerance: Largest difference of a position or velocity that is accepted (rad, m, rad/s,
            m/s), for another machine than the recording's; None: every bit has to be the same.
        progress: Is called with the number of ticks that are done, of all worlds together.

    Raises:
        RecordingError: the recording lacks what a replay needs; the message names it.
        ActuatedCharactersError: a file of the character cannot be used.
    """
    results: list[ReplayResult] = []
    for together in worlds(recordings):
        done = sum(result.states - 1 for result in results)
        results.append(_replay_world(together, tolerance, progress, done))
        if results[-1].difference is not None:
            break
    return _joined(results)


def tick_count(recordings: Sequence[Recording]) -> int:
    """How many ticks a replay takes, of all worlds together."""
    return sum(len(cut_world(together)[0][0].effort) for together in worlds(recordings))


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
        remarks=tuple(dict.fromkeys(remark for result in results for remark in result.remarks)),
    )


def _replay_world(
    whole: Sequence[Recording], tolerance: float | None, progress: Callable[[int], None], done: int
) -> ReplayResult:
    """Replay all ticks of a world, or until something differs; `done` were done before."""
    together, remarks = cut_world(whole)
    remarks += [remark for recording in together for remark in check_pushes(recording)]
    remarks += check_throws(together[0])
    uncommanded, more = first_uncommanded(whole)
    stamps_ns, last = together[0].stamps_ns, len(together[0].effort)
    if uncommanded is not None and uncommanded.stamp_ns > stamps_ns[-1]:
        uncommanded = None
    if uncommanded is not None:  # only what comes before that effort is compared
        last = int(np.searchsorted(stamps_ns, uncommanded.stamp_ns)) - 1
    with make_simulation(together, int(stamps_ns[0])) as simulation:
        world = _ReplayedWorld(together, simulation, is_exact=tolerance is None)
        difference = world.simulate(last, lambda row: progress(done + row))
    result = compare_world(together, world.found(), tolerance, (*remarks, *more))
    return replace(result, difference=difference or result.difference or uncommanded)


class _ReplayedWorld:
    """A simulation of recorded characters, whose rows are those of all the recordings."""

    def __init__(
        self, together: Sequence[Recording], simulation: Simulation, *, is_exact: bool
    ) -> None:
        self._simulation, self._is_exact = simulation, is_exact
        self._characters = [
            (recording, simulated, list[StampedState]())
            for recording, simulated in zip(together, simulation.characters, strict=True)
        ]
        self._lead = together[0]  # the recording that balls and resets are taken from

    def found(self) -> list[States]:
        """The states so far, of each character."""
        return [
            {
                POSITION: np.array([s.position for s in states]).reshape(-1, recording.layout.size),
                VELOCITY: np.array([s.velocity for s in states]).reshape(-1, recording.layout.size),
            }
            for recording, _, states in self._characters
        ]

    def simulate(self, last: int, progress: Callable[[int], None]) -> Difference | None:
        """Simulate up to the state of row `last`, or to the first that differs by a bit."""
        resets = set(self._lead.episode_rows[1:].tolist())
        for row in range(last + 1):
            if row in resets:
                self._reset(row)
            elif row and (diverged := self._step(row - 1)) is not None:
                return diverged
            for _, simulated, states in self._characters:
                states.append(simulated.state)
            if self._is_exact and (difference := self._compare(row)) is not None:
                return difference
            if row % _PROGRESS_TICKS == 0 or row == last:
                progress(row)
        return None

    def _reset(self, row: int) -> None:
        """Begin the episode whose first state is that of a row."""
        recordings = [recording for recording, _, _ in self._characters]
        changes = changes_of_reset(recordings, row, self._simulation.settings.world)
        if changes is None:
            self._simulation.reset()
        else:
            self._simulation.reset(changes.world, changes.states)

    def _step(self, row: int) -> Difference | None:
        """Take the tick that begins with the state of a row; a difference if it diverges."""
        simulation, lead = self._simulation, self._lead
        recordings = [recording for recording, _, _ in self._characters]
        simulation.watches_contacts = self._is_exact and any(
            each.contacts and each.contacts[row] is not None for each in recordings
        )
        try:
            simulation.step(
                [recording.effort[row] for recording in recordings],
                [make_pushes(recording, row, simulation.tick) for recording in recordings],
                lead.throws[row] if lead.throws else (),
            )
        except SimulationError as error:
            tick = simulation.tick + 1
            sentence = f"the recording went on, but the replay {error}"
            stamp_ns = simulation.clock.stamp_ns(tick)
            return Difference(tick, stamp_ns, "state", "", np.nan, np.nan, sentence)
        return None

    def _compare(self, row: int) -> Difference | None:
        """What differs in the state of a row, and in the contacts of the tick before it."""
        for recording, simulated, _ in self._characters:
            found = {
                POSITION: simulated.state.position[None],
                VELOCITY: simulated.state.velocity[None],
            }
            difference = first_difference(recording, found, first_row=row)
            difference = difference or self._compare_contacts(recording, simulated, row)
            if difference is not None:
                return difference
        balls = self._lead.balls[row] if self._lead.balls else None
        if balls is None:
            return None
        return compare_balls(self._simulation.tick, balls, self._simulation.ball_motion())

    def _compare_contacts(
        self, recording: Recording, simulated: SimulatedCharacter, row: int
    ) -> Difference | None:
        recorded = recording.contacts[row - 1] if recording.contacts and row else None
        if recorded is None or (contacts := simulated.contacts) is None:
            return None
        links, simulation = [link.name for link in recording.character.links], self._simulation
        found = select(simulation.stamp_ns, links, contacts.wrenches, contacts.touching)
        return compare_contacts(simulation.tick, recorded, found, recording.name)
