"""The command `actuated_characters motion`: clips of one's own."""

import argparse

from actuated_characters.commands.common.completion import add_names
from actuated_characters.commands.common.settings import Commands
from actuated_characters.commands.motion.editing import add_motion_edits
from actuated_characters.commands.motion.importing import add_motion_import
from actuated_characters.commands.motion.info import add_motion_info
from actuated_characters.commands.motion.keying import add_motion_keys
from actuated_characters.commands.motion.reconstructing import add_motion_reconstruct


def add_motion(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    about = (
        "clips: import, look at, edit, make keys of, or reconstruct them with joint torques alone"
    )
    motion = commands.add_parser("motion", help=about, description=f"{about.capitalize()}.")
    subcommands = motion.add_subparsers(required=True, metavar="COMMAND")
    for add in (
        add_motion_import,
        add_motion_info,
        add_motion_edits,
        add_motion_keys,
        add_motion_reconstruct,
    ):
        add(subcommands)
    for subcommand in subcommands.choices.values():
        add_names(subcommand)
