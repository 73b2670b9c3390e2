"""Input and output of a behaviour in a tick, and the behaviours by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from typing import NamedTuple, Protocol, TypeAlias

from controller_node.behaviours.asked import UNASKED, AskedBehaviour
from controller_node.behaviours.targets import Target
from controller_node.control_laws import GainArrays
from controller_node.references.base import ReferenceState
from controller_node.references.steering.course import Course
from controller_node.references.transformed import PlanarTransform
from controller_node.registry import Registry
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Values


class Mode(Enum):
    """The mode of a character, as published on `~/mode`."""

    TRACK = "TRACK"  # follows its own reference
    REACT = "REACT"  # was hit, and gives way
    SEARCH = "SEARCH"  # looks for a motion to go on with
    BLEND = "BLEND"  # goes over to a motion that was found, or back to its own
    LIMP = "LIMP"  # nothing drives it
    STATE = "STATE"  # in a state of a state machine, which the facts name


class Surroundings(NamedTuple):
    """What is around a character in a state; None is what its behaviour does not need."""

    contacts: FloatArray | None = None  # (links, 6) as in an observation
    opponent: FloatArray | None = None  # (3,) as in an observation


class Observation(NamedTuple):
    """A tick as a behaviour sees it; times in s since the episode's first state."""

    time: float
    next_time: float
    position: FloatArray  # (n,)
    velocity: FloatArray  # (n,)
    contacts: FloatArray  # (links, 6) net wrenches of the tick before, world axes, N and N m
    now: ReferenceState  # desired by the own reference
    upcoming: ReferenceState  # desired by the own reference one tick later
    gains: GainArrays  # the gains in force
    whole_gains: GainArrays  # the gains of joints at full strength
    strengths: FloatArray  # (b,) the share of the whole gains that is in force
    assisted: bool  # whether the gains in force drive a floating base
    opponent: FloatArray | None = None  # (3,) m, world: the root of the opponent, if it has one
    course: Course | None = None  # what a steered reference is told
    asked: AskedBehaviour = UNASKED  # the same one as long as nothing else is asked for

    def assistance(self, unless_none: object = "full") -> object:
        """The assistance for a report: "none" where the gains drive no floating base."""
        return unless_none if self.assisted else "none"


@dataclass(frozen=True, eq=False)
class Phase:
    """A time in one mode, and the facts, for JSON, that led to it."""

    mode: Mode
    facts: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class BehaviourOutput:
    """Phase, target and gains of a tick."""

    phase: Phase  # the same object as long as it lasts
    target: Target | None = None  # the same object as long as it leads on; None: the reference
    gains: GainArrays | None = None  # None: those in force
    effort: FloatArray | None = None  # (n,) beside that of the law, N m and N; None: nothing


class Behaviour(Protocol):
    """A state machine, one for each episode."""

    carry: PlanarTransform  # takes the own reference to where the character goes on with it

    def advance(self, seen: Observation) -> BehaviourOutput:
        """The output of a tick; called once a tick, in order."""
        ...


@dataclass(frozen=True)
class ModeReport:
    """Since which state a mode holds, and why."""

    phase: Phase
    stamp_ns: int

    def content(self) -> dict[str, object]:
        """The report as JSON has it."""
        mode = self.phase.mode.value
        return {"mode": mode, "stamp_ns": self.stamp_ns, **self.phase.facts}


class Tracking:
    """Follows the reference with the gains in force, whatever comes; one mode for the episode."""

    def __init__(self, mode: Mode = Mode.TRACK) -> None:
        """`LIMP` is the mode of a ragdoll, whose law is `zero`."""
        self.carry = PlanarTransform()
        self._mode = mode
        self._output: BehaviourOutput | None = None

    def advance(self, seen: Observation) -> BehaviourOutput:
        """The reference and the gains as they are."""
        if self._output is None:
            self._output = BehaviourOutput(Phase(self._mode, {"assistance": seen.assistance()}))
        return self._output


@dataclass(frozen=True)
class BehaviourChoice:
    """A behaviour, of which each episode makes one."""

    make: Callable[[], Behaviour] = Tracking
    needs_contacts: bool = False
    opponent: str = ""  # the character whose place it needs, if it needs one
    makes_effort: bool = False  # it takes the place of a law
    follows_motion: bool = True  # what it does depends on the reference's poses
    can_be_asked: bool = False  # whether `~/behaviour` says what of it is wanted

    def check(self, around: Surroundings) -> None:
        """Raise ConfigurationError if what it needs with each state is not there."""
        if around.contacts is None and self.needs_contacts:
            raise ConfigurationError("the behaviour needs the contacts of each state's tick")
        if around.opponent is None and self.opponent:
            raise ConfigurationError(f"the behaviour needs the place of '{self.opponent}'")


BehaviourMaker: TypeAlias = Callable[[Character, Values], BehaviourChoice]

BEHAVIOURS = Registry[BehaviourMaker]()


@BEHAVIOURS.register("tracking")
def _tracking(character: Character, values: Values) -> BehaviourChoice:
    return BehaviourChoice(Tracking)


@BEHAVIOURS.register("ragdoll")
def _ragdoll(character: Character, values: Values) -> BehaviourChoice:
    return BehaviourChoice(partial(Tracking, Mode.LIMP))
