"""Joint states of any publisher as rows over time: merged, in order, and by the layout's names."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from actuated_characters.bags.robots.decoding import Timed, stamp_ns
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.errors import RecordingError

_MOST_BACK_NS = 1_000_000_000  # how far stamps may go back where several nodes publish on one topic
_NAMES_SHOWN = 6
_BEYOND_A_TURN = 1e-3  # rad: how far beyond -pi and pi an angle may be that was wrapped


@dataclass(frozen=True)
class JointSeries:
    """The states (r, n) of a robot in the order of its layout, each a row; NaN is not known."""

    stamps_ns: IntArray  # (r,) rising; of the headers, or log times where those cannot be used
    log_times_ns: IntArray  # (r,)
    published_ns: IntArray  # (r,) wall time, as far as it is known
    has_wall_times: bool
    position: FloatArray  # (r, n) rad, m
    velocity: FloatArray  # (r, n) rad/s, m/s
    effort: FloatArray  # (r, n) N m, N
    remarks: tuple[str, ...] = field(default=(), repr=False)


@dataclass(frozen=True)
class _Sample:
    stamp_ns: int
    timed: Timed


def collect_joints(topic: str, messages: Iterable[Timed], character: Character) -> JointSeries:
    """Merge JointState messages, of which each may have other joints, into the robot's states.

    A joint keeps its last value until the next message that has it, and has its first one before.
    Joints that no message has stay at rest, or follow theirs if they are `<mimic>` joints.

    Raises:
        RecordingError: there is no message, or none has positions or a joint of the robot.
    """
    samples = [_Sample(stamp_ns(each.content.header), each) for each in messages]
    if not samples:
        raise RecordingError(f"there is no message on '{topic}'")
    ordered, clock_remark = _in_order(topic, samples)
    names = character.layout.dof_names
    filled = _Rows(names)
    for sample in ordered:
        filled.add(sample)
    if filled.is_empty:
        raise RecordingError(f"no message on '{topic}' has the positions of its joints")
    remarks = [clock_remark] if clock_remark else []
    remarks += _describe_names(topic, filled.named, character)
    if filled.uneven:
        remarks.append(
            f"{filled.uneven} of {len(samples)} messages on '{topic}' have other numbers of names "
            "and positions, and are left out"
        )
    return _completed(filled.finish(tuple(remarks)), character)


def _in_order(topic: str, samples: Sequence[_Sample]) -> tuple[list[_Sample], str]:
    """The messages by their stamps, or by log time where those cannot be used; and a remark."""
    stamps = np.array([sample.stamp_ns for sample in samples])
    if not stamps.all():
        why = "are not set"
    elif len(stamps) > 1 and np.diff(stamps).min() < -_MOST_BACK_NS:
        why = "go back in time"
    else:
        return sorted(samples, key=lambda sample: sample.stamp_ns), ""
    by_log = [_Sample(sample.timed.log_time_ns, sample.timed) for sample in samples]
    remark = f"stamps on '{topic}' {why}; the times are those at which messages were recorded"
    return by_log, remark


class _Rows:
    """States that grow; messages of one stamp are one row."""

    def __init__(self, names: Sequence[str]) -> None:
        self._column = {name: number for number, name in enumerate(names)}
        self._size = len(names)
        self._stamps: list[tuple[int, int, int | None]] = []
        self._rows: list[FloatArray] = []  # (3, n) each: position, velocity, effort
        self._places: dict[tuple[str, ...], tuple[IntArray, IntArray]] = {}
        self.named: dict[str, None] = {}
        """All names that messages have, in the order in which they came."""
        self.uneven = 0
        """Messages whose names and positions are not as many."""

    @property
    def is_empty(self) -> bool:
        """Whether no message had positions."""
        return not self._rows

    def add(self, sample: _Sample) -> None:
        """Add a message, not older than those before."""
        message, names = sample.timed.content, tuple(sample.timed.content.name)
        if len(message.position) != len(names):
            self.uneven += bool(len(message.position))  # some have efforts, but no positions
            return
        columns, entries = self._place(names)
        again = bool(self._stamps) and self._stamps[-1][0] == sample.stamp_ns
        before = self._rows[-1] if self._rows else np.full((3, self._size), np.nan)
        row = before if again else before.copy()
        for quantity, given in enumerate((message.position, message.velocity, message.effort)):
            if len(given) == len(names):
                values = np.asarray(given, dtype=np.float64)[entries]
                known = np.isfinite(values)
                row[quantity, columns[known]] = values[known]
        if not again:
            self._rows.append(row)
            timed = sample.timed
            self._stamps.append((sample.stamp_ns, timed.log_time_ns, timed.published_ns))

    def _place(self, names: tuple[str, ...]) -> tuple[IntArray, IntArray]:
        """Columns of the joints that there are, and their entries in the message."""
        if names not in self._places:
            self.named |= dict.fromkeys(names)
            entries = [entry for entry, name in enumerate(names) if name in self._column]
            columns = [self._column[names[entry]] for entry in entries]
            self._places[names] = np.array(columns, np.intp), np.array(entries, np.intp)
        return self._places[names]

    def finish(self, remarks: tuple[str, ...]) -> JointSeries:
        """All rows."""
        position, velocity, effort = np.array(self._rows).reshape(-1, 3, self._size).swapaxes(0, 1)
        stamps, logged, published = zip(*self._stamps, strict=True)
        known = all(each is not None for each in published)
        return JointSeries(
            np.array(stamps, dtype=np.intp),
            np.array(logged, dtype=np.intp),
            np.array(published if known else logged, dtype=np.intp),
            known,
            position,
            velocity,
            effort,
            remarks,
        )


def _describe_names(topic: str, named: Mapping[str, None], character: Character) -> list[str]:
    """What the messages name beside the character's joints, and what they do not name.

    Raises:
        RecordingError: they name none of its joints.
    """
    known = set(character.layout.dof_names)
    of_root = character.layout.joints[0].dof_names if character.layout.has_floating_base else ()
    own = [name for name in character.layout.dof_names if name not in of_root]
    extra = [name for name in named if name not in known]
    if own and not set(named) & known:
        raise RecordingError(
            f"'{topic}' has none of the joints of {character.name}; it has {_listed(extra)}, and "
            f"the character {_listed(own)}"
        )
    missing = [name for name in own if name not in named and name not in character.leaders]
    remarks = []
    if extra:
        remarks.append(f"not joints of {character.name} that move, left out: {_listed(extra)}")
    if missing:
        remarks.append(f"not on '{topic}', at rest: {_listed(missing)}")
    return remarks


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _NAMES_SHOWN} more" if len(names) > _NAMES_SHOWN else ""
    return (", ".join(names[:_NAMES_SHOWN]) or "none") + more


def _completed(series: JointSeries, character: Character) -> JointSeries:
    """The series without unknown positions: from the first values, the leaders or the rest pose."""
    position, names = series.position, list(character.layout.dof_names)
    seen: BoolArray = np.asarray(np.isfinite(position).any(axis=0))
    for number in np.flatnonzero(seen).tolist():
        values = position[:, number]
        first = int(np.flatnonzero(np.isfinite(values))[0])
        values[:first] = values[first]
    rest = np.array(character.rest_position)
    position[:, ~seen] = rest[~seen]
    if character.coupling:
        followers = character.coupling.followers
        unseen = followers[~seen[followers]]
        position[:, unseen] = character.coupling.position(position)[:, unseen]
    for link in character.links:
        joint = link.joint
        if joint.type is JointType.REVOLUTE and joint.lower == -math.inf and joint.name in names:
            column = names.index(joint.name)
            position[:, column] = unwrapped(position[:, column])
    return series


def unwrapped(angles: FloatArray) -> FloatArray:
    """Angles (r,) in rad without jumps of a turn, where all of them are within -pi and pi.

    A wheel's angle that is published so goes on over its whole turns, and can be interpolated.
    """
    if np.abs(angles).max(initial=0.0) > math.pi + _BEYOND_A_TURN:
        return angles
    whole: FloatArray = np.unwrap(angles)
    return whole
