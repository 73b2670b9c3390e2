"""Recordings for tests, of runs that were made in the process, and copies of them."""

from dataclasses import replace
from pathlib import Path

from actuated_characters.bags.recording import CommandArrays, Recording, read_recording
from msgs_config.arrays import FloatArray
from msgs_config.messages.wrenches import WrenchArrays
from tests.support.bags import Made, write_bag
from tests.support.rewriting import flipped


def recording_of(made: Made, directory: Path) -> Recording:
    """The recording of a run, with commands that are what was applied, and without pushes."""
    recording = read_recording(write_bag(directory / "bag", made.messages()))
    names = recording.layout.dof_names
    sent = [(CommandArrays(names, effort, 0),) for effort in recording.effort]
    nothing = tuple(WrenchArrays.of_rows(int(s), [], [], []) for s in recording.stamps_ns[1:])
    return replace(recording, commands=(*sent, ()), applied_wrench=nothing)


def changed(values: FloatArray, row: int, index: int, bit: int = 0) -> FloatArray:
    """A copy of rows with one bit of one number flipped."""
    copy = values.copy()
    copy[row] = flipped(copy[row], index, bit)
    return copy


def commanding(recording: Recording, row: int, *efforts: FloatArray) -> Recording:
    """With other commands for the state of a row."""
    commands = list(recording.commands)
    commands[row] = tuple(CommandArrays(recording.layout.dof_names, e, 0) for e in efforts)
    return replace(recording, commands=tuple(commands))


def with_parameters(recording: Recording, **parameters: object) -> Recording:
    """With other parameters of the simulator."""
    return replace(recording, parameters={**recording.parameters, **parameters})
