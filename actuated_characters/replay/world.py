"""Builds the world of a recording again, and checks that the recording has what that needs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import Recording, read_recordings
from actuated_characters.replay.comparison import clock_of
from msgs_config.errors import ActuatedCharactersError, RecordingError, one_of
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.keyframe import decode_keyframe
from msgs_config.messages.state import StampedState
from msgs_config.messages.wrenches import WrenchArrays
from msgs_config.parameters import Values
from msgs_config.versions import describe_changes, installed_versions
from sim_node.initial_state import changed_start
from sim_node.interface.keyframes import read_memory
from sim_node.parameters import resolve_alone
from sim_node.physics.settings import SimulationSettings, WorldSettings
from sim_node.physics.simulated_character import CharacterSetup
from sim_node.physics.simulation import Simulation, Snapshot
from sim_node.physics.wrenches import ExternalWrench
from sim_node.simulation_factory import make_character_setup, make_simulation_settings

_GROUNDS = ("plane", "none")
_MOST_BEHIND = 1  # states that a stopped recorder may have more of one character than of another


def worlds(recordings: Sequence[Recording]) -> list[tuple[Recording, ...]]:
    """The recordings of each world; simulators in different namespaces have different ones.

    Raises:
        RecordingError: a world cannot be repeated: a character that was in it was not recorded, or
            no episode begins in the recording.
    """
    if any(recording.begins_amid for recording in recordings):
        raise RecordingError(
            "the recording begins in the middle of an episode, and has neither another one nor a "
            "keyframe of this user's: it can be viewed, not repeated"
        )
    found: dict[tuple[str, ...], list[Recording]] = {}
    for recording in recordings:
        world = recording.world
        key = (world.namespace, *world.characters) if world.characters else (recording.name,)
        found.setdefault(key, []).append(recording)
    for together in found.values():
        world = together[0].world
        recorded = {recording.world.name for recording in together}
        missing = [name for name in world.characters if name not in recorded]
        if missing:
            raise RecordingError(
                f"the recording lacks {', '.join(missing)}, in whose world "
                f"{', '.join(sorted(recorded))} was; record all of them"
            )
    return [tuple(together) for together in found.values()]


def check_keyframe(recording: Recording) -> None:
    """Raise RecordingError if a recording begins with a keyframe of other versions than these."""
    changes = describe_changes(recording.versions, installed_versions())
    if recording.keyframe is not None and changes:
        raise RecordingError(f"the recording begins with a keyframe, and was {changes}")


def simulator_values(recording: Recording, row: int = 0) -> Values:
    """All parameters of the simulator in the state of a row, as if the character were alone.

    Raises:
        RecordingError: this simulator has no such parameters.
    """
    recorded = recording.parameters_at(row)
    given = {name: value for name, value in recorded.items() if value is not None}
    try:
        return resolve_alone(recording.character, given)
    except ActuatedCharactersError as error:
        reason = f"the recording's simulator cannot be built again: {error}"
        changes = describe_changes(recording.versions, installed_versions())
        raise RecordingError("; ".join(filter(None, (reason, changes)))) from error


@dataclass(frozen=True)
class ResetChanges:
    """What is different from an episode on."""

    world: WorldSettings
    states: Mapping[str, StampedState]  # first states by the characters' names in the world


def changes_of_reset(
    together: Sequence[Recording], row: int, world: WorldSettings
) -> ResetChanges | None:
    """What the reset that led to a row has changed in a world of these settings; None: nothing.

    Raises:
        RecordingError: this simulator has no such parameters.
    """
    if not any(recording.simulator for recording in together):
        return None
    states = {}
    for recording in together:
        before, after = (simulator_values(recording, each) for each in (row - 1, row))
        if (state := changed_start(before, after)) is not None:
            states[recording.world.name] = state
    return ResetChanges(world.changed(simulator_values(together[0], row)), states)


def of_character(recording: Recording) -> str:
    """For messages: whose recording it is, where there are several."""
    return f" of {recording.name}" if recording.name else ""


def check_pushes(recording: Recording) -> list[str]:
    """Check that the recording has the pushes that acted in each tick; returns remarks.

    Raises:
        RecordingError: there were pushes, and it does not have all that acted.
    """
    of, sent = of_character(recording), recording.pushes_sent + recording.pins_sent
    if not recording.applied_wrench:
        if sent:
            what, topic = (
                ("pushes", topics.EXTERNAL_WRENCH)
                if recording.pushes_sent
                else ("pins", topics.PIN)
            )
            raise RecordingError(
                f"the recording has {what}{of} ({recording.pushes_sent or sent} messages on "
                f"'{topic.name}'), but not which of them acted: nothing on 'applied_wrench'"
            )
        return [f"the recording has no 'applied_wrench'{of}: replayed without pushes"]
    if sent and None in recording.applied_wrench:
        gaps = [row for row, pushes in enumerate(recording.applied_wrench) if pushes is None]
        raise RecordingError(
            f"the recording lacks which pushes acted{of} in {len(gaps)} ticks, the first "
            f"time at {recording.stamps_ns[gaps[0] + 1]} ns: nothing on 'applied_wrench' there"
        )
    return []


def check_throws(recording: Recording) -> list[str]:
    """Check that the recording has the throw of each ball; returns remarks.

    Raises:
        RecordingError: there were balls, and it does not have how they were thrown.
    """
    known = recording.balls[0] if recording.balls and recording.keyframe else None
    thrown = sum(map(len, recording.throws)) + (0 if known is None else len(known.names))
    balls = max((len(each.names) for each in recording.balls if each is not None), default=0)
    if balls > thrown:
        raise RecordingError(
            f"the recording has {balls} balls on 'thrown', but does not say how each was thrown: "
            f"{thrown} messages on 'applied_throw'"
        )
    if thrown or not recording.throws_sent:
        return []
    return [
        f"the recording has {recording.throws_sent} messages on 'throw', and nothing on "
        "'applied_throw': replayed without balls"
    ]


def make_simulation(together: Sequence[Recording], first_stamp_ns: int) -> Simulation:
    """The world of some recordings, its first states of that stamp, for efforts as really applied.

    What clips or delays an effort on its way is left out: it was done when they were recorded.

    Raises:
        RecordingError: the recording does not fit this simulator.
        ActuatedCharactersError: the engine refuses a file.
    """
    values = [simulator_values(recording) for recording in together]
    setups = [
        _unlimited(make_character_setup(recording.character, own, recording.world.name))
        for recording, own in zip(together, values, strict=True)
    ]
    settings = _settings(together[0], values[0])
    first_tick = TickClock(settings.rate_hz).tick(first_stamp_ns)
    simulation = Simulation(setups, settings, first_tick)
    if together[0].keyframe is not None:
        check_keyframe(together[0])
        memory = decode_keyframe(together[0].keyframe).memory
        simulation.load_snapshot(_of_applied(read_memory(memory, simulation)[0], settings))
    return simulation


def _of_applied(snapshot: Snapshot, settings: SimulationSettings) -> Snapshot:
    """A state for efforts and forces as really applied: no effort is on its way, no pin acts."""
    characters = tuple(replace(each, delayed=(), pins=()) for each in snapshot.characters)
    return replace(snapshot, settings=settings, characters=characters)


def _settings(recording: Recording, values: Values) -> SimulationSettings:
    """The settings, with the terrain from the recording's text."""
    terrain = recording.world.terrain
    if terrain is not None:
        values = Values(values | {"terrain": "none"})
    elif (path := SimulationSettings.of(values).terrain) not in _GROUNDS:
        raise RecordingError(f"the recording lacks its terrain, {path}")
    settings = make_simulation_settings(values)
    world = replace(settings.world, terrain=terrain)
    return replace(settings, world=world, command_delay_ticks=0)


