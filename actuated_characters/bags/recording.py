"""Reads the recordings of characters from a bag, as arrays."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np

from actuated_characters.bags.character_timeline import (
    CONFIGURATION,
    CharacterTimeline,
    CommandArrays,
    ModeChange,
    States,
)
from actuated_characters.bags.collecting import collect, naming
from actuated_characters.bags.format.metadata import BAG
from actuated_characters.bags.format.storage import FILE_SUFFIXES, SUFFIXES
from actuated_characters.bags.keyframes import KeyframePlace
from actuated_characters.bags.node_parameters import NodeParameters, between, in_force
from actuated_characters.bags.plans import PlanArrays
from actuated_characters.bags.reader import read_topics
from actuated_characters.bags.rebuilding import RecordedWorld
from actuated_characters.bags.world_timeline import Beginnings, WorldTimeline
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.layout import JointLayout
from msgs_config.character.model import Character
from msgs_config.errors import RecordingError, one_of
from msgs_config.file_kinds import refuse_other_kind
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.pins import PinArrays
from msgs_config.messages.projectiles import BallStates
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.messages.wrenches import WrenchArrays

__all__ = [
    "CommandArrays",
    "ModeChange",
    "NodeParameters",
    "RecordedWorld",
    "Recording",
    "read_recording",
    "read_recordings",
]

JOINT_STATE = "sensor_msgs/msg/JointState"

Wrenches: TypeAlias = tuple[WrenchArrays | None, ...]
_T = TypeVar("_T")


@dataclass(frozen=True, kw_only=True)
class Recording:
    """A character of n degrees of freedom in a bag: t ticks, and the t + 1 states around them.

    Tick k leads from state k to state k + 1. Units and frames: docs/topics.md, "Conventions".
    """

    character: Character  # made from the texts in the bag, in its place in the world
    name: str = ""  # its topics' namespace without the leading slash
    parameters: Mapping[str, Any] = field(repr=False)  # the simulator's parameters at the start
    # the simulator's parameters, set after set; empty where they never changed
    simulator: tuple[NodeParameters, ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict, repr=False)  # what it was run with
    stamps_ns: IntArray  # (t + 1,): each state once, in order, no tick left out
    published_ns: IntArray  # (t + 1,): when each state was published
    has_wall_times: bool = True  # False: `published_ns` are simulated log times
    position: FloatArray  # (t + 1, n)
    velocity: FloatArray  # (t + 1, n)
    effort: FloatArray  # (t, n), as really applied in each tick; NaN in one that was a reset
    reference_position: FloatArray  # (t + 1, n), NaN where there was none
    reference_velocity: FloatArray  # (t + 1, n)
    contacts: Wrenches  # (t,): those in each tick, None where no message came; () if never
    # (t,): pushes in each tick, then the pins' forces; None where no message came; () if never
    applied_wrench: Wrenches
    commands: tuple[tuple[CommandArrays, ...], ...]  # (t + 1,): the answers to each state, in order
    controller: tuple[NodeParameters, ...] = ()  # the controller's parameters, set after set
    modes: tuple[ModeChange, ...] = ()  # the controller's changes of mode, in order
    plans: tuple[PlanArrays, ...] = ()  # the plans of a planner, in order
    unstamped_commands: tuple[CommandArrays, ...] = ()  # commands of real time that answer no state
    pushes_sent: int = 0  # messages on `external_wrench`
    # (t + 1,): pins in force in the tick before each state; () if there were none
    pins: tuple[PinArrays | None, ...] = ()
    pins_sent: int = 0  # messages on `pin`
    # (t,): throws that each tick began with; () if there were none
    throws: tuple[tuple[ProjectileThrow, ...], ...] = ()
    balls: tuple[BallStates | None, ...] = ()  # (t + 1,): where the balls are; () if there are none
    throws_sent: int = 0  # messages on `throw`
    skipped_states: int = 0  # states of an episode whose first state is not in the bag
    begins_amid: bool = False  # it begins in the middle of an episode, and no other one begins
    # the simulator's and the controller's, serialised, where it begins with that state
    keyframe: bytes | None = field(default=None, repr=False)
    controller_keyframe: bytes | None = field(default=None, repr=False)
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

    def parameters_at(self, row: int) -> Mapping[str, Any]:
        """The simulator's parameters in the state of a row."""
        if not self.simulator:
            return self.parameters
        return in_force(self.simulator, int(self.stamps_ns[row]))

    def rows(self, rows: slice) -> "Recording":
        """Return the recording of some of its states, and of the ticks between them.

        Args:
            rows: First state, and the one behind the last.
        """
        ticks = slice(rows.start, rows.stop - 1)
        by_state = (
            *("stamps_ns", "published_ns", "position", "velocity", "balls", "commands"),
            *("reference_position", "reference_velocity", "pins"),
        )
        by_tick = ("effort", "contacts", "applied_wrench", "throws")
        cut = {name: getattr(self, name)[rows] for name in by_state}
        cut |= {name: getattr(self, name)[ticks] for name in by_tick}
        last_ns = int(cut["stamps_ns"][-1])
        return replace(
            self,
            parameters=self.parameters_at(rows.start),
            simulator=between(self.simulator, int(cut["stamps_ns"][0]), last_ns),
            keyframe=None if rows.start else self.keyframe,
            controller_keyframe=None if rows.start else self.controller_keyframe,
            **cut,
        )


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


