"""Completion of the command line in bash and zsh, by argcomplete (the extra `completion`)."""

import argparse
import os
from collections.abc import Iterable
from contextlib import suppress


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer a shell that asks how a command line goes on, and exit; else return at once."""
    if "_ARGCOMPLETE" in os.environ:
        with suppress(ImportError):
            import argcomplete

            argcomplete.autocomplete(parser)


def add_names(parser: argparse.ArgumentParser) -> None:
    """Let a command's options be completed by names: characters, their clips, parameters."""
    completers = {"character": _characters, "clip": _clips, "set": _settings, "scene": _scenes}
    for action in parser._actions:
        if action.dest in completers and action.option_strings:
            action.completer = completers[action.dest]  # type: ignore[attr-defined]


def _characters(prefix: str, **ignored: object) -> Iterable[str]:
    from argcomplete.completers import FilesCompleter

    from msgs_config.character.file import shipped_characters

    return [*shipped_characters(), *FilesCompleter()(prefix)]


def _clips(prefix: str, parsed_args: argparse.Namespace, **ignored: object) -> Iterable[str]:
    from argcomplete.completers import FilesCompleter

    from actuated_characters.commands.common.settings import CHARACTER
    from msgs_config.character.loading import load_character
    from msgs_config.clips.reading import available_clips

    character = load_character(parsed_args.character or CHARACTER)
    return [*available_clips(character), *FilesCompleter()(prefix)]


def _scenes(prefix: str, **ignored: object) -> Iterable[str]:
    from argcomplete.completers import FilesCompleter

    from actuated_characters.scenes.scene import scene_names

    return [*scene_names(), *FilesCompleter()(prefix)]


def _settings(parsed_args: argparse.Namespace, **ignored: object) -> Iterable[str]:
    from actuated_characters.commands.common.settings import CHARACTER, NODES, parameters_of
    from msgs_config.character.loading import load_character

    character = load_character(getattr(parsed_args, "character", None) or CHARACTER)
    return [
        f"{node}.{parameter.name}:="
        for node in NODES
        for parameter in parameters_of(node, character)
    ]
