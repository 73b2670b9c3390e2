"""The command `actuated_characters author`: a timeline, made by hand in a browser."""

import argparse
from pathlib import Path

from actuated_characters.commands.common.settings import Commands, add_command
from actuated_characters.commands.common.skin_options import given_skin
from actuated_characters.commands.view import add_server, server_parameters
from actuated_characters.viewer.parameters import ViewerSettings
from msgs_config.runtime.extras import require_extra

_FILE = Path("timeline.yaml")


def add_author(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    author = add_command(
        commands,
        _author,
        "author",
        "make a timeline in a browser: pose a character by dragging it, key by key",
        "Drag hands, feet, elbows, knees, pelvis, chest or head: feet that stand stay. 'Key' keeps "
        "the pose at this time. All that is done is written to FILE at once, and can be undone; "
        "comments of a hand-written FILE are lost. Ctrl-C ends it. Needs the extra 'view'.",
        ["author", "author dance.yaml", "author dance.yaml --skin body.glb"],
    )
    author.add_argument(
        "file", nargs="?", type=Path, default=_FILE, metavar="FILE", help="timeline (%(default)s)"
    )
    author.add_argument(
        "--character", metavar="NAME", help="of a new FILE: whom it is for (humanoid)"
    )
    add_server(author)


def _author(options: argparse.Namespace) -> None:
    require_extra("view", "author")
    settings = ViewerSettings.given(server_parameters(options))
    skin = given_skin(options)
    from actuated_characters.viewer.editor.main import show_editor

    show_editor(
        options.file,
        options.character,
        host=settings.host,
        port=settings.port or None,
        fps=settings.fps,
        skin=skin,
    )
