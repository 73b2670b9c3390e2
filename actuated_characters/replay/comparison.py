"""Compares states, contacts and balls with the recorded ones: to the last bit, or by a tolerance.

States are given as arrays by quantity, `States`. Row k is the state k of the recording; its effort
is the one that was applied in the tick before, NaN in an episode's first state.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics import error_measures
from actuated_characters.metrics.error_measures import different_bits
from actuated_characters.metrics.state_hash import hash_of_states
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout, JointType
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND, TickClock
from msgs_config.messages.projectiles import BallStates
from msgs_config.messages.wrenches import WrenchArrays
from msgs_config.shared_parameters import RATE

POSITION, VELOCITY, EFFORT = "position", "velocity", "effort"
QUANTITIES = (EFFORT, POSITION, VELOCITY)  # within a tick the effort comes first, as the cause

States: TypeAlias = Mapping[str, FloatArray]
"""Arrays (m, n) of m states of n degrees of freedom by quantity: rad, m, rad/s, m/s, N m, N."""

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
    """A number that is not the recorded one; `str` of it is one line."""

    tick: int  # tick of the message that has the number
    stamp_ns: int  # stamp of the message that has the number
    quantity: str  # such as "position"
    name: str  # name of the degree of freedom, link or ball
    recorded: float
    found: float  # the number in the replay
    sentence: str  # describes it, without tick and character
    character: str = ""  # `Recording.name`

    @property
    def apart(self) -> float:
        """`found - recorded`, in their unit; 0 for what differs in the sign of zero alone."""
        return self.found - self.recorded

    def __str__(self) -> str:
        of = f" of {self.character}" if self.character else ""
        seconds = self.stamp_ns / NANOSECONDS_PER_SECOND
        return f"tick {self.tick}{of} ({seconds:.9f} s): {self.sentence}"


@dataclass(frozen=True)
class ReplayResult:
    """The outcome of a replay."""

    difference: Difference | None  # the first one, None if all is identical or within tolerance
    states: int  # states of each character that were compared
    episodes: int
    state_hashes: Mapping[str, str]  # the replayed states' hashes by `Recording.name`
    largest: Mapping[str, float] = field(default_factory=dict)  # differences by unit
    remarks: Sequence[str] = ()  # what could not be compared, and why

    @property
    def identical(self) -> bool:
        """Whether nothing differs, or nothing by more than the tolerance."""
        return self.difference is None


def clock_of(recording: Recording) -> TickClock:
    """The clock of the recorded simulator."""
    return TickClock(int(recording.parameters[RATE.name]))


def first_tick_of(recording: Recording) -> int:
    """The tick of a recording's first state."""
    return clock_of(recording).tick(int(recording.stamps_ns[0]))


def same_bits(one: FloatArray, other: FloatArray) -> bool:
    """Whether two arrays are the same doubles: -0.0 is not 0.0, and NaN is itself."""
    return one.tobytes() == other.tobytes()


def unit_of(layout: JointLayout, index: int, quantity: str) -> str:
    """The unit of a degree of freedom's position, velocity or effort."""
    joint = next(j for j in layout.joints if j.entries.start <= index < j.entries.stop)
    floating = joint.type is JointType.FLOATING and index < joint.start + 3
    return _UNITS[quantity][joint.type is JointType.PRISMATIC or floating]


def compare_world(
    together: Sequence[Recording],
    found: Sequence[States],
    tolerance: float | None = None,
    remarks: Sequence[str] = (),
) -> ReplayResult:
    """Compare replayed states of the characters of a world with their recordings.

    Args:
        together: The recordings, which begin with the same state.
        found: The replayed states of each, the first one first.
        tolerance: Largest difference that is accepted, in rad, m, rad/s and m/s, of positions and
            velocities alone; None: every bit has to be the same, those of efforts too.
        remarks: Of the result.
    """
    count = min(len(states[POSITION]) for states in found)
    compared = QUANTITIES if tolerance is None else (POSITION, VELOCITY)
    pairs = [
        (recording, {each: states[each][:count] for each in compared if each in states})
        for recording, states in zip(together, found, strict=True)
    ]
    differences = [first_difference(*pair, tolerance=tolerance) for pair in pairs]
    return ReplayResult(
        difference=min(filter(None, differences), key=lambda each: each.tick, default=None),
        states=count,
        episodes=int((together[0].episode_rows < count).sum()),
        state_hashes={
            recording.name: hash_of_states(recording.stamps_ns, states[POSITION], states[VELOCITY])
            for recording, states in zip(together, found, strict=True)
        },
        largest={} if tolerance is None else _largest_differences(pairs),
        remarks=remarks,
    )


