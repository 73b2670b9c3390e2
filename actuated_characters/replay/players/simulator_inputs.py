"""What a bag sends in the controller's place, tick by tick."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.pins import own_pushes, pin_changes
from actuated_characters.bags.recording import CommandArrays, Recording
from actuated_characters.replay.world import check_pushes
from msgs_config.errors import CommandError, LayoutError, RecordingError
from msgs_config.messages.pins import PinArrays
from msgs_config.messages.wrenches import WrenchArrays
from sim_node.timing.lockstep import CommandStatus, LockstepBarrier

Commands = tuple[CommandArrays, ...]


@dataclass(frozen=True)
class SimulatorInputs:
    """What a simulator is sent of a recording of t ticks; nothing in a tick that was a reset."""

    commands: tuple[Commands, ...]  # (t,): the messages that answer each state, in order
    pushes: tuple[WrenchArrays | None, ...]  # (t,): what acts during each tick, if anything
    pins: tuple[PinArrays | None, ...]  # (t,): what changes the pins as each tick begins
    resets: frozenset[int]  # ticks (counted from 0) that were resets
    are_applied: bool  # the commands are the efforts that were applied, clipped and delayed


def make_inputs(together: Sequence[Recording]) -> list[SimulatorInputs]:
    """What is sent to each character of a world: the commands that its ticks were given.

    Where some tick lacks a command (in real time, after a timeout, or in a bag without the topic)
    the efforts that were really applied are sent in all ticks.

    Raises:
        RecordingError: no joint was commanded, so that the simulator would not wait for commands;
            a tick has neither commands nor applied efforts; or it is not known which pushes acted.
    """
    resets = frozenset(row - 1 for row in together[0].episode_rows.tolist() if row)
    sent = [_all_sent(recording, resets) for recording in together]
    are_applied = any(None in each for each in sent)
    inputs = []
    for recording, found in zip(together, sent, strict=True):
        commands = [
            _applied(recording, tick) if are_applied and tick not in resets else each or ()
            for tick, each in enumerate(found)
        ]
        check_pushes(recording)
        pushes = [own_pushes(recording, tick) for tick in range(len(found))]
        acting = [push if push is not None and push.links else None for push in pushes]
        pins = [
            None if tick in resets else pin_changes(recording, tick) for tick in range(len(found))
        ]
        inputs.append(
            SimulatorInputs(tuple(commands), tuple(acting), tuple(pins), resets, are_applied)
        )
    return inputs


def _all_sent(recording: Recording, resets: frozenset[int]) -> list[Commands | None]:
    """The commands of each tick; None where they do not complete it."""
    ticks = len(recording.effort)
    if not recording.layout.mask(recording.parameters["commanded_joints"]).any():
        raise RecordingError(
            "no joint is commanded in the recording, so its simulator does not wait for commands; "
            "replay it without --through-topics"
        )
    if recording.parameters.get("mode") == "realtime":
        return [None] * ticks
    return [() if tick in resets else _sent(recording, tick) for tick in range(ticks)]


def _sent(recording: Recording, tick: int) -> Commands | None:
    """The commands that completed a tick, in order; None if they do not.

    What came after a conflict was asked for again, when the simulator was resumed.
    """
    layout = recording.layout
    required = layout.mask(recording.parameters["commanded_joints"])
    barrier, accepted = LockstepBarrier(layout.dof_names, required), list[CommandArrays]()
    for command in recording.commands[tick]:
        try:
            indices = layout.indices(command.names)
            verdict = barrier.submit(barrier.stamp_ns, indices, command.efforts)
        except (LayoutError, CommandError):
            continue
        if verdict is CommandStatus.CONFLICT:
            barrier.clear()
            accepted.clear()
            barrier.submit(barrier.stamp_ns, indices, command.efforts)
        if verdict in (CommandStatus.ACCEPTED, CommandStatus.CONFLICT):
            accepted.append(command)
        if barrier.complete:
            return tuple(accepted)
    return None


def _applied(recording: Recording, tick: int) -> Commands:
    entries = np.flatnonzero(recording.layout.mask(recording.parameters["commanded_joints"]))
    effort = recording.effort[tick, entries]
    if not np.isfinite(effort).all():
        raise RecordingError(
            f"tick {tick + 1} of the recording has neither commands for all joints nor the "
            "efforts that were applied"
        )
    names = tuple(recording.layout.dof_names[entry] for entry in entries)
    return (CommandArrays(names, effort, 0),)
