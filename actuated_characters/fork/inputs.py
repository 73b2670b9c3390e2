"""What a recorded run was sent, by the state in which its simulator waits until it is sent again.

A *stop* of row r is in the state of row r - 1, answered already: what changes there counts from
row r on. That of row 0 is before the first answer.
"""

from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from actuated_characters.bags.pins import own_pushes, pin_changes
from actuated_characters.bags.recording import Recording
from actuated_characters.replay.players.controller_parameters import (
    parameter_changes,
    reset_changes,
)
from actuated_characters.replay.world import (
    check_pushes,
    check_throws,
    simulator_values,
    wrenches_of,
)
from actuated_characters.runs.planned.behaviours import PlannedBehaviour
from actuated_characters.runs.planned.pins import PlannedPin, planned_pins
from actuated_characters.runs.planned.strengths import PlannedStrengths
from actuated_characters.runs.planned.throws import PlannedThrow
from actuated_characters.runs.planned.wrenches import PlannedPush
from msgs_config.errors import RecordingError
from msgs_config.messages import topics
from sim_node.node_settings import NodeSettings
from sim_node.physics.wrenches import ExternalWrench

_MOST_PUSHES = topics.EXTERNAL_WRENCH.quality.depth  # that wait for the simulator, paused


@dataclass
class Stop:
    """The inputs that are sent while the simulator waits."""

    settings: list[tuple[str, dict[str, Any]]] = field(default_factory=list)  # by node, in order
    pushes: list[PlannedPush] = field(default_factory=list)
    pins: list[PlannedPin] = field(default_factory=list)
    throws: list[PlannedThrow] = field(default_factory=list)
    strengths: list[PlannedStrengths] = field(default_factory=list)
    behaviours: list[PlannedBehaviour] = field(default_factory=list)
    resets: bool = False  # the state of the row begins an episode

    @property
    def asks_controller(self) -> bool:
        """Whether something is sent that counts from an answer of the controller on."""
        return bool(self.strengths or self.behaviours)


Stops: TypeAlias = "defaultdict[int, Stop]"


@dataclass(frozen=True)
class ForkPoint:
    """Where a recording is left, and what of it is repeated beyond."""

    row: int  # of the state from which on the fork differs
    ticks: int  # of the fork
    with_later: bool  # repeat the inputs of the ticks from that state on, too

    def repeats(self, row: int) -> bool:
        """Whether an input that counts from the state of a row on is repeated."""
        return row < (self.ticks if self.with_later else self.row)


def recorded_stops(recording: Recording, point: ForkPoint) -> Stops:
    """The recorded parameters, pushes, pins, throws and resets that a fork repeats.

    A push, pin or throw is sent in the first state of its episode, because a reset discards those
    that wait; and it begins where it began.

    Raises:
        RecordingError: the recording does not say which pushes, pins or throws acted, or a push was
            not held for `wrench_duration`.
    """
    check_pushes(recording)
    _check_pins(recording)
    check_throws(recording)
    stops: Stops = defaultdict(Stop)
    for row, changes in parameter_changes(recording).items():
        if point.repeats(row + 1):
            stops[row + 1].settings += [(topics.CONTROLLER_NODE, change) for change in changes]
    begins, simulator = recording.episode_rows.tolist(), reset_changes([recording])
    for row in begins[1:]:
        if row <= (point.ticks if point.with_later else point.row):
            stops[row].resets = True
            if row in simulator:
                stops[row].settings.append((topics.SIM_NODE, simulator[row]))
    ends = [*(row - 1 for row in begins[1:]), len(recording.effort)]  # a reset is a tick
    for first, end in zip(begins, ends, strict=True):
        pushes = [each for each in begun_pushes(recording, first, end) if point.repeats(each[0])]
        pins = _changed_pins(recording, first, end, point)
        throws = _begun_throws(recording, first, end, point)
        if len(pushes) > _MOST_PUSHES:
            raise RecordingError(
                f"the recording has {len(pushes)} pushes in one episode; a fork repeats at most "
                f"{_MOST_PUSHES}"
            )
        if pushes or pins or throws:
            stops[first + 1].pushes += [push for _, push in pushes]
            stops[first + 1].pins += pins
            stops[first + 1].throws += throws
    return stops


def _check_pins(recording: Recording) -> None:
    """Raise RecordingError if there were pins, and the recording does not have which acted."""
    if recording.pins_sent and not recording.pins:
        raise RecordingError(
            f"the recording has {recording.pins_sent} messages on '{topics.PIN.name}', but not "
            f"which pins were in force: nothing on '{topics.APPLIED_PIN.name}'"
        )


def _changed_pins(recording: Recording, first: int, end: int, point: ForkPoint) -> list[PlannedPin]:
    """The repeated changes of pins of some ticks, in their order."""
    return [
        pin
        for row in range(first, end)
        if point.repeats(row) and (changes := pin_changes(recording, row)) is not None
        for pin in planned_pins(changes)
    ]


def _begun_throws(
    recording: Recording, first: int, end: int, point: ForkPoint
) -> list[PlannedThrow]:
    """The repeated throws of some ticks, in their order."""
    return [
        PlannedThrow(int(recording.stamps_ns[row]), throw)
        for row in range(first, end)
        if recording.throws and point.repeats(row)
        for throw in recording.throws[row]
    ]


def begun_pushes(recording: Recording, first: int, end: int) -> list[tuple[int, PlannedPush]]:
    """The pushes of an episode's ticks, with the row that each begins in.

    They are in the order in which the simulator held them, which is that of its sums.

    Raises:
        RecordingError: a push was not held for `wrench_duration`.
    """
    settings = NodeSettings.of(simulator_values(recording))
    ordered: list[ExternalWrench] = []
    acting: list[ExternalWrench] = []
    for row in range(first, end):
        going_on = [push for push in acting if row < push.first_tick + settings.push_ticks]
        acting = []
        for found in wrenches_of(recording, own_pushes(recording, row), row):
            if going_on and _key(found) == _key(going_on[0]):
                acting.append(going_on.pop(0))
                continue
            acting.append(found)
            place = len(ordered)
            if going_on:  # before those that it came before
                place = next(n for n, each in enumerate(ordered) if each is going_on[0])
            ordered.insert(place, found)
        if going_on:
            raise _ended_early(recording, going_on[0], row)
    return [(push.first_tick, _planned(recording, push)) for push in ordered]


def _key(push: ExternalWrench) -> tuple[int, bytes, bytes]:
    return push.link, push.wrench.tobytes(), push.point.tobytes()


def _planned(recording: Recording, push: ExternalWrench) -> PlannedPush:
    x, y, z = push.point.tolist()
    link, stamp_ns = recording.character.links[push.link].name, recording.stamps_ns[push.first_tick]
    return PlannedPush(int(stamp_ns), link, tuple(push.wrench.tolist()), (x, y, z))


def _ended_early(recording: Recording, push: ExternalWrench, row: int) -> RecordingError:
    link, times = recording.character.links[push.link].name, recording.times
    return RecordingError(
        f"the push on '{link}' at {times[push.first_tick]:g} s ended at {times[row]:g} s, before "
        f"wrench_duration ({recording.parameters['wrench_duration']} s) was over: that parameter "
        "was changed meanwhile, or equal pushes overlapped, and no recording says which; so the "
        "push cannot be repeated"
    )
