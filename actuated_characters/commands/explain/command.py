"""The command `actuated_characters explain`: what a policy in ONNX is told, entry by entry."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.commands.common.settings import Commands, add_character, add_command

if TYPE_CHECKING:  # it takes a second to import
    from controller_node.behaviours.onnx_policy.description import Description
    from controller_node.behaviours.onnx_policy.observation import Entry

_DIFFERENT = 1  # exit code, like that of diff


def add_explain(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    explain = add_command(
        commands,
        _explain,
        "explain",
        "say what each entry of a policy's observation is",
        "Say what each entry of the observation of a policy in ONNX is, as `run --onnx` makes it. "
        "With a trace of the trainer, the first entry that differs, and why, as far as that can be "
        "told: sign, scale, order, frame, time or default pose. Exit code 1 if one does.",
        [
            "explain my_policy.onnx --character laikago",
            "explain my_policy.onnx --character laikago --trace trace.npz",
        ],
    )
    explain.add_argument("policy", type=Path, metavar="POLICY.onnx", help="the network's file")
    add_character(explain)
    explain.add_argument(
        "--trace",
        type=Path,
        metavar="FILE",
        help="observations and states that the trainer has logged, .npz or .csv: docs/policies.md",
    )


def _explain(options: argparse.Namespace) -> int:
    from actuated_characters.commands.explain.comparison import compare_trace
    from controller_node.behaviours.onnx_policy.factory import read_policy
    from controller_node.behaviours.onnx_policy.observation import entries_of
    from msgs_config.character.loading import load_character

    character = load_character(options.character)
    _, policy = read_policy(options.policy, character)
    entries = entries_of(policy)
    if options.trace is None:
        _print_entries(options.policy, policy, entries)
        return 0
    compared = compare_trace(options.trace, policy, entries, character)
    for line in compared.lines:
        print(line)
    return _DIFFERENT if compared.differs else 0


def _print_entries(path: Path, policy: "Description", entries: "list[Entry]") -> None:
    """Print a line an entry, whatever the terminal's width: names of joints are long."""
    remembers = any(used.history > 1 for used in policy.terms)
    rows = [["entry", "term", "of", *["decisions ago"] * remembers, "scale", "unit", "frame"]]
    for row, (used, column, age) in enumerate(entries):
        scale, ago = f"{used.scale[column]:g}", [str(age)] * remembers
        of = used.labels[column]
        rows.append([str(row), used.name, of, *ago, scale, used.term.unit, used.term.frame or "-"])
    print(f"{path.name}: {policy.size} entries every {policy.step_s:g} s")
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for cells in rows:
        print("  ".join(map(str.ljust, cells, widths)).rstrip())
