"""What can be measured in a recording: errors, efforts, pushes and contacts over time."""

from collections.abc import Sequence, Set
from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.recording import Recording, Wrenches
from actuated_characters.metrics.run_metrics import Measurement, Tick
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.configuration import RunConfiguration
from msgs_config.messages.state import StampedReference, StampedState

_BLOCK = 8192  # rows that are worked on together, so that long recordings need no more memory
_AT_LIMIT = 1.0 - 1e-9

_EFFORT_UNITS = {"rad": "N m", "m": "N"}


@dataclass(frozen=True)
class Vectors:
    """The physical vectors of a layout: joints, and the root's translation and rotation."""

    names: tuple[str, ...]  # (b,)
    units: tuple[str, ...]  # (b,) "rad" or "m", of the position
    limits: FloatArray  # (b,) N m or N
    actuated: BoolArray  # (b,) all but the root's

    @property
    def effort_units(self) -> tuple[str, ...]:
        """Units (b,) of the efforts: "N m" or "N"."""
        return tuple(_EFFORT_UNITS[unit] for unit in self.units)


@dataclass(frozen=True)
class PushSpan:
    """A push on a link over ticks that follow each other."""

    link: str
    start: float  # s since the first state
    duration: float  # s
    largest_force: float  # N
    impulse: float  # N s, length of the force's integral


@dataclass(frozen=True)
class ContactSeries:
    """Which links touched something in each of t ticks, and what the ground bore."""

    links: tuple[str, ...]  # (l,) those that ever touched, in the character's order
    touching: BoolArray  # (t, l)
    vertical_force: FloatArray  # (t,) N, of all links together; NaN where nothing was said


def vectors_of(character: Character) -> Vectors:
    """Names, units and limits of a character's vectors, in the layout's order."""
    units: list[str] = []
    actuated: list[bool] = []
    for joint in character.layout.joints:
        floating = joint.type is JointType.FLOATING
        turns = joint.type in (JointType.REVOLUTE, JointType.SPHERICAL)
        units += ["m", "rad"] if floating else ["rad" if turns else "m"]
        actuated += [not floating] * len(joint.vectors)
    return Vectors(
        tuple(character.vector_names),
        tuple(units),
        character.effort_limits(),
        np.array(actuated, dtype=np.bool_),
    )


def tracking_errors(recording: Recording) -> FloatArray:
    """Distance (t + 1, b) of each vector from its reference, rad or m; NaN without a reference.

    Rotations are compared as rotations.
    """
    return distances(recording, recording.position, recording.reference_position)


