"""Reads what a bag says of a run, as arrays."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from std_msgs.msg import String

from experiment.bags.reader import RecordedMessage, read_messages
from experiment.figures import BAG
from msgs_config import configuration, topics
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character import Character
from msgs_config.character_loading import load_character
from msgs_config.configuration import RunConfiguration
from msgs_config.errors import ActuatedCharactersError, RecordingError
from msgs_config.joint_layout import JointLayout
from msgs_config.messages import JointStateDecoder, decode, state_in_layout
from msgs_config.shared_parameters import CHARACTER, RATE, placed
from msgs_config.stamped import StampedState
from msgs_config.tick_clock import NANOSECONDS_PER_SECOND, TickClock
from msgs_config.wrench_messages import WrenchArrays, decode_wrenches

_STATES = topics.JOINT_STATES.name
_REFERENCE = topics.REFERENCE.of(topics.CONTROLLER_NODE).name
_CONFIGURATION = topics.CONFIGURATION.of(topics.SIM_NODE).name
_CONTACTS, _APPLIED_WRENCH = topics.CONTACTS.name, topics.APPLIED_WRENCH.name
_READ = (_STATES, _REFERENCE, _CONFIGURATION, _CONTACTS, _APPLIED_WRENCH)

_BAG_FILES = (".mcap", ".db3")  # rosbag2's storage

Wrenches: TypeAlias = tuple[WrenchArrays | None, ...]


@dataclass(frozen=True)
class Recording:
    """What a bag says of a run of n degrees of freedom: t ticks, and the t + 1 states around them.

    Tick k leads from state k to state k + 1. Units and frames: docs/design.md, "Names, states and
    torques".
    """

    character: Character  # as it stood there
    parameters: Mapping[str, Any] = field(repr=False)  # the simulator's
    stamps_ns: IntArray  # (t + 1,): each state once, in order, no tick left out
    position: FloatArray  # (t + 1, n)
    velocity: FloatArray  # (t + 1, n)
    effort: FloatArray  # (t, n), as really applied in each tick; NaN in one that was a reset
    reference_position: FloatArray  # (t + 1, n), NaN where there was none
    reference_velocity: FloatArray  # (t + 1, n)
    contacts: Wrenches  # (t,): in each tick, None where nothing was said; () if never
    applied_wrench: Wrenches  # likewise: pushes

    @property
    def layout(self) -> JointLayout:
        """The order of the degrees of freedom."""
        return self.character.layout

    @property
    def times(self) -> FloatArray:
        """Simulation time (t + 1,) of each state since the first one, s."""
        times: FloatArray = (self.stamps_ns - self.stamps_ns[0]) / NANOSECONDS_PER_SECOND
        return times


def read_recording(path: Path) -> Recording:
    """Read the bag in a run's directory, or a bag itself.

    Args:
        path: The directory that a run, a recorder or `ros2 bag record` has left.

    Raises:
        RecordingError: there is no complete bag; it holds no states, those of several characters
            or of several simulators, or not every tick; or its character is not that of today.
        ActuatedCharactersError: a message is not what its topic should carry.
    """
    if not path.is_dir():
        raise RecordingError(f"no run or recording at {path}")
    bag = path / BAG if (path / BAG).is_dir() else path
    if bag == path and not any(file.suffix in _BAG_FILES for file in path.iterdir()):
        raise RecordingError(f"no recording in {path}: it is no bag, and the run there left none")
    messages = _read(bag)
    known = _known(bag, messages[_CONFIGURATION])
    character = _character(bag, known)
    states = _states(bag, known, messages[_STATES])
    stamps = [state.stamp_ns for state in states]
    reference = _reference(known.layout, stamps, messages[_REFERENCE])
    missing = np.full(known.layout.size, np.nan)
    efforts = [missing if state.effort is None else state.effort for state in states[1:]]
    return Recording(
        character=character,
        parameters=known.parameters,
        stamps_ns=np.array(stamps, dtype=np.intp),
        position=np.stack([state.position for state in states]),
        velocity=np.stack([state.velocity for state in states]),
        effort=np.array(efforts).reshape(-1, known.layout.size),
        reference_position=reference[0],
        reference_velocity=reference[1],
        contacts=_wrenches(stamps, messages[_CONTACTS]),
        applied_wrench=_wrenches(stamps, messages[_APPLIED_WRENCH]),
    )


def _read(bag: Path) -> dict[str, list[RecordedMessage]]:
    """The messages of the topics that are read, by the names that these have in one namespace.

    Raises:
        RecordingError: there is no complete bag, or a topic is there in several namespaces.
    """
    messages: dict[str, list[RecordedMessage]] = {name: [] for name in _READ}
    for message in read_messages(bag):
        for name in _READ:
            if f"/{message.topic}".endswith(f"/{name}"):
                messages[name].append(message)
    for found in messages.values():
        names = sorted({message.topic for message in found})
        if len(names) > 1:
            raise RecordingError(
                f"recording {bag} has several characters ({', '.join(names)}); "
                "record each by a recorder in its own namespace"
            )
    return messages


def _known(bag: Path, messages: list[RecordedMessage]) -> RunConfiguration:
    texts = {decode(message.raw, String).data for message in messages}
    if not texts:
        raise RecordingError(
            f"recording {bag} has nothing on '{_CONFIGURATION}', which says what its states mean"
        )
    if len(texts) > 1:
        raise RecordingError(f"recording {bag} has several simulators, or one started anew")
    return configuration.parse(texts.pop())


def _character(bag: Path, known: RunConfiguration) -> Character:
    """The simulator's character, loaded anew."""
    name = known.parameters.get(CHARACTER.name)
    try:
        character = placed(load_character(str(name)), known.parameters)
    except ActuatedCharactersError as error:
        raise RecordingError(f"recording {bag}: cannot load its character: {error}") from error
    same_joints = character.layout.joints == known.layout.joints
    if not same_joints or not np.isclose(character.mass, known.mass, rtol=1e-9):
        raise RecordingError(
            f"recording {bag}: character {name} has other joints or another mass now than it had "
            f"then ({character.layout.size} degrees of freedom and {character.mass:g} kg, then "
            f"{known.layout.size} and {known.mass:g} kg)"
        )
    return character