def read_recordings(path: Path, begin: KeyframePlace | None = None) -> tuple[Recording, ...]:
    """Read every character's part of the bag in a run's directory, or of a bag itself.

    They come in the order in which they are in their world. Messages before the first state of an
    episode, or of a keyframe, are left out, unless there is none in the bag.

    Args:
        path: The directory that a run, a recorder or `ros2 bag record` has left.
        begin: The keyframe to begin with; what is before is not read, as far as it is not latched.

    Raises:
        RecordingError: there is no complete bag; it holds no states, those of several simulators
            in one namespace, or not every tick; or its character cannot be rebuilt.
        ActuatedCharactersError: a message has not its topic's type and meaning.
    """
    bag = find_bag(path)
    return make_recordings(bag, *collect(bag, begin))


def make_recordings(
    bag: Path, characters: Iterable[CharacterTimeline], worlds: Mapping[str, WorldTimeline]
) -> tuple[Recording, ...]:
    """Make recordings of what was collected from a bag.

    Raises:
        RecordingError: see `read_recordings`.
    """
    known = [timeline for timeline in characters if timeline.rebuilt is not None]
    if not known:
        raise RecordingError(describe_foreign(bag, read_topics(bag)))
    recordings = []
    for timeline in known:
        with naming(bag, timeline):
            recordings.append(_make_recording(timeline, worlds))
    return tuple(sorted(recordings, key=_place))


def describe_foreign(bag: Path, types: Mapping[str, str]) -> str:
    """What a bag is that is not of this project's simulator, and what can be done with it.

    `types` are those of its topics.
    """
    found = sorted(name for name, kind in types.items() if kind == JOINT_STATE)
    what = f"it has no {JOINT_STATE} either; its topics: {', '.join(sorted(types)) or 'none'}"
    if found:
        what = (
            f"it has joint states on {', '.join(found)}: `view`, `render`, `report` and "
            "`export` take it with --character ROBOT.urdf --topic TOPIC"
        )
    return (
        f"bag {bag} is not of this project's simulator: it has nothing on '{CONFIGURATION}', "
        f"which says what its states mean; {what}"
    )


