"""What a behaviour sees in a tick, and what it has the controller do."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol, TypeAlias

from controller_node.behaviours.targets import AS_IT_IS, Target
from controller_node.control_laws import GainArrays
from controller_node.references.base import ReferenceState
from controller_node.references.transformed import PlanarTransform
from msgs_config.arrays import FloatArray


class Mode(Enum):
    """What a character is doing, as `~/mode` says it."""

    TRACK = "TRACK"  # follows its own reference
    REACT = "REACT"  # was hit, and gives way
    SEARCH = "SEARCH"  # looks for a motion to go on with
    BLEND = "BLEND"  # goes over to a motion that was found, or back to its own
    LIMP = "LIMP"  # nothing drives it


@dataclass(frozen=True)
class Observation:
    """A tick as a behaviour sees it; times in s since the episode's first state."""

    time: float
    next_time: float
    position: FloatArray  # (n,)
    velocity: FloatArray  # (n,)
    contacts: FloatArray  # (links, 6) net wrenches of the tick before, world axes, N and N m
    now: ReferenceState  # of the own reference
    upcoming: ReferenceState  # of the own reference, one tick later
    gains: GainArrays  # in force
    whole_gains: GainArrays  # of joints at full strength
    strengths: FloatArray  # (b,) by which those in force are weaker
    assisted: bool  # whether the gains in force drive a floating base

    def assistance(self, unless_none: object = "full") -> object:
        """What a report says of the assistance; of what has none, that it has none."""
        return unless_none if self.assisted else "none"


@dataclass(frozen=True, eq=False)
class Phase:
    """A time in one mode, and what led to it: facts for JSON."""

    mode: Mode
    facts: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class BehaviourOutput:
    """What to track in a tick, and how firmly."""

    phase: Phase  # the same object as long as it lasts
    way: Target  # the same object as long as it leads on
    gains: GainArrays


class Behaviour(Protocol):
    """A state machine, one for each episode."""

    carry: PlanarTransform  # of the own reference, to where the character goes on with it

    def advance(self, seen: Observation) -> BehaviourOutput:
        """What to do in a tick; called once a tick, in order."""
        ...


BehaviourMaker: TypeAlias = Callable[[], Behaviour]


@dataclass(frozen=True)
class ModeReport:
    """Since which state a mode holds, and why."""

    phase: Phase
    stamp_ns: int

    def content(self) -> dict[str, object]:
        """What JSON says of it."""
        mode = self.phase.mode.value
        return {"mode": mode, "stamp_ns": self.stamp_ns, **self.phase.facts}


class Tracking:
    """Follows the own reference, whatever comes."""

    def __init__(self) -> None:
        self.carry = PlanarTransform()
        self._phase: Phase | None = None

    def advance(self, seen: Observation) -> BehaviourOutput:
        """The reference and the gains as they are."""
        if self._phase is None:
            self._phase = Phase(Mode.TRACK, {"assistance": seen.assistance()})
        return BehaviourOutput(self._phase, AS_IT_IS, seen.gains)


class Ragdoll:
    """Follows nothing; its law is to be `zero`."""

    def __init__(self) -> None:
        self.carry = PlanarTransform()
        self._phase = Phase(Mode.LIMP, {"assistance": "none"})

    def advance(self, seen: Observation) -> BehaviourOutput:
        """The reference as it is, which nobody follows."""
        return BehaviourOutput(self._phase, AS_IT_IS, seen.gains)
