"""What a behaviour that reacts is asked to do, from a stamp on."""

from dataclasses import dataclass
from enum import Enum

from controller_node.schedule import Schedule
from msgs_config.errors import MotionError, one_of


class Ask(Enum):
    """What it is asked to do; what it has begun, lying and getting up, it ends first."""

    TRACK = "track"  # follow the reference, whatever comes
    REACT = "react"  # give way to hits, go limp by a hard one or a fall, and get up
    GET_UP = "get_up"  # do not tell hits, but get up after a fall; if it lies now, at once
    BRACE = "brace"  # as `TRACK`, with stiffer joints


ASKABLE = ("active_ragdoll", "reactive")
"""The values of the parameter `behaviour` that can be asked."""


@dataclass(frozen=True)
class AskedBehaviour:
    """What it is asked to do from a stamp on."""

    start_ns: int
    ask: Ask


UNASKED = AskedBehaviour(0, Ask.REACT)
"""What it does that is not asked for anything: all that it can."""


def asked_behaviour(names: tuple[str, ...], start_ns: int) -> AskedBehaviour:
    """What a message asks for, by the only name that it has.

    Raises:
        MotionError: there is not one name, or an unknown one.
    """
    known = [each.value for each in Ask]
    if len(names) != 1:
        raise MotionError(
            f"behaviour: it has {len(names)} names; it must have one of {', '.join(known)}"
        )
    if names[0] not in known:
        raise MotionError(f"behaviour: {one_of('name', names[0], known)}")
    return AskedBehaviour(start_ns, Ask(names[0]))


def behaviour_schedule() -> Schedule[AskedBehaviour]:
    """What it is asked to do in an episode."""
    return Schedule("behaviour", UNASKED)
