"""What differs between what was recorded and what has come of it again."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout, JointType
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.projectiles import BallStates
from msgs_config.messages.wrenches import WrenchArrays

POSITION, VELOCITY, EFFORT = "position", "velocity", "effort"

_UNITS = {POSITION: ("rad", "m"), VELOCITY: ("rad/s", "m/s"), EFFORT: ("N m", "N")}
_WRENCH = tuple(f"{axis} of the contact {part}" for part in ("force", "torque") for axis in "xyz")
_MOTION = (
    *(f"{axis} in m" for axis in "xyz"),
    *(f"{axis} of the orientation" for axis in "xyzw"),
    *(f"{axis} of the velocity in m/s" for axis in "xyz"),
    *(f"{axis} of the angular velocity in rad/s" for axis in "xyz"),
)


@dataclass(frozen=True)
class Difference:
    """The first thing that is not what it was; `str` of it is one line."""

    tick: int  # of the message in which it stands
    stamp_ns: int  # likewise
    quantity: str  # such as "position"
    name: str  # the degree of freedom or the link
    recorded: float
    found: float  # the second time
    sentence: str  # what is said of it, without tick and character
    character: str = ""  # `Recording.name`

    @property
    def apart(self) -> float:
        """By how much they differ, in their unit; 0 for what differs in the sign of zero alone."""
        return self.found - self.recorded

    def __str__(self) -> str:
        of = f" of {self.character}" if self.character else ""
        seconds = self.stamp_ns / NANOSECONDS_PER_SECOND
        return f"tick {self.tick}{of} ({seconds:.9f} s): {self.sentence}"


@dataclass(frozen=True)
class ReplayResult:
    """What has come of a replay."""

    difference: Difference | None  # the first one, None if all is identical or within tolerance
    states: int  # that were compared, of each character
    episodes: int
    state_hashes: Mapping[str, str]  # of the states that have come, by `Recording.name`
    largest: Mapping[str, float] = field(default_factory=dict)  # differences by unit
    notes: Sequence[str] = ()  # what could not be compared, and why

    @property
    def identical(self) -> bool:
        """Whether nothing differs, or nothing by more than the tolerance."""
        return self.difference is None


def same_bits(one: FloatArray, other: FloatArray) -> bool:
    """Whether two arrays are the same doubles: -0.0 is not 0.0, and NaN is itself."""
    return one.tobytes() == other.tobytes()


def differing(one: FloatArray, other: FloatArray) -> list[int]:
    """Indices of the entries (n,) whose bits differ."""
    bits = (np.ascontiguousarray(values).view(np.int64) for values in (one, other))
    return np.flatnonzero(np.not_equal(*bits)).tolist()


def unit_of(layout: JointLayout, index: int, quantity: str) -> str:
    """The unit of a degree of freedom's position, velocity or effort."""
    joint = next(j for j in layout.joints if j.entries.start <= index < j.entries.stop)
    floating = joint.type is JointType.FLOATING and index < joint.start + 3
    return _UNITS[quantity][joint.type is JointType.PRISMATIC or floating]


def compare_states(
    layout: JointLayout,
    tick: int,
    stamp_ns: int,
    recorded: tuple[FloatArray, FloatArray],
    found: tuple[FloatArray, FloatArray],
    character: str = "",
) -> Difference | None:
    """The first entry of position and velocity (n,) whose bits differ, None if there is none."""
    for quantity, before, now in zip((POSITION, VELOCITY), recorded, found, strict=True):
        if not same_bits(before, now):
            index = differing(before, now)[0]
            return state_difference(layout, tick, stamp_ns, quantity, index, before, now, character)
    return None


def state_difference(
    layout: JointLayout,
    tick: int,
    stamp_ns: int,
    quantity: str,
    index: int,
    recorded: FloatArray,
    found: FloatArray,
    character: str = "",
) -> Difference:
    """A difference of one entry of positions or velocities (n,)."""
    name, unit = layout.dof_names[index], unit_of(layout, index, quantity)
    before, now = float(recorded[index]), float(found[index])
    apart = float(differences(layout, quantity, recorded, found)[index])
    sentence = (
        f"{quantity} of '{name}' was {before!r} {unit} in the recording and is {now!r} {unit} now: "
        f"{apart:.3g} {unit} apart"
    )
    return Difference(tick, stamp_ns, quantity, name, before, now, sentence, character)


def differences(
    layout: JointLayout, quantity: str, recorded: FloatArray, found: FloatArray
) -> FloatArray:
    """From what was recorded to what is found (..., n); positions' rotations as rotations."""
    if quantity != POSITION:
        difference: FloatArray = found - recorded
        return difference
    return layout.difference(layout.configuration(recorded), layout.configuration(found))


def compare_contacts(
    tick: int, recorded: WrenchArrays, found: WrenchArrays, character: str = ""
) -> Difference | None:
    """The first link whose contact is another one, None if there is none."""

    def difference(link: str, what: str, before: float, now: float) -> Difference:
        sentence = f"{what} on '{link}' was {before!r} in the recording and is {now!r} now"
        return Difference(
            tick, recorded.stamp_ns, "contact", link, before, now, sentence, character
        )

    for link in recorded.links + found.links:
        touched = link in recorded.links, link in found.links
        if touched[0] != touched[1]:
            return difference(link, "the number of contacts", *(float(each) for each in touched))
    for row, link in enumerate(recorded.links):
        before, now = recorded.wrenches[row], found.wrenches[found.links.index(link)]
        if not np.array_equal(before, now):
            axis = int(np.argmax(before != now))
            return difference(link, _WRENCH[axis], float(before[axis]), float(now[axis]))
    return None


def compare_balls(tick: int, recorded: BallStates, found: FloatArray) -> Difference | None:
    """The first ball that moves otherwise (m, 13), or is not there; None if there is none."""
    count = len(recorded.motion)
    if count != len(found):
        sentence = f"there were {count} balls in the recording and are {len(found)} now"
        return Difference(
            tick, recorded.stamp_ns, "ball", "", float(count), float(len(found)), sentence
        )
    if same_bits(recorded.motion, found):
        return None
    index = differing(recorded.motion.ravel(), found.ravel())[0]
    name, what = recorded.names[index // len(_MOTION)], _MOTION[index % len(_MOTION)]
    before, now = float(recorded.motion.flat[index]), float(found.flat[index])
    sentence = f"'{name}': {what} was {before!r} in the recording and is {now!r} now"
    return Difference(tick, recorded.stamp_ns, "ball", name, before, now, sentence)