def first_difference(
    recording: Recording, found: States, *, first_row: int = 0, tolerance: float | None = None
) -> Difference | None:
    """The first state that is not the recorded one, None if there is none.

    Of that state it is the first degree of freedom whose bits differ; or with a `tolerance` (rad,
    m, rad/s, m/s) the one that is farthest from the recorded. Rotations are compared as rotations.

    Args:
        recording: What was recorded.
        found: The replayed states; quantities that are not there are not compared.
        first_row: Row in the recording of the first of them.
        tolerance: Largest difference that is accepted; None: every bit has to be the same.
    """
    differences = []
    for quantity, values in found.items():
        recorded = _values(recording, quantity, slice(first_row, first_row + len(values)))
        if quantity == EFFORT and not first_row and recording.keyframe is not None:
            values = np.concatenate((recorded[:1], values[1:]))  # its first state's is not in it
        if tolerance is None and same_bits(recorded, values):
            continue
        apart = _apart(recording.layout, quantity, recorded, values)
        beyond = np.abs(apart)  # NaN is beyond any tolerance
        differs = different_bits(recorded, values) if tolerance is None else ~(beyond <= tolerance)
        rows = np.flatnonzero(differs.any(axis=1))
        if len(rows):
            row = int(rows[0])
            entry = int(np.argmax((differs if tolerance is None else beyond)[row]))
            numbers = (float(array[row, entry]) for array in (recorded, values, apart))
            at = (first_row + row, entry)
            differences.append(_state_difference(recording, quantity, at, *numbers))
    return min(differences, key=lambda each: each.tick, default=None)


def _state_difference(
    recording: Recording,
    quantity: str,
    at: tuple[int, int],
    recorded: float,
    found: float,
    apart: float,
) -> Difference:
    """The difference of a number in a row and column of a recording."""
    row, entry = at
    name, unit = recording.layout.dof_names[entry], unit_of(recording.layout, entry, quantity)
    stamp_ns = int(recording.stamps_ns[row])
    sentence = (
        f"{quantity} of '{name}' was {recorded!r} {unit} in the recording and is {found!r} {unit} "
        f"now: {apart:.3g} {unit} apart"
    )
    tick = clock_of(recording).tick(stamp_ns)
    return Difference(tick, stamp_ns, quantity, name, recorded, found, sentence, recording.name)


def _values(recording: Recording, quantity: str, rows: slice) -> FloatArray:
    """A quantity (m, n) of some states as recorded; an effort is that of the tick before."""
    if quantity == EFFORT:
        first, end, _ = rows.indices(len(recording.position))
        efforts = recording.effort[max(first - 1, 0) : max(end - 1, 0)]
        nothing = np.full((int(first == 0 < end), recording.layout.size), np.nan)
        return np.concatenate((nothing, efforts))
    return recording.position[rows] if quantity == POSITION else recording.velocity[rows]


def _apart(
    layout: JointLayout, quantity: str, recorded: FloatArray, found: FloatArray
) -> FloatArray:
    """From what was recorded to what is found (m, n), in the quantity's units."""
    if quantity == POSITION:
        return error_measures.differences(layout, recorded, found)
    difference: FloatArray = found - recorded
    return difference


def _largest_differences(pairs: Sequence[tuple[Recording, States]]) -> dict[str, float]:
    """The largest difference of the first states of recordings, by its unit."""
    largest: dict[str, float] = {}
    for recording, found in pairs:
        layout = recording.layout
        for quantity, values in found.items():
            recorded = _values(recording, quantity, slice(len(values)))
            sizes = np.abs(_apart(layout, quantity, recorded, values)).max(axis=0, initial=0.0)
            for entry, size in enumerate(sizes.tolist()):
                unit = unit_of(layout, entry, quantity)
                largest[unit] = max(size, largest.get(unit, 0.0))
    return largest


def compare_contacts(
    tick: int, recorded: WrenchArrays, found: WrenchArrays, character: str = ""
) -> Difference | None:
    """The first link whose contact is another one, None if there is none."""

    def difference(link: str, what: str, before: float, now: float) -> Difference:
        sentence = f"{what} on '{link}' was {before!r} in the recording and is {now!r} now"
        stamp_ns = recorded.stamp_ns
        return Difference(tick, stamp_ns, "contact", link, before, now, sentence, character)

    if recorded.links == found.links and np.array_equal(recorded.wrenches, found.wrenches):
        return None
    for link in recorded.links + found.links:
        touched = link in recorded.links, link in found.links
        if touched[0] != touched[1]:
            return difference(link, "the number of contacts", *map(float, touched))
    for before, link in zip(recorded.wrenches, recorded.links, strict=True):
        now = found.wrenches[found.links.index(link)]
        if not np.array_equal(before, now):
            axis = int(np.argmax(before != now))
            return difference(link, _WRENCH[axis], float(before[axis]), float(now[axis]))
    return None


def compare_balls(tick: int, recorded: BallStates, found: FloatArray) -> Difference | None:
    """The first number of the balls' motion (m, 13) that differs, or their number; None if none."""
    name, before, now = "", float(len(recorded.motion)), float(len(found))
    sentence = f"there were {before:.0f} balls in the recording and are {now:.0f} now"
    if before == now:
        places = np.argwhere(different_bits(recorded.motion, found)).tolist()
        if not places:
            return None
        ball, column = places[0]
        name, before, now = (
            recorded.names[ball],
            *(float(motion[ball, column]) for motion in (recorded.motion, found)),
        )
        what = _MOTION[column]
        sentence = f"'{name}': {what} was {before!r} in the recording and is {now!r} now"
    return Difference(tick, recorded.stamp_ns, "ball", name, before, now, sentence)
