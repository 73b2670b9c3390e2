"""Velocities that are planned before a run, for a character that is steered."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from geometry_msgs.msg import TwistStamped

from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned_files import Planned, read_planned
from controller_node.references.steering.reference import SteeredReference
from controller_node.references.steering.velocity import VelocityCommand
from msgs_config.errors import ConfigurationError
from msgs_config.messages.cdr import split_stamp
from msgs_config.messages.clock import TickClock

_EXAMPLE = "'0.8,0,0.3@2 0,0,0@8'"


@dataclass(frozen=True)
class PlannedVelocity(Planned):
    """A velocity in the character's own frame, from a stamp on."""

    forward: float  # m/s
    left: float  # m/s
    turn: float  # rad/s

    def message(self) -> TwistStamped:
        """As the message of `cmd_vel_stamped`."""
        message = TwistStamped()
        message.header.stamp.sec, message.header.stamp.nanosec = split_stamp(self.stamp_ns)
        message.twist.linear.x, message.twist.linear.y = self.forward, self.left
        message.twist.angular.z = self.turn
        return message


def read_velocities(file: Path) -> list[PlannedVelocity]:
    """Read a file of `write_planned`. Raises RecordingError as `read_planned`."""
    return read_planned(file, "velocities", lambda fields: PlannedVelocity(**fields))


def plan_velocities(plan: RunPlan, text: str) -> tuple[RunPlan, list[PlannedVelocity]]:
    """The velocities of a text `X,Y,TURN@S X,Y,TURN@S ...`, and a plan whose reference has them.

    Numbers are m/s ahead and to the left, rad/s to the left, and s since the first state. Each is
    repeated until the next one, or it would time out.

    Raises:
        ConfigurationError: the text is not of that form, a time is beyond the run or not after the
            one before, a velocity is beyond the limits, or the reference is not steered.
    """
    reference, rate = plan.reference, plan.simulator.integer("rate")
    if not isinstance(reference, SteeredReference):
        raise ConfigurationError("--cmd-vel steers; it goes with --reference steered")
    commands = [_parse(part, rate) for part in text.split()]
    _check(plan, reference, commands)
    repeated: list[VelocityCommand] = []
    for command, following in zip(commands, [*commands[1:], None], strict=True):
        end = plan.ticks if following is None else following.tick
        stands = command.is_like(VelocityCommand(0, 0.0))
        for tick in range(command.tick, end, end if stands else reference.repeat_ticks):
            repeated.append(replace(command, tick=tick))
    for command in repeated:
        reference = reference.steered(command, 0).reference
    clock = TickClock(rate)
    planned = [
        PlannedVelocity(clock.stamp_ns(1 + each.tick), each.forward, each.left, each.turn)
        for each in repeated
    ]
    return replace(plan, reference=reference), planned


def _parse(text: str, rate_hz: int) -> VelocityCommand:
    found = re.fullmatch(r"([^,@]+),([^,@]+),([^,@]+)@([^,@]+)", text)
    try:
        if found is None:
            raise ValueError
        forward, left, turn, time = (float(number) for number in found.groups())
        if not all(map(math.isfinite, (forward, left, turn, time))):
            raise ValueError
    except ValueError:
        raise ConfigurationError(
            f"--cmd-vel: {text!r} is no velocity; write X,Y,TURN@S for each, such as {_EXAMPLE}"
        ) from None
    return VelocityCommand(round(time * rate_hz), forward, left, turn)


def _check(plan: RunPlan, reference: SteeredReference, commands: Sequence[VelocityCommand]) -> None:
    """Raise ConfigurationError unless the commands are in order, within run and limits."""
    rate = plan.simulator.integer("rate")
    if not commands:
        raise ConfigurationError(
            f"--cmd-vel has no velocity; write one or more, such as {_EXAMPLE}"
        )
    before = -1
    for command in commands:
        time = command.tick / rate
        if not before < command.tick < plan.ticks:
            raise ConfigurationError(
                f"--cmd-vel: a velocity at {time:g} s; times must rise, from 0 s to less than "
                f"{plan.ticks / rate:g} s"
            )
        before = command.tick
        allowed = reference.limits.clamped(command)
        if allowed != command:
            raise ConfigurationError(
                f"--cmd-vel: {_text(command)} at {time:g} s is more than it can, which is at most "
                f"{_text(allowed)} (see controller_node.steering.*)"
            )


def _text(command: VelocityCommand) -> str:
    return f"{command.forward:g},{command.left:g},{command.turn:g}"
