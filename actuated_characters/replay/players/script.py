"""What a bag sends in the controller's place, tick by tick. No ROS in here."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import CommandArrays, Recording, read_recordings
from actuated_characters.replay.world import common_rows, left_out, worlds
from msgs_config.errors import CommandError, LayoutError, RecordingError
from msgs_config.messages.wrenches import WrenchArrays
from sim_node.timing.lockstep import CommandStatus, LockstepBarrier

Commands = tuple[CommandArrays, ...]


@dataclass(frozen=True)
class Script:
    """What a recording of t ticks sends; nothing in a tick that was a reset."""

    commands: tuple[Commands, ...]  # (t,): the messages that answer each state, in order
    pushes: tuple[WrenchArrays | None, ...]  # (t,): what acts during each tick, if anything
    resets: frozenset[int]  # ticks (counted from 0) that were resets
    applies: bool  # whether the commands are the efforts that were applied, clipped and delayed

    @property
    def ticks(self) -> int:
        """How many ticks there are."""
        return len(self.commands)


def read_world(path: Path, number: int = 0) -> tuple[list[Recording], list[str]]:
    """The recordings of one of a bag's worlds, cut to the states that all of them have.

    With notes on what was left out.

    Raises:
        ActuatedCharactersError: the bag cannot be read, or its worlds are not whole.
    """
    together = worlds(read_recordings(path))[number]
    rows, count = common_rows(together)
    cut = [each.rows(slice(row, row + count)) for each, row in zip(together, rows, strict=True)]
    return cut, left_out(together, rows)


def make_scripts(together: Sequence[Recording]) -> list[Script]:
    """What is sent to each character of a world: the commands that its ticks were given.

    Where some tick lacks a command (in real time, after a timeout, or in a bag without the topic)
    none of them decides: all are then the efforts that were really applied.

    Raises:
        RecordingError: no joint was commanded, so that the simulator would wait for nobody; or a
            tick has neither commands nor applied efforts.
    """
    sent = [_all_sent(recording) for recording in together]
    applies = any(None in each for each in sent)
    return [
        _script(recording, each, applies) for recording, each in zip(together, sent, strict=True)
    ]


def _script(recording: Recording, sent: list[Commands | None], applies: bool) -> Script:
    resets = _resets(recording)
    commands = [
        _applied(recording, tick) if applies and tick not in resets else found or ()
        for tick, found in enumerate(sent)
    ]
    pushes = recording.applied_wrench or (None,) * len(sent)
    if recording.pushes_sent and None in pushes:
        raise RecordingError(
            f"the recording has {recording.pushes_sent} messages on 'external_wrench', but does "
            "not say for every tick which pushes acted: 'applied_wrench' is not there, or not whole"
        )
    wanted = [push if push is not None and push.links else None for push in pushes]
    return Script(tuple(commands), tuple(wanted), resets, applies)


def _resets(recording: Recording) -> frozenset[int]:
    return frozenset(row - 1 for row in recording.episode_rows.tolist() if row)


def _all_sent(recording: Recording) -> list[Commands | None]:
    """The commands of each tick; None where they do not complete it."""
    ticks = len(recording.effort)
    if not recording.layout.mask(recording.parameters["commanded_joints"]).any():
        raise RecordingError(
            "no joint is commanded in the recording, so its simulator waits for nobody; "
            "replay it without --through-topics"
        )
    if recording.parameters.get("mode") == "realtime":
        return [None] * ticks
    resets = _resets(recording)
    return [() if tick in resets else _sent(recording, tick) for tick in range(ticks)]


def _sent(recording: Recording, tick: int) -> Commands | None:
    """The commands that completed a tick, in order; None if they do not.

    What came after a conflict was asked for again, when the simulator was resumed.
    """
    layout = recording.layout
    required = layout.mask(recording.parameters["commanded_joints"])
    barrier, kept = LockstepBarrier(layout.dof_names, required), list[CommandArrays]()
    for command in recording.commands[tick] if recording.commands else ():
        try:
            indices = layout.indices(command.names)
            verdict = barrier.submit(barrier.stamp_ns, indices, command.efforts)
        except (LayoutError, CommandError):
            continue
        if verdict is CommandStatus.CONFLICT:
            barrier.clear()
            kept.clear()
            barrier.submit(barrier.stamp_ns, indices, command.efforts)
        if verdict in (CommandStatus.ACCEPTED, CommandStatus.CONFLICT):
            kept.append(command)
        if barrier.complete:
            return tuple(kept)
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
