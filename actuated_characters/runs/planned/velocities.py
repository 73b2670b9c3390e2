"""Velocities that are planned before a run, for a character that is steered."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.files import Planned, read_planned
from controller_node.behaviours.factory import BehaviourSettings
from controller_node.behaviours.state_machine.factory import STATE_MACHINE, MachineSettings
from controller_node.references.steering.reference import SteeredReference
from controller_node.references.steering.velocity import VelocityCommand
from msgs_config.errors import ConfigurationError
from msgs_config.messages import typed
from msgs_config.messages.clock import TickClock

_EXAMPLE = "'0.8,0,0.3@2 0,0,0@8'"


@dataclass(frozen=True)
class PlannedVelocity(Planned):
    """A velocity in the character's own frame, from a stamp on."""

    forward: float  # m/s
    left: float  # m/s
    turn: float  # rad/s

    def encode(self) -> bytes:
        """The serialised message of `cmd_vel_stamped`."""
        message = typed.stamped(typed.TWIST_STAMPED, self.stamp_ns)
        message.twist.linear.x, message.twist.linear.y = self.forward, self.left
        message.twist.angular.z = self.turn
        return typed.encode(message)


def read_velocities(file: Path) -> list[PlannedVelocity]:
    """Read a file of `write_planned`. Raises RecordingError as `read_planned`."""
    return read_planned(file, "velocities", lambda fields: PlannedVelocity(**fields))


def plan_velocities(plan: RunPlan, text: str) -> tuple[RunPlan, list[PlannedVelocity]]:
    """The velocities of a text `X,Y,TURN@S X,Y,TURN@S ...`, and a plan whose reference has them.

    Numbers are m/s ahead and to the left, rad/s to the left, and s since the first state. Each is
    repeated until the next one, or it would time out. What is beyond the limits of a state machine
    is taken as far as they go, and said in the plan's warnings.

    Raises:
        ConfigurationError: the text is not of that form, a time is beyond the run or not after the
            one before, the reference is not steered, or a velocity is beyond its limits.
    """
    reference, rate = plan.reference, plan.simulation.rate_hz
    if not isinstance(reference, SteeredReference):
        raise ConfigurationError("--cmd-vel steers; it goes with --reference steered or commanded")
    commands = [_parse(part, rate) for part in text.split()]
    _check_times(plan, commands)
    commands, warnings = _allowed(plan, reference, commands)
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
    return replace(plan, reference=reference, warnings=plan.warnings + warnings), planned


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


def _check_times(plan: RunPlan, commands: Sequence[VelocityCommand]) -> None:
    """Raise ConfigurationError unless there are commands, in order and within the run."""
    rate = plan.simulation.rate_hz
    if not commands:
        raise ConfigurationError(
            f"--cmd-vel has no velocity; write one or more, such as {_EXAMPLE}"
        )
    before = -1
    for command in commands:
        if not before < command.tick < plan.ticks:
            raise ConfigurationError(
                f"--cmd-vel: a velocity at {command.tick / rate:g} s; times must rise, from 0 s to "
                f"less than {plan.ticks / rate:g} s"
            )
        before = command.tick


def _allowed(
    plan: RunPlan, reference: SteeredReference, commands: Sequence[VelocityCommand]
) -> tuple[list[VelocityCommand], tuple[str, ...]]:
    """The commands within the limits, and a line for each that was not, where a machine goes.

    Raises:
        ConfigurationError: one is beyond the limits, and no machine goes.
    """
    rate, warnings = plan.simulation.rate_hz, []
    allowed = [reference.limits.clamped(command) for command in commands]
    for asked, taken in zip(commands, allowed, strict=True):
        if asked == taken:
            continue
        beyond = f"--cmd-vel: {_text(asked)} at {asked.tick / rate:g} s is more than"
        if BehaviourSettings.of(plan.controller).behaviour != STATE_MACHINE:
            raise ConfigurationError(
                f"{beyond} it can, which is at most {_text(taken)} (see controller_node.steering.*)"
            )
        machine = MachineSettings.of(plan.controller).machine
        warnings.append(f"{beyond} the machine {machine} takes; it is taken as {_text(taken)}")
    return allowed, tuple(warnings)


def _text(command: VelocityCommand) -> str:
    return f"{command.forward:g},{command.left:g},{command.turn:g}"
