"""Reads the inputs of a recorded run, one by one."""

from pathlib import Path

from actuated_characters.bags.pins import pin_changes
from actuated_characters.bags.recording import Recording
from actuated_characters.fork.inputs import begun_pushes
from actuated_characters.replay.comparison import clock_of, first_tick_of
from actuated_characters.replay.players.controller_parameters import (
    first_parameters,
    parameter_changes,
)
from actuated_characters.replay.players.simulator_outputs import read_rare_messages
from actuated_characters.replay.world import simulator_values
from actuated_characters.runs.planned.pins import planned_pins
from actuated_characters.runs.planned.throws import PlannedThrow
from actuated_characters.runs.planned.velocities import PlannedVelocity
from actuated_characters.runs.planned.wrenches import PlannedPush
from actuated_characters.shrink.inputs import (
    Input,
    PinInput,
    PushInput,
    Request,
    RequestInput,
    SettingInput,
    ThrowInput,
    velocity_inputs,
)
from msgs_config.messages import topics, typed
from sim_node.node_settings import NodeSettings


def read_inputs(path: Path, recording: Recording) -> list[Input]:
    """The inputs of a recording's first episode.

    Those of a kind are in the order in which they were sent.

    Raises:
        RecordingError: the bag cannot be read, or its inputs cannot be repeated.
    """
    rows = _last(recording)
    return [
        *_settings(recording, rows),
        *_requests(path, recording, rows),
        *_pushes(recording, rows),
        *_pins(recording, rows),
        *_throws(recording, rows),
    ]


def _rate(recording: Recording) -> int:
    return clock_of(recording).rate_hz


def _settings(recording: Recording, rows: int) -> list[Input]:
    """Each parameter of the controller's changes by itself."""
    now, found = dict(first_parameters(recording)), list[Input]()
    for row, changes in sorted(parameter_changes(recording).items()):
        for name, value in (item for change in changes for item in change.items()):
            if row + 1 < rows:  # it counts from the next answer on
                found.append(SettingInput(row + 1, _rate(recording), name, now[name], value))
            now[name] = value
    return found


def _requests(path: Path, recording: Recording, rows: int) -> list[Input]:
    """What the controller was asked for: velocities, and all else."""
    clock, first = clock_of(recording), first_tick_of(recording)
    velocities: list[tuple[int, PlannedVelocity]] = []
    row_of: dict[int, int] = {}
    found: list[Input] = []
    for stop, messages in sorted(read_rare_messages(path, recording).requests.items()):
        for topic, raw in messages:
            if topic != topics.CMD_VEL_STAMPED.name:
                if stop < rows:
                    request = Request(topic, raw)
                    found.append(RequestInput(stop, clock.rate_hz, request))
                continue
            velocity = _velocity(raw)
            row = max(clock.first_tick_from(velocity.stamp_ns) - first, stop)
            if row < rows:
                velocities.append((stop, velocity))
                row_of[velocity.stamp_ns] = row
    return [*velocity_inputs(velocities, row_of, clock.rate_hz), *found]


def _velocity(raw: bytes) -> PlannedVelocity:
    """The velocity in a message of `cmd_vel_stamped`."""
    message = typed.decode(raw, typed.TWIST_STAMPED)
    linear, angular = message.twist.linear, message.twist.angular
    return PlannedVelocity(typed.stamp_of(message), linear.x, linear.y, angular.z)


def _pushes(recording: Recording, rows: int) -> list[Input]:
    """The pushes; equal ones of which each begins as the one before ends are one."""
    ticks = NodeSettings.of(simulator_values(recording)).push_ticks
    held: list[list[tuple[int, PlannedPush]]] = []
    for row, push in begun_pushes(recording, 0, rows):
        before = next((each for each in held if _goes_on(each[-1], row, push, ticks)), None)
        if before is not None:
            before.append((row, push))
        else:
            held.append([(row, push)])
    centres = {link.name: link.inertial_pose.position for link in recording.character.links}
    return [
        PushInput(row, _rate(recording), pushes, tuple(centres[push.link]) == push.point)
        for pushes in held
        for row, push in pushes[:1]
    ]


def _goes_on(before: tuple[int, PlannedPush], row: int, push: PlannedPush, ticks: int) -> bool:
    """Whether a push goes on where an equal one ends."""
    same = (before[1].link, before[1].wrench, before[1].point)
    return before[0] + ticks == row and same == (push.link, push.wrench, push.point)


def _pins(recording: Recording, rows: int) -> list[Input]:
    return [
        PinInput(row, _rate(recording), pin)
        for row in range(rows)
        if (changes := pin_changes(recording, row)) is not None
        for pin in planned_pins(changes)
    ]


def _throws(recording: Recording, rows: int) -> list[Input]:
    return [
        ThrowInput(row, _rate(recording), PlannedThrow(int(recording.stamps_ns[row]), throw))
        for row in range(rows if recording.throws else 0)
        for throw in recording.throws[row]
    ]


def _last(recording: Recording) -> int:
    """Ticks of the first episode; the tick that is a reset has none."""
    begins = recording.episode_rows.tolist()
    return begins[1] - 1 if len(begins) > 1 else len(recording.effort)
