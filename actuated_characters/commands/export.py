"""The command `actuated_characters export`: the joint states of a recorded run as a table."""

import argparse
from pathlib import Path

from actuated_characters.commands.common.settings import Commands, add_bag, add_command


def add_export(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    export = add_command(
        commands,
        _export,
        "export",
        "write a recorded run's joint states as CSV",
        "Write the joint states of a recorded run as CSV, one row a state: time_s (since the first "
        "state), stamp_ns, episode (from 1), then position.DOF (rad or m), velocity.DOF (rad/s or "
        "m/s) and effort.DOF (N m or N, applied in the tick before the state; empty where there "
        "was none) of each degree of freedom. Numbers are read back to the last bit.",
        ["export runs/demo --output demo.csv"],
    )
    add_bag(export)
    export.add_argument("--output", type=Path, required=True, metavar="FILE.csv")
    export.add_argument("--character", metavar="NAME", help="which, where there are several")
    export.add_argument(
        "--reference",
        action="store_true",
        help="reference_position.DOF and reference_velocity.DOF, too; empty where there was none",
    )
    export.add_argument("--overwrite", action="store_true", help="replace FILE.csv")


def _export(options: argparse.Namespace) -> None:
    from actuated_characters.bags.recording import read_recording
    from actuated_characters.report.joint_table import check_output, write_joint_states

    check_output(options.output, overwrite=options.overwrite)
    recording = read_recording(options.bag, options.character)
    write_joint_states(
        recording, options.output, reference=options.reference, overwrite=options.overwrite
    )
    print(options.output)