def distances(recording: Recording, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distance (r, b) of each vector between two positions (r, n) of a layout, rad or m."""
    layout = recording.layout
    result = np.full((len(start), len(layout.vector_starts)), np.nan)
    if not layout.size:
        return result
    for first in range(0, len(start), _BLOCK):
        rows = slice(first, first + _BLOCK)
        difference = layout.difference(
            layout.configuration(start[rows]), layout.configuration(end[rows])
        )
        result[rows] = layout.norms(difference)
    return result


def effort_sizes(recording: Recording) -> FloatArray:
    """Length (t, b) of each vector's effort, N m or N; NaN in a tick that was a reset."""
    if not recording.layout.size:
        return np.zeros((len(recording.effort), 0))
    return recording.layout.norms(recording.effort)


def limit_shares(sizes: FloatArray, limits: FloatArray) -> FloatArray:
    """Efforts (t, b) over their limits (b,); 0 where there is no limit, 1 where that is 0."""
    shares = np.divide(sizes, limits, out=np.ones_like(sizes), where=limits > 0.0)
    shares[np.isnan(sizes)] = np.nan
    return shares


def saturated_shares(shares: FloatArray) -> FloatArray:
    """In what share (b,) of the ticks each vector was at its limit; NaN without ticks."""
    known = ~np.isnan(shares)
    count = known.sum(axis=0)
    at_limit = (known & (shares >= _AT_LIMIT)).sum(axis=0)
    unknown = np.full(len(count), np.nan)
    result: FloatArray = np.divide(at_limit, count, out=unknown, where=count > 0)
    return result


def reset_rows(recording: Recording) -> IntArray:
    """Rows of the first states of all episodes but the first."""
    return recording.episode_rows[1:]


def push_spans(recording: Recording) -> list[PushSpan]:
    """The pushes that acted, one for each run of ticks in which a link was pushed."""
    period = 1.0 / int(recording.parameters["rate"])
    open_since: dict[str, tuple[int, list[FloatArray]]] = {}
    spans: list[PushSpan] = []

    def close(link: str) -> None:
        first, forces = open_since.pop(link)
        all_forces = np.array(forces)
        spans.append(
            PushSpan(
                link=link,
                start=float(recording.times[first]),
                duration=len(forces) * period,
                largest_force=float(np.linalg.norm(all_forces, axis=1).max()),
                impulse=float(np.linalg.norm(all_forces.sum(axis=0))) * period,
            )
        )

    for tick, wrenches in enumerate(recording.applied_wrench):
        forces = {} if wrenches is None else _forces(wrenches.links, wrenches.wrenches)
        for link in [link for link in open_since if link not in forces]:
            close(link)
        for link, force in forces.items():
            open_since.setdefault(link, (tick, []))[1].append(force)
    for link in list(open_since):
        close(link)
    return sorted(spans, key=lambda span: span.start)


def _forces(links: Sequence[str], wrenches: FloatArray) -> dict[str, FloatArray]:
    """Total force (3,) on each link, N."""
    forces: dict[str, FloatArray] = {}
    for link, wrench in zip(links, wrenches, strict=True):
        forces[link] = forces.get(link, np.zeros(3)) + wrench[:3]
    return forces


def contact_series(character: Character, contacts: Wrenches) -> ContactSeries | None:
    """What touched when; None if the recording has no contacts."""
    if not contacts:
        return None
    column = {link.name: number for number, link in enumerate(character.links)}
    touching = np.zeros((len(contacts), len(column)), dtype=np.bool_)
    vertical = np.full(len(contacts), np.nan)
    for tick, wrenches in enumerate(contacts):
        if wrenches is not None:
            vertical[tick] = wrenches.wrenches[:, 2].sum()
            touching[tick, [column[link] for link in wrenches.links if link in column]] = True
    ever = np.flatnonzero(touching.any(axis=0))
    names = tuple(character.links[number].name for number in ever)
    return ContactSeries(names, touching[:, ever], vertical)


def weight(recording: Recording) -> float:
    """The character's weight in N."""
    return recording.character.mass * float(recording.parameters.get("gravity", np.nan))


def measure_recording(recording: Recording) -> tuple[dict[str, object], FloatArray]:
    """The figures of a run and its series, as a recorder measures them: see `run_metrics`."""
    character = recording.character
    measurement = Measurement(
        RunConfiguration(
            character=character.name,
            layout=character.layout,
            effort_limits=character.effort_limits(),
            mass=character.mass,
            parameters=dict(recording.parameters),
        )
    )
    first_rows = set(recording.episode_rows.tolist())
    state = _state(recording, 0, first_rows)
    measurement.add_state(state)
    for row in range(len(recording.effort)):
        following = _state(recording, row + 1, first_rows)
        measurement.add_state(following)
        if following.effort is not None:
            measurement.add_tick(Tick(state, following, _reference(recording, row)))
        state = following
    wall_ns = int(recording.published_ns[-1] - recording.published_ns[0])
    return measurement.summary(wall_ns / NANOSECONDS_PER_SECOND), measurement.series()


def _state(recording: Recording, row: int, first_rows: Set[int]) -> StampedState:
    return StampedState(
        int(recording.stamps_ns[row]),
        recording.position[row],
        recording.velocity[row],
        None if row in first_rows else recording.effort[row - 1],
    )


def _reference(recording: Recording, row: int) -> StampedReference | None:
    position = recording.reference_position[row]
    if np.isnan(position).all():
        return None
    return StampedReference(
        int(recording.stamps_ns[row]), position, recording.reference_velocity[row]
    )
