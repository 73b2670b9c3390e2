"""Measures recordings: errors and efforts over time, pushes, contacts, and the figures of a run."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.pins import own_pushes, pin_forces
from actuated_characters.bags.recording import Recording, Wrenches
from actuated_characters.metrics.error_measures import (
    AT_LIMIT,
    centre_path,
    distances,
    follows_state,
)
from actuated_characters.metrics.falls import reader_for
from actuated_characters.metrics.run_metrics import Measurement, Series, Tick
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.model import Character
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.configuration import RunConfiguration
from msgs_config.messages.state import StampedReference, StampedState
from msgs_config.messages.wrenches import WrenchArrays


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
    """The links in contact in each of t ticks, and the vertical force on all of them."""

    links: tuple[str, ...]  # (l,) those with a contact in any tick, in the character's order
    touching: BoolArray  # (t, l)
    vertical_force: FloatArray  # (t,) N, sum over links; NaN in ticks that were not recorded


def tracking_errors(recording: Recording) -> FloatArray:
    """Distance (t + 1, b) of each vector from its reference, rad or m.

    NaN without a reference, or where the reference is made of the state: see `follows_state`.
    """
    layout, position = recording.layout, recording.position
    errors = distances(layout, position, recording.reference_position)
    begins = np.zeros(len(position), dtype=np.bool_)
    begins[recording.episode_rows] = True
    moved = distances(layout, np.vstack((position[:1], position[:-1])), position)
    before = np.zeros(errors.shape[1], dtype=np.bool_)
    errors[follows_state(errors, moved, before, begins)] = np.nan
    return errors


def saturated_shares(shares: FloatArray) -> FloatArray:
    """Share (b,) of the ticks in which each vector was at its limit; NaN without ticks.

    `shares` (t, b) are those of the limits, see `limit_shares`.
    """
    count = (~np.isnan(shares)).sum(axis=0)
    unknown = np.full(len(count), np.nan)
    result: FloatArray = np.divide(
        (shares >= AT_LIMIT).sum(axis=0), count, out=unknown, where=count > 0
    )
    return result


def push_spans(recording: Recording) -> list[PushSpan]:
    """The pushes that acted: one for each sequence of ticks in which a link was pushed."""
    return _spans(recording, own_pushes)


def pin_spans(recording: Recording) -> list[PushSpan]:
    """The pins that acted: one for each sequence of ticks in which a link was held."""
    return _spans(recording, pin_forces)


def _spans(
    recording: Recording, acting: Callable[[Recording, int], WrenchArrays | None]
) -> list[PushSpan]:
    forces: dict[str, dict[int, FloatArray]] = {}  # N, by link and tick
    for tick in range(len(recording.applied_wrench)):
        if (wrenches := acting(recording, tick)) is not None:
            for link, wrench in zip(wrenches.links, wrenches.wrenches, strict=True):
                by_tick = forces.setdefault(link, {})
                by_tick[tick] = by_tick.get(tick, np.zeros(3)) + wrench[:3]
    spans = []
    for link, by_tick in forces.items():
        period = 1.0 / int(recording.parameters["rate"])
        ticks, applied = np.array(list(by_tick)), np.array(list(by_tick.values()))
        begins = np.flatnonzero(np.diff(ticks, prepend=-2) > 1)
        for begin, end in zip(begins, np.append(begins[1:], len(ticks)), strict=True):
            push = applied[begin:end]
            largest = float(np.linalg.norm(push, axis=1).max())
            impulse = float(np.linalg.norm(push.sum(axis=0))) * period
            start = float(recording.times[ticks[begin]])
            spans.append(PushSpan(link, start, len(push) * period, largest, impulse))
    return sorted(spans, key=lambda span: span.start)


def contact_series(character: Character, contacts: Wrenches) -> ContactSeries | None:
    """The contacts of t ticks as arrays; None if the recording has none of any tick."""
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


def gravities(recording: Recording) -> FloatArray:
    """Gravity (t,) in each tick, m/s^2; NaN where it is not known."""
    begins, found = recording.episode_rows.tolist(), np.full(len(recording.effort), np.nan)
    for row in begins:
        found[row:] = float(recording.parameters_at(row).get("gravity", np.nan))
    return found


def plan_errors(recording: Recording) -> dict[float, FloatArray]:
    """Distance of the centre of mass from where a planner's plans had predicted it.

    By the time ahead in s: errors in m of all plans, most of which others replaced before.
    """
    rate = int(recording.parameters["rate"])
    ends = np.append(recording.episode_rows[1:], len(recording.times))
    ahead, rows, predicted = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)], [np.zeros((0, 3))]
    for plan in recording.plans:
        first = int(np.searchsorted(recording.stamps_ns, plan.stamp_ns))
        ticks = np.round(plan.times * rate).astype(np.intp)
        within = first + ticks < ends[np.searchsorted(ends, first, side="right")]
        within &= ticks > 0  # a policy says no more than where the character is
        ahead.append(ticks[within])
        rows.append(first + ticks[within])
        predicted.append(plan.centres[within])
    path = centre_path(recording.character, recording.position[np.concatenate(rows)])
    errors = np.linalg.norm(np.concatenate(predicted) - path, axis=1)
    at = np.concatenate(ahead)
    return {ticks / rate: errors[at == ticks] for ticks in np.unique(at).tolist()}


def measure_recording(recording: Recording) -> tuple[dict[str, object], Series]:
    """The figures of a run and its series, as a recorder measures them: see `Measurement`."""
    character = recording.character
    measurement = Measurement(
        RunConfiguration(
            character=character.name,
            layout=character.layout,
            effort_limits=character.effort_limits(),
            mass=character.mass,
            parameters=dict(recording.parameters),
        ),
        reader_for(character, recording.world.terrain),
    )
    for later in recording.simulator:
        measurement.change(later.parameters)
    for change in recording.modes:
        measurement.add_mode(change.stamp_ns, change.mode)
    before: StampedState | None = None
    for row, state in enumerate(_states(recording)):
        measurement.add_state(state)
        if before is not None and state.effort is not None:
            measurement.add_tick(Tick(before, state, _reference(recording, row - 1)))
        before = state
    wall_ns = int(recording.published_ns[-1] - recording.published_ns[0])
    wall_time = wall_ns / NANOSECONDS_PER_SECOND if recording.has_wall_times else None
    return measurement.summary(wall_time), measurement.series()


def fall_time(recording: Recording) -> float | None:
    """When the character of a recording fell, s since its first state; None if it did not."""
    time = measure_recording(recording)[0]["fell_at_s"]
    assert time is None or isinstance(time, float)
    return time


def has_fallen(recording: Recording) -> bool:
    """Whether the character of a recording fell."""
    return fall_time(recording) is not None


def _states(recording: Recording) -> Iterator[StampedState]:
    first_rows = set(recording.episode_rows.tolist())
    for row, stamp in enumerate(recording.stamps_ns.tolist()):
        effort = None if row in first_rows else recording.effort[row - 1]
        yield StampedState(stamp, recording.position[row], recording.velocity[row], effort)


def _reference(recording: Recording, row: int) -> StampedReference | None:
    position = recording.reference_position[row]
    if np.isnan(position).all():
        return None
    stamp, velocity = int(recording.stamps_ns[row]), recording.reference_velocity[row]
    return StampedReference(stamp, position, velocity)