def _unlimited(setup: CharacterSetup) -> CharacterSetup:
    """A character whose efforts are not clipped."""
    character = setup.character
    links = tuple(replace(e, joint=replace(e.joint, effort_limit=inf)) for e in character.links)
    return replace(setup, character=replace(character, links=links))


def make_pushes(recording: Recording, row: int, tick: int) -> list[ExternalWrench]:
    """The pushes and the pins' forces that acted in the tick of a row, which begins at `tick`.

    They are in the order of the simulator's sums.

    Raises:
        RecordingError: a link does not exist.
    """
    applied = recording.applied_wrench[row] if recording.applied_wrench else None
    return wrenches_of(recording, applied, tick)


def wrenches_of(
    recording: Recording, applied: WrenchArrays | None, tick: int
) -> list[ExternalWrench]:
    """Wrenches that a recording has of the tick that begins at `tick`, for that tick alone.

    Raises:
        RecordingError: a link does not exist.
    """
    if applied is None or not applied.links:
        return []
    links = recording.character.links
    rows = {link.name: number for number, link in enumerate(links)}
    pushes = []
    for number, name in enumerate(applied.links):
        if name not in rows:
            raise RecordingError(f"a push of tick {tick}: {one_of('link', name, list(rows))}")
        centre = links[rows[name]].inertial_pose.position
        point = applied.points[number] if len(applied.points) else np.array(centre)
        pushes.append(ExternalWrench(rows[name], applied.wrenches[number], point, tick, 1))
    return pushes


def read_world(path: Path, number: int = 0) -> tuple[list[Recording], list[str]]:
    """Read the recordings of one of a bag's worlds, cut to the states that all have; and remarks.

    Raises:
        ActuatedCharactersError: the bag cannot be read, or its worlds are not whole.
    """
    return cut_world(worlds(read_recordings(path))[number])


def cut_world(together: Sequence[Recording]) -> tuple[list[Recording], list[str]]:
    """Cut the recordings of a world to the states that all have; returns them, and remarks.

    They begin with the first state of an episode that all have. A recorder that was stopped may
    have one state more of one than of another.

    Raises:
        RecordingError: there is no episode whose first state all have, the resets differ, or one
            of them ends before the others.
    """
    begins = [set(each.stamps_ns[each.episode_rows].tolist()) for each in together]
    common = set.intersection(*begins)
    if not common:
        raise RecordingError("the characters of one world have no episode in common")
    first_ns = min(common)
    rows = [int(np.searchsorted(recording.stamps_ns, first_ns)) for recording in together]
    counts = [len(each.stamps_ns) - row for each, row in zip(together, rows, strict=True)]
    count = min(counts)
    if max(counts) - count > _MOST_BEHIND:
        short, whole = together[counts.index(count)], together[counts.index(max(counts))]
        raise RecordingError(
            f"the recording of {short.name} ends at {_last_tick(short)}, that of {whole.name}, in "
            f"the same world, at {_last_tick(whole)}: they cannot be simulated together"
        )
    cut = [each.rows(slice(row, row + count)) for each, row in zip(together, rows, strict=True)]
    resets = [each.episode_rows.tolist() for each in cut]
    if any(each != resets[0] for each in resets):
        raise RecordingError("the characters of one world were reset at different ticks")
    return cut, [
        f"the first {row} states of {recording.name} were left out: the others of its world have "
        "no episode that begins so early"
        for recording, row in zip(together, rows, strict=True)
        if row
    ]


def _last_tick(recording: Recording) -> str:
    return f"tick {clock_of(recording).tick(int(recording.stamps_ns[-1]))}"
