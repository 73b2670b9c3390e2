"""A trainer's trace against the observations that are made here of its states."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actuated_characters.commands.explain.diagnosis import differing, reason
from actuated_characters.commands.explain.trace import Trace, read_trace
from controller_node.behaviours.onnx_policy.description import Description
from controller_node.behaviours.onnx_policy.factory import joint_entries
from controller_node.behaviours.onnx_policy.observation import (
    Entry,
    ObservationHistory,
    frame_of,
)
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character


@dataclass(frozen=True)
class Compared:
    """What came of it, in lines."""

    lines: tuple[str, ...]
    differs: bool


def compare_trace(
    path: Path, policy: Description, entries: Sequence[Entry], character: Character
) -> Compared:
    """Compare a trace with what a policy would be told of its states.

    Raises:
        ConfigurationError: the trace is malformed.
    """
    trace = read_trace(path, policy)
    ours = _observations(trace, policy, character)
    missing = {used.name: trace.missing(used) for used in policy.terms}
    lines = [
        f"not compared: {name}, for the trace has no '{key}'"
        for name, key in missing.items()
        if key
    ]
    theirs = trace.observations
    wrong = differing(theirs, ours)
    for row, entry in enumerate(entries):
        wrong[: entry.age, row] = False  # of decisions before the trace
        if missing[entry.used.name]:
            wrong[:, row] = False
    found = np.flatnonzero(wrong.any(axis=0)).tolist()
    if found:
        lines.append(_difference(found[0], entries, theirs, ours, trace))
        others = dict.fromkeys(entries[row].used.name for row in found)
        del others[entries[found[0]].used.name]
        lines += [f"others that differ: {', '.join(others)}"] if others else []
        return Compared(tuple(lines), differs=True)
    lines.append(f"{path.name}: all compared entries of {len(theirs)} rows agree")
    return Compared(tuple(lines), differs=False)


def _observations(trace: Trace, policy: Description, character: Character) -> FloatArray:
    """What is made here of each row's state (t, o)."""
    joints = joint_entries(policy, character)
    history = ObservationHistory(policy.terms, policy.history)
    situations = trace.situations(policy, character.layout.size, joints)
    return np.array([history.add(frame_of(policy.terms, seen)) for seen in situations], float)


def _difference(
    row: int,
    entries: Sequence[Entry],
    theirs: FloatArray,
    ours: FloatArray,
    trace: Trace,
) -> str:
    """The line of the first entry that differs, with what explains all of its term and age."""
    entry = entries[row]
    used, age, alike = entry.used, entry.age, (entry.used, entry.age)
    columns = [number for number, each in enumerate(entries) if (each.used, each.age) == alike]
    known = slice(age, None)  # rows
    why = reason(theirs[known, columns], ours[known, columns], used.labels, trace.turns()[known])
    when = age + int(np.flatnonzero(differing(theirs[known, row], ours[known, row]))[0])
    ago = f", {age} decisions ago" if age else ""
    return (
        f"entry {row} differs first: {used.name}, {used.labels[entry.column]}{ago}; in row {when} "
        f"the trace has {theirs[when, row]:.6g}, here it is {ours[when, row]:.6g}"
        f"{f': {why}' if why else ''}"
    )
