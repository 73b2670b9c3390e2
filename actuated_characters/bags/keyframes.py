"""Where a recording can be begun to be read: in the states of its keyframes."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from actuated_characters.bags.reader import OpenBag, open_bag
from msgs_config.memory import is_own
from msgs_config.messages import topics
from msgs_config.messages.cdr import decode_header
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.joint_state import JointStateDecoder
from msgs_config.messages.keyframe import decode_keyframe

_ROUNDING_NS = 1000  # by which a time that was computed may be too small
_SIMULATOR = topics.KEYFRAME.of(topics.SIM_NODE).name
_CONTROLLER = topics.CONTROLLER_KEYFRAME.of(topics.CONTROLLER_NODE).name


class KeyframePlace(NamedTuple):
    """The place of a keyframe in a recording."""

    stamp_ns: int  # of its state
    log_time_ns: int  # of the simulator's message, which comes before its state


@dataclass(frozen=True)
class KeyframePlaces:
    """Where the keyframes of a recording are, of one simulator and its one controller."""

    first_ns: int  # stamp of the recording's first state
    places: tuple[KeyframePlace, ...]  # in order, each of both nodes

    def before(self, time: float) -> KeyframePlace | None:
        """The last one up to a time in s since the first state, if it is not the first state's."""
        limit_ns = self.first_ns + time * NANOSECONDS_PER_SECOND + _ROUNDING_NS
        found = [each for each in self.places if self.first_ns < each.stamp_ns <= limit_ns]
        return found[-1] if found else None


def find_keyframes(bag: Path) -> KeyframePlaces | None:
    """The keyframes of a bag that can be opened; None if it has those of several nodes of a kind.

    Raises:
        ActuatedCharactersError: the bag cannot be read.
    """
    with open_bag(bag) as opened:
        return _find(opened)


def _find(bag: OpenBag) -> KeyframePlaces | None:
    recorded = bag.types
    simulators = [name for name in recorded if name.endswith(f"/{_SIMULATOR}")]
    controllers = [name for name in recorded if name.endswith(f"/{_CONTROLLER}")]
    if len(simulators) != 1 or len(controllers) != 1:
        return None
    at: dict[int, int] = {}
    answered: set[int] = set()
    for message in bag.messages((simulators[0], controllers[0])):
        stamp_ns, _, memory = decode_keyframe(message.raw)
        if not is_own(memory):
            continue
        if message.topic == simulators[0]:
            at.setdefault(stamp_ns, message.log_time_ns)
        else:
            answered.add(stamp_ns)
    namespace = simulators[0].removesuffix(_SIMULATOR)
    needed = (namespace + each.name for each in (topics.JOINT_STATES, topics.EPISODE))
    if not {*needed} <= recorded.keys():  # a character with a name has them below that
        return None
    first_ns = _first_stamp(bag, namespace, at)
    if first_ns is None:
        return None
    places = (KeyframePlace(stamp, at[stamp]) for stamp in sorted(at.keys() & answered))
    return KeyframePlaces(first_ns, tuple(places))


def _first_stamp(bag: OpenBag, namespace: str, keyframes: Collection[int]) -> int | None:
    """The stamp of the state that the recording of a bag begins with: of an episode's first one.

    Where the bag begins in the middle of an episode, it may be that of a keyframe.
    """
    states, episodes = (namespace + each.name for each in (topics.JOINT_STATES, topics.EPISODE))
    first = next(bag.messages([states]), None)
    if first is None:
        return None
    state = JointStateDecoder().decode(first.raw)
    if not len(state.effort):
        return state.stamp_ns
    begun = (decode_header(message.raw)[0] for message in bag.messages([episodes]))
    later = [stamp for stamp in (*keyframes, *begun) if stamp >= state.stamp_ns]
    return min(later, default=None)