def find_bag(path: Path) -> Path:
    """Return the bag in a run's directory, or the bag itself.

    Raises:
        RecordingError: there is none.
    """
    if not path.exists():
        raise RecordingError(f"no run or recording at {path}")
    refuse_other_kind(path, "a run or a bag", FILE_SUFFIXES, RecordingError)
    bag = path / BAG if (path / BAG).is_dir() else path
    is_run = path.is_dir() and bag == path
    if is_run and not any({*file.suffixes} & {*SUFFIXES.values()} for file in path.iterdir()):
        raise RecordingError(f"no recording in {path}: it is no bag, and the run there left none")
    return bag


def _place(recording: Recording) -> tuple[str, int, str]:
    """Where a recording stands among those of its bag: by its world, and by its order there."""
    world = recording.world
    place = world.characters.index(world.name) if world.name in world.characters else 0
    return world.namespace, place, recording.name


def _make_recording(timeline: CharacterTimeline, worlds: Mapping[str, WorldTimeline]) -> Recording:
    """Turn a timeline into arrays. Raises RecordingError if it is not whole."""
    rebuilt = timeline.finish()
    known, states, size = rebuilt.known, timeline.states, rebuilt.known.layout.size
    world = worlds.get(rebuilt.world.namespace, WorldTimeline("", Beginnings()))
    stamps = states.integers("stamps_ns")
    stamp_list = stamps.tolist()
    ends, plans = stamp_list[1:], timeline.plans
    simulator = timeline.simulator.parameters
    is_amid = bool(states.effort) and not np.isnan(states.effort[:size]).all()
    keyframe = world.keyframes.get(stamp_list[0])
    reference_position, reference_velocity = _references(stamps, timeline.references, size)
    return Recording(
        character=rebuilt.character,
        name=timeline.namespace,
        parameters=in_force(simulator, stamp_list[0]),
        simulator=tuple(simulator) if len(simulator) > 1 else (),
        versions=known.versions,
        stamps_ns=stamps,
        published_ns=states.integers("published_ns"),
        has_wall_times=timeline.has_wall_times,
        position=states.rows("position", size),
        velocity=states.rows("velocity", size),
        effort=states.rows("effort", size)[1:],  # the first state has none
        reference_position=reference_position,
        reference_velocity=reference_velocity,
        contacts=_at(ends, timeline.contacts, None),
        applied_wrench=_at(ends, timeline.applied, None),
        commands=tuple(tuple(timeline.commands.get(stamp, ())) for stamp in stamp_list),
        controller=tuple(timeline.controller),
        modes=tuple(timeline.modes),
        plans=tuple(plans[stamp] for stamp in sorted(plans.keys() & set(stamp_list))),
        unstamped_commands=tuple(timeline.commands.get(0, ())),
        pushes_sent=timeline.pushes_sent,
        pins=_at(stamp_list, timeline.pins, None),
        pins_sent=timeline.pins_sent,
        throws=_at(ends, world.throws, ()),
        balls=_at(stamp_list, world.balls, None),
        throws_sent=world.throws_sent,
        skipped_states=timeline.skipped_states,
        begins_amid=(timeline.begins_amid or is_amid) and keyframe is None,
        keyframe=keyframe,
        controller_keyframe=timeline.keyframes.get(stamp_list[0]) if keyframe else None,
        world=rebuilt.world,
    )


def _references(stamps: IntArray, found: States, size: int) -> tuple[FloatArray, FloatArray]:
    """Position and velocity (t + 1, n) of the reference at each state, NaN where there is none."""
    at = found.integers("stamps_ns")
    rows = np.minimum(np.searchsorted(stamps, at), len(stamps) - 1)
    known = stamps[rows] == at
    position, velocity = (np.full((len(stamps), size), np.nan) for _ in range(2))
    position[rows[known]] = found.rows("position", size)[known]
    velocity[rows[known]] = found.rows("velocity", size)[known]
    return position, velocity


def _at(stamps: list[int], found: Mapping[int, _T], missing: Any) -> tuple[_T, ...]:
    """The value of each stamp, `missing` where there is none; empty if there are no values."""
    return tuple(found.get(stamp, missing) for stamp in stamps) if found else ()