def _states(
    bag: Path, known: RunConfiguration, messages: list[RecordedMessage]
) -> list[StampedState]:
    """The states, each once, in order; one that was published again has the same stamp."""
    rate = known.parameters.get(RATE.name)
    if not isinstance(rate, int):
        raise RecordingError(f"recording {bag}: its simulator's 'rate' is {rate}, not a number")
    decoder, clock = JointStateDecoder(), TickClock(rate)
    states: list[StampedState] = []
    last_tick = 0
    for message in messages:
        state = state_in_layout(known.layout, decoder.decode(message.raw))
        tick = clock.tick(state.stamp_ns)
        if states and tick <= last_tick:
            continue
        if states and tick > last_tick + 1:
            raise RecordingError(
                f"recording {bag} lacks the states of ticks {last_tick + 1} to {tick - 1}"
            )
        states.append(state)
        last_tick = tick
    if not states:
        raise RecordingError(f"recording {bag} has no states, nothing on '{_STATES}'")
    return states


def _reference(
    layout: JointLayout, stamps: list[int], messages: list[RecordedMessage]
) -> tuple[FloatArray, FloatArray]:
    """Position and velocity (t + 1, n) of the reference at each state, NaN where there is none."""
    decoder, row = JointStateDecoder(), {stamp: row for row, stamp in enumerate(stamps)}
    position = np.full((len(stamps), layout.size), np.nan)
    velocity = position.copy()
    for message in messages:
        state = state_in_layout(layout, decoder.decode(message.raw))
        if state.stamp_ns in row:
            position[row[state.stamp_ns]] = state.position
            velocity[row[state.stamp_ns]] = state.velocity
    return position, velocity


def _wrenches(stamps: list[int], messages: list[RecordedMessage]) -> Wrenches:
    """What acted in each tick, as it was said with the stamp of the state after it."""
    if not messages:
        return ()
    decoded = map(decode_wrenches, (message.raw for message in messages))
    said = {wrenches.stamp_ns: wrenches for wrenches in decoded}
    return tuple(said.get(stamp) for stamp in stamps[1:])
