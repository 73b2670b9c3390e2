"""Reads what a bag says of a run, as arrays."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from actuated_characters.bags.plans import PlanArrays
from actuated_characters.bags.reader import read_messages
from actuated_characters.bags.rebuilding import RecordedWorld
from actuated_characters.bags.tracks import (
    CONFIGURATION,
    MODE,
    PLAN,
    CharacterTimeline,
    CommandArrays,
    ControllerSettings,
    ModeChange,
    integers,
    matrix,
)
from actuated_characters.bags.world_track import WORLD_TOPICS, WorldTrack
from actuated_characters.runs.run_directory import BAG
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.layout import JointLayout
from msgs_config.character.model import Character
from msgs_config.errors import ActuatedCharactersError, RecordingError, one_of
from msgs_config.messages import topics
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.projectiles import BallStates
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.messages.wrenches import WrenchArrays

__all__ = [
    "CommandArrays",
    "ControllerSettings",
    "ModeChange",
    "RecordedWorld",
    "Recording",
    "read_recording",
    "read_recordings",
]

_READ = (
    CONFIGURATION,
    topics.CONFIGURATION.of(topics.CONTROLLER_NODE).name,
    topics.REFERENCE.of(topics.CONTROLLER_NODE).name,
    MODE,
    PLAN,
    topics.JOINT_STATES.name,
    topics.JOINT_TORQUES.name,
    topics.CONTACTS.name,
    topics.APPLIED_WRENCH.name,
    topics.EXTERNAL_WRENCH.name,
)
_STORAGE = (".mcap", ".db3")  # rosbag2's files, compressed or not

Wrenches: TypeAlias = tuple[WrenchArrays | None, ...]


@dataclass(frozen=True, kw_only=True)
class Recording:
    """What a bag says of a run of n degrees of freedom: t ticks, and the t + 1 states around them.

    Tick k leads from state k to state k + 1. Units and frames: docs/design.md, "Names, states and
    torques".
    """

    character: Character  # as it stood there, made from the texts in the bag
    name: str = ""  # its topics' namespace without the leading slash
    parameters: Mapping[str, Any] = field(repr=False)  # the simulator's
    versions: Mapping[str, str] = field(default_factory=dict, repr=False)  # it ran with them
    stamps_ns: IntArray  # (t + 1,): each state once, in order, no tick left out
    published_ns: IntArray  # (t + 1,): wall time of each state, as the bag has it
    position: FloatArray  # (t + 1, n)
    velocity: FloatArray  # (t + 1, n)
    effort: FloatArray  # (t, n), as really applied in each tick; NaN in one that was a reset
    reference_position: FloatArray  # (t + 1, n), NaN where there was none
    reference_velocity: FloatArray  # (t + 1, n)
    contacts: Wrenches  # (t,): in each tick, None where nothing was said; () if never
    applied_wrench: Wrenches  # likewise: pushes
    commands: tuple[tuple[CommandArrays, ...], ...]  # (t + 1,): that answer each state, in order
    controller: tuple[ControllerSettings, ...] = ()  # one after another
    modes: tuple[ModeChange, ...] = ()  # what it did, one after another
    plans: tuple[PlanArrays, ...] = ()  # what a planner expected, one after another
    unstamped_commands: tuple[CommandArrays, ...] = ()  # that answer no state, in real time
    pushes_sent: int = 0  # messages on `external_wrench`
    throws: tuple[
        tuple[ProjectileThrow, ...], ...
    ] = ()  # (t,): what each tick began with; () if nothing
    balls: tuple[BallStates | None, ...] = ()  # (t + 1,): where they are; () if there are none
    throws_sent: int = 0  # messages on `throw`
    skipped_states: int = 0  # of an episode whose first state is not in the bag
    world: RecordedWorld = field(default_factory=RecordedWorld)

    @property
    def layout(self) -> JointLayout:
        """The order of the degrees of freedom."""
        return self.character.layout

    @property
    def times(self) -> FloatArray:
        """Simulation time (t + 1,) of each state since the first one, s."""
        times: FloatArray = (self.stamps_ns - self.stamps_ns[0]) / NANOSECONDS_PER_SECOND
        return times

    @property
    def episode_rows(self) -> IntArray:
        """Rows of the first states of episodes; the first row is one."""
        if not self.layout.size:  # nothing in its states tells a reset
            return np.zeros(1, dtype=np.intp)
        resets = np.flatnonzero(np.isnan(self.effort).all(axis=1)) + 1
        return np.concatenate(([0], resets))


def read_recording(path: Path, character: str | None = None) -> Recording:
    """Read one character's part of a bag: the only one, or the one of that name.

    Args:
        path: See `read_recordings`.
        character: Its `Recording.name`, such as `left`.

    Raises:
        RecordingError: there are several, or none of that name; names those that there are.
        ActuatedCharactersError: see `read_recordings`.
    """
    recordings = read_recordings(path)
    names = [recording.name for recording in recordings]
    if character is None:
        if len(names) > 1:
            raise RecordingError(
                f"recording {path} has several characters ({', '.join(names)}); name one of them"
            )
        return recordings[0]
    if character not in names:
        if names == [""]:
            raise RecordingError(
                f"recording {path} has one character, which has no name; do not name '{character}'"
            )
        raise RecordingError(f"recording {path}: {one_of('character', character, names)}")
    return recordings[names.index(character)]


def read_recordings(path: Path) -> tuple[Recording, ...]:
    """Read every character's part of the bag in a run's directory, or of a bag itself.

    They come in the order in which they are in their world. What comes before the first state of
    an episode is left out.

    Args:
        path: The directory that a run, a recorder or `ros2 bag record` has left.

    Raises:
        RecordingError: there is no complete bag; it holds no states, those of several simulators
            in one namespace, or not every tick; or its character cannot be rebuilt.
        ActuatedCharactersError: a message is not what its topic should carry.
    """
    bag = find_bag(path)
    found, worlds = _read(bag)
    tracks = [track for track in found if track.rebuilt is not None]
    if not tracks:
        raise RecordingError(
            f"recording {bag} has nothing on '{CONFIGURATION}', which says what its states mean"
        )
    recordings = []
    for track in tracks:
        with _named(bag, track.namespace):
            recordings.append(_recording(track, worlds))
    return tuple(sorted(recordings, key=_place))


def find_bag(path: Path) -> Path:
    """The bag in a run's directory, or the bag itself.

    Raises:
        RecordingError: there is none.
    """
    if not path.exists():
        raise RecordingError(f"no run or recording at {path}")
    bag = path / BAG if (path / BAG).is_dir() else path
    if path.is_dir() and bag == path and not any(_is_storage(file) for file in path.iterdir()):
        raise RecordingError(f"no recording in {path}: it is no bag, and the run there left none")
    return bag


def _is_storage(file: Path) -> bool:
    return any(suffix in _STORAGE for suffix in file.suffixes)


def _place(recording: Recording) -> tuple[str, int, str]:
    """Where a recording stands among those of its bag: by its world, and by its order there."""
    world = recording.world
    place = world.characters.index(world.name) if world.name in world.characters else 0
    return world.namespace, place, recording.name


@contextmanager
def _named(bag: Path, namespace: str) -> Iterator[None]:
    """Say of which recording an error is."""
    try:
        yield
    except ActuatedCharactersError as error:
        where = f"{bag}, '{namespace}'" if namespace else f"{bag}"
        raise type(error)(f"recording {where}: {error}") from error


def _read(bag: Path) -> tuple[list[CharacterTimeline], dict[str, WorldTrack]]:
    """What is said in each namespace, of topics that have the contract's names."""
    tracks: dict[str, CharacterTimeline] = {}
    worlds: dict[str, WorldTrack] = {}
    places: dict[
        str, tuple[CharacterTimeline, str] | tuple[WorldTrack, str] | None
    ] = {}  # by topic
    for message in read_messages(bag):
        topic = message.topic
        if topic not in places:
            places[topic] = _world_of(topic, worlds) or _track_of(topic, tracks)
        place = places[topic]
        if place is None:
            continue
        track, name = place
        try:
            if isinstance(track, WorldTrack):
                track.take(name, message.raw)
            else:
                track.take(name, message.raw, message.log_time_ns)
        except ActuatedCharactersError:
            with _named(bag, "" if isinstance(track, WorldTrack) else track.namespace):
                raise
    return list(tracks.values()), worlds


