"""Placeholder."""
import argparse
from actuated_characters.commands.common.settings import Commands


def add_motion_edits(commands: "Commands[argparse.ArgumentParser]") -> None:
    """None yet."""
