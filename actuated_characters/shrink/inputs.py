"""The inputs of a recorded run one by one, each of which can be left out or made smaller.

A row is that of a state, the first one being 0; a stop is as those of a fork: what is sent in that
of row r counts from row r on, or from the stamp that it has itself.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any, TypeAlias

from actuated_characters.runs.planned.pins import PlannedPin
from actuated_characters.runs.planned.throws import PlannedThrow
from actuated_characters.runs.planned.velocities import PlannedVelocity
from actuated_characters.runs.planned.wrenches import PlannedPush

STEER = "--cmd-vel "
"""Begins the description of a velocity."""
_DIGITS = 12  # of the numbers of what was made smaller
_LEAST_MASS = 1e-3  # kg, of a throw


@dataclass(frozen=True)
class Setting:
    """A change of a parameter of the controller."""

    name: str
    value: Any


@dataclass(frozen=True)
class Request:
    """A serialised message of something else that the controller was asked for."""

    topic: str
    raw: bytes


Content: TypeAlias = PlannedPush | PlannedPin | PlannedThrow | PlannedVelocity | Setting | Request


@dataclass(frozen=True)
class Event:
    """What is sent in a stop."""

    stop: int
    content: Content


@dataclass(frozen=True)
class Input(ABC):
    """An input of a run; a size is 1 as it was, 0 if it is left out."""

    row: int  # from whose state on it counts
    rate_hz: int

    is_scalable = True  # whether it has a size between
    can_be_left_out = True

    @property
    def time(self) -> float:
        """Of that state since the first one, s."""
        return self.row / self.rate_hz

    @abstractmethod
    def events(self, size: float) -> Sequence[Event]:
        """What is sent of it."""

    @abstractmethod
    def describe(self, size: float) -> str:
        """What it is, as an option of `run` where that can say it."""


@dataclass(frozen=True)
class PushInput(Input):
    """A push, or several equal ones without a gap; its size is that of force and torque."""

    pushes: Sequence[tuple[int, PlannedPush]]  # rows, and what begins in their ticks
    is_at_centre: bool  # of mass

    def events(self, size: float) -> Sequence[Event]:
        """Each push in the stop before its tick is stepped."""
        if not size:
            return ()
        return [
            Event(row + 1, replace(push, wrench=_scaled(push.wrench, size)))
            for row, push in self.pushes
        ]

    def describe(self, size: float) -> str:
        """The options, or words where there is a torque or another point."""
        _, push = self.pushes[0]
        wrench = _scaled(push.wrench, size)
        force = _listed(wrench[:3])
        if not any(wrench[3:]) and self.is_at_centre:
            times = (row / self.rate_hz for row, _ in self.pushes)
            return " ".join(f"--push {push.link}:{force}@{_seconds(time)}" for time in times)
        torque = f", torque {_listed(wrench[3:])} N m" if any(wrench[3:]) else ""
        point = _listed(push.point or ())
        count = f"{len(self.pushes)} times " if len(self.pushes) > 1 else ""
        return (
            f"push on '{push.link}' at {_seconds(self.time)} s {count}of {force} N{torque} at the "
            f"link's point {point} m"
        )


@dataclass(frozen=True)
class ThrowInput(Input):
    """A ball or box; its size is that of its mass, without which it flies the same way."""

    planned: PlannedThrow

    def events(self, size: float) -> Sequence[Event]:
        """The throw in the stop before its tick is stepped."""
        return [Event(self.row + 1, self._of(size))] if size else ()

    def _of(self, size: float) -> PlannedThrow:
        throw = self.planned.throw
        (mass,) = _scaled((throw.mass,), size)
        return replace(self.planned, throw=replace(throw, mass=max(mass, _LEAST_MASS)))

    def describe(self, size: float) -> str:
        """Words: an option of `run` says where it is to hit, not where it is let go."""
        throw = self._of(size).throw
        return (
            f"{throw.describe()} of {_number(throw.mass)} kg, let go at {_seconds(self.time)} s at "
            f"{_listed(throw.position)} m with {_listed(throw.velocity)} m/s"
        )


@dataclass(frozen=True)
class VelocityInput(Input):
    """A commanded velocity, as often as it was repeated; left out it is that of a stop.

    One that is a stop itself is always sent.
    """

    sent: Sequence[tuple[int, PlannedVelocity]]  # stops, and what is sent in them

    @property
    def can_be_left_out(self) -> bool:  # type: ignore[override]
        """Whether it is no stop."""
        return any(_numbers(self.sent[0][1]))

    def events(self, size: float) -> Sequence[Event]:
        """Each message in the stop in which it was sent."""
        return [Event(stop, _slower(velocity, size)) for stop, velocity in self.sent]

    def describe(self, size: float) -> str:
        """What `--cmd-vel` has of it."""
        velocity = _listed(_numbers(_slower(self.sent[0][1], size)))
        return f"{STEER}{velocity}@{_seconds(self.time)}"


@dataclass(frozen=True)
class SettingInput(Input):
    """A change of one of the controller's parameters; its size is the share of the change."""

    name: str
    before: Any
    value: Any

    @property
    def is_scalable(self) -> bool:  # type: ignore[override]
        """Whether it changes finite numbers, which have others between them."""
        before, value = _entries(self.before), _entries(self.value)
        return _are_numbers([*before, *value]) and len(before) == len(value)

    def events(self, size: float) -> Sequence[Event]:
        """The change in the stop before the answer from which on it counts."""
        return [Event(self.row, Setting(self.name, self._value(size)))] if size else ()

    def _value(self, size: float) -> Any:
        if size == 1.0:
            return self.value
        between = [
            _short(begin + size * (end - begin))
            for begin, end in zip(_entries(self.before), _entries(self.value), strict=True)
        ]
        if isinstance(self.value, list):
            return between
        return round(between[0]) if isinstance(self.value, int) else between[0]

    def describe(self, size: float) -> str:
        """Words; the assignment is as `--set` has it."""
        value = self._value(size)
        return (
            f"controller_node.{self.name}:={value} from {_seconds(self.time)} s on "
            f"(before: {self.before})"
        )