def _world_of(topic: str, worlds: dict[str, WorldTrack]) -> tuple[WorldTrack, str] | None:
    for name in WORLD_TOPICS:
        if f"/{topic}".endswith(f"/{name}"):
            namespace = topic.removesuffix(name).strip("/")
            return worlds.setdefault(namespace, WorldTrack()), name
    return None


def _track_of(
    topic: str, tracks: dict[str, CharacterTimeline]
) -> tuple[CharacterTimeline, str] | None:
    for name in _READ:
        if f"/{topic}".endswith(f"/{name}"):
            namespace = topic.removesuffix(name).strip("/")
            return tracks.setdefault(namespace, CharacterTimeline(namespace)), name
    return None


def _recording(track: CharacterTimeline, worlds: Mapping[str, WorldTrack]) -> Recording:
    """What a track has collected. Raises RecordingError if it is not whole."""
    track.finish()
    assert track.rebuilt is not None
    rebuilt, states, size = track.rebuilt, track.states, track.rebuilt.known.layout.size
    stamps = integers(states.stamps_ns)
    count = len(stamps)
    reference_position, reference_velocity = _references(stamps, track)
    world, known = worlds.get(rebuilt.world.namespace, WorldTrack()), set(stamps.tolist())
    return Recording(
        character=rebuilt.character,
        name=track.namespace,
        parameters=rebuilt.known.parameters,
        versions=rebuilt.known.versions,
        stamps_ns=stamps,
        published_ns=integers(states.published_ns),
        position=matrix(states.position, size, count),
        velocity=matrix(states.velocity, size, count),
        effort=matrix(states.effort, size, count)[1:],  # the first state has none
        reference_position=reference_position,
        reference_velocity=reference_velocity,
        contacts=_by_tick(stamps, track.contacts),
        applied_wrench=_by_tick(stamps, track.applied_wrench),
        commands=tuple(tuple(track.commands.get(stamp, ())) for stamp in stamps.tolist()),
        controller=tuple(track.controller),
        modes=tuple(track.modes),
        plans=tuple(plan for stamp, plan in sorted(track.plans.items()) if stamp in known),
        unstamped_commands=tuple(track.commands.get(0, ())),
        pushes_sent=track.pushes_sent,
        throws=_throws(stamps, world),
        balls=tuple(map(world.balls.get, stamps.tolist())) if world.balls else (),
        throws_sent=world.throws_sent,
        skipped_states=track.skipped_states,
        world=rebuilt.world,
    )


def _references(stamps: IntArray, track: CharacterTimeline) -> tuple[FloatArray, FloatArray]:
    """Position and velocity (t + 1, n) of the reference at each state, NaN where there is none."""
    size, said = track.size, track.references
    at = integers(said.stamps_ns)
    rows = np.minimum(np.searchsorted(stamps, at), len(stamps) - 1)
    known = stamps[rows] == at
    found = []
    for numbers in (said.position, said.velocity):
        values = np.full((len(stamps), size), np.nan)
        values[rows[known]] = matrix(numbers, size, len(at))[known]
        found.append(values)
    return found[0], found[1]


def _by_tick(stamps: IntArray, said: dict[int, WrenchArrays]) -> Wrenches:
    """What acted in each tick, as it was said with the stamp of the state after it."""
    return tuple(said.get(stamp) for stamp in stamps.tolist()[1:]) if said else ()


def _throws(stamps: IntArray, world: WorldTrack) -> tuple[tuple[ProjectileThrow, ...], ...]:
    """What each tick began with, as it was said with the stamp of the state after it."""
    if not world.throws:
        return ()
    return tuple(tuple(world.throws.get(stamp, ())) for stamp in stamps.tolist()[1:])
