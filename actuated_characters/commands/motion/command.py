"""The command `actuated_characters motion`: motion from elsewhere and to elsewhere."""

import argparse

from actuated_characters.commands.common.completion import add_names
from actuated_characters.commands.common.settings import Commands
from actuated_characters.commands.motion.editing import add_motion_edits
from actuated_characters.commands.motion.export import add_motion_export
from actuated_characters.commands.motion.importing import add_motion_import
from actuated_characters.commands.motion.info import add_motion_info


def add_motion(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    about = "motion from and to other programs, and clips to be edited"
    motion = commands.add_parser("motion", help=about, description=f"{about.capitalize()}.")
    subcommands = motion.add_subparsers(required=True, metavar="COMMAND")
    for add in (add_motion_import, add_motion_export, add_motion_info, add_motion_edits):
        add(subcommands)
    for subcommand in subcommands.choices.values():
        add_names(subcommand)
