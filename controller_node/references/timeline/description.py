"""What a timeline says, as its file has it; times are s since the episode's first state."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

Point = tuple[float, float, float]


class Ease(Enum):
    """How a layer goes through a pose."""

    SMOOTH = "smooth"  # on, as the parabola through it and its neighbours does
    REST = "rest"  # it comes to rest there


@dataclass(frozen=True)
class Entry:
    """Something that begins at a time."""

    place: str  # file, track and number, for errors
    at: float  # s


@dataclass(frozen=True)
class Pose(Entry):
    """Degrees of freedom by name, rad or m; those that a layer has before keep their values."""

    values: Mapping[str, float]
    ease: Ease = Ease.SMOOTH  # of joints without a velocity or an acceleration
    velocity: Mapping[str, float] = field(default_factory=dict)  # rad/s or m/s, of whole joints
    acceleration: Mapping[str, float] = field(default_factory=dict)  # rad/s² or m/s², likewise


@dataclass(frozen=True)
class Layer:
    """Poses in time of the joints that they name, over all that is beneath."""

    place: str
    poses: tuple[Pose, ...]
    come: float  # s before the first pose, in which it comes from what is beneath
    go: float | None  # s after the last pose, in which it gives way; None: it holds


@dataclass(frozen=True)
class ClipEntry(Entry):
    """A part of a clip."""

    clip: str  # a name, or a path
    begin: float  # s, in the clip
    end: float | None  # s, in the clip; None: its end, of one that wraps for ever
    blend: float  # s, in which it comes from what was before
    position: tuple[float, float] | None  # m, of the root on the ground; None: where it is
    heading: float | None  # rad; None: as it is


@dataclass(frozen=True)
class SteeringEntry(Entry):
    """A velocity in the character's own frame."""

    until: float  # s
    velocity: Point  # m/s ahead and to the left, rad/s to the left
    blend: float  # s, in which it comes from what was before


@dataclass(frozen=True)
class TargetEntry(Entry):
    """A point in the world that a link comes to, or that the head looks at."""

    until: float  # s
    point: Point  # m, world
    come: float  # s before `at`
    go: float  # s after `until`
    link: str  # that reaches or looks


@dataclass(frozen=True)
class StrengthEntry(Entry):
    """The strength of joints, 0 to 1."""

    until: float  # s
    strength: float
    joints: tuple[str, ...]  # none: all


@dataclass(frozen=True)
class BehaviourEntry(Entry):
    """What the behaviour is asked for."""

    until: float | None  # s; None: until the next one begins, or the end
    ask: str


@dataclass(frozen=True)
class PushEntry(Entry):
    """A force on a link's centre of mass."""

    link: str
    force: Point  # N, world
    duration: float | None  # s; None: the simulator's `wrench_duration`


@dataclass(frozen=True)
class PinEntry(Entry):
    """A link's origin that is held to a point in the world."""

    until: float  # s
    link: str
    point: Point | None  # m, world; None: where the motion has the link at the time
    force: float  # N, the largest


@dataclass(frozen=True)
class ThrowEntry(Entry):
    """A ball or a box that hits a link at the time, as `run --throw` has it."""

    request: Mapping[str, object]


@dataclass(frozen=True)
class Timeline:
    """All tracks of a file."""

    file: Path
    character: str
    duration: float | None  # s; None: until all of it is over
    run: Mapping[str, object]  # planner, behaviour
    settings: Mapping[str, Mapping[str, object]]  # parameters by node
    layers: tuple[Layer, ...]
    clips: tuple[ClipEntry, ...]
    steering: tuple[SteeringEntry, ...]
    reaches: tuple[TargetEntry, ...]
    looks: tuple[TargetEntry, ...]
    strengths: tuple[StrengthEntry, ...]
    pushes: tuple[PushEntry, ...]
    pins: tuple[PinEntry, ...]
    throws: tuple[ThrowEntry, ...]
    behaviours: tuple[BehaviourEntry, ...]