@dataclass(frozen=True)
class PinInput(Input):
    """A link that is held, or let go; its size is that of the largest force."""

    pin: PlannedPin

    @property
    def can_be_left_out(self) -> bool:  # type: ignore[override]
        """Whether it holds: to let go of what is not held is nothing."""
        return self.pin.force > 0.0

    def events(self, size: float) -> Sequence[Event]:
        """The pin in the stop before its tick is stepped."""
        if not size and self.can_be_left_out:
            return ()
        (force,) = _scaled((self.pin.force,), size if self.can_be_left_out else 1.0)
        return [Event(self.row + 1, replace(self.pin, force=force))]

    def describe(self, size: float) -> str:
        """Words."""
        (force,) = _scaled((self.pin.force,), size)
        place = _listed(self.pin.place)
        return (
            f"pin of '{self.pin.link}' at {place} m with {_number(force)} N from "
            f"{_seconds(self.time)} s on"
        )


@dataclass(frozen=True)
class RequestInput(Input):
    """A trajectory, strengths or a behaviour that the controller was asked for."""

    request: Request

    is_scalable = False

    def events(self, size: float) -> Sequence[Event]:
        """The message in the stop in which it was sent."""
        return [Event(self.row, self.request)] if size else ()

    def describe(self, size: float) -> str:
        """Words."""
        del size
        return f"message on '{self.request.topic}' at {_seconds(self.time)} s"


def without_needless_stops(events: Iterable[Event]) -> list[Event]:
    """Events without commands to stop that come after another one, or before any velocity."""
    kept, stands = [], True
    for event in events:
        if isinstance(event.content, PlannedVelocity):
            stops = not any(_numbers(event.content))
            if stops and stands:
                continue
            stands = stops
        kept.append(event)
    return kept


def velocity_inputs(
    sent: Sequence[tuple[int, PlannedVelocity]], row_of: dict[int, int], rate_hz: int
) -> list[VelocityInput]:
    """The velocities that were sent in stops; one that was repeated is one input.

    `row_of` are the rows of their stamps.
    """
    found = []
    for _, group in groupby(sent, key=lambda each: _numbers(each[1])):
        repeated = list(group)
        row = row_of[repeated[0][1].stamp_ns]
        found.append(VelocityInput(row, rate_hz, repeated))
    return found


def _numbers(velocity: PlannedVelocity) -> tuple[float, float, float]:
    return velocity.forward, velocity.left, velocity.turn


def _slower(velocity: PlannedVelocity, size: float) -> PlannedVelocity:
    forward, left, turn = _scaled(_numbers(velocity), size)
    return replace(velocity, forward=forward, left=left, turn=turn)


def _scaled(values: Sequence[float], size: float) -> tuple[float, ...]:
    """Values of a size; a zero stays without a sign."""
    return tuple(values) if size == 1.0 else tuple(_short(size * each) for each in values)


def _short(value: float) -> float:
    """A value without the last digits of a product, so that it is short to write."""
    return float(f"{value:.{_DIGITS}g}") + 0.0


def _entries(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def _are_numbers(values: Sequence[Any]) -> bool:
    return all(
        isinstance(each, (int, float)) and not isinstance(each, bool) and math.isfinite(each)
        for each in values
    )


def _listed(values: Sequence[float]) -> str:
    return ",".join(map(_number, values))


def _number(value: float) -> str:
    """A number in as few digits as stand for its bits."""
    return repr(float(value)).removesuffix(".0")


def _seconds(time: float) -> str:
    """A time of a tick, to a tenth of a millisecond."""
    return _number(round(time, 4))
