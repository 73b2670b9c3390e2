"""The option `--print-completion`: a script that lets a shell complete the command line."""

import argparse
from collections.abc import Iterator
from pathlib import Path

from msgs_config.errors import ConfigurationError

_SHELLS = ("bash", "zsh")
_NAMED = {"--character": "characters", "--clip": "clips"}


def add_completion(parser: argparse.ArgumentParser) -> None:
    """Add the option to the parser of the whole command line."""
    parser.add_argument(
        "--print-completion",
        action=_PrintCompletion,
        choices=_SHELLS,
        metavar="SHELL",
        help="print a script that completes the command line in bash or zsh (needs the extra "
        "'completion'), and exit",
    )


class _PrintCompletion(argparse.Action):
    """Prints the script; shells complete files, and the characters and clips that ship."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: object, shell: object, *ignored: object
    ) -> None:
        try:
            import shtab
        except ImportError as error:
            raise ConfigurationError(
                f"--print-completion needs shtab ({error}): "
                "pip install 'actuated_characters[completion]'"
            ) from error
        names = _shipped_names()
        for action in _actions(parser):
            kind = _NAMED.get((action.option_strings or [""])[-1])
            if kind is not None:  # or a file of the present folder
                action.complete = shtab.cmd(f"printf '%s\\n' {names[kind]} *")  # type: ignore[attr-defined]
            elif isinstance(action, argparse._SubParsersAction):
                for choice in action._choices_actions:  # zsh shows a description in one line
                    action.choices[choice.dest].description = choice.help
            elif action.type is Path:
                action.complete = shtab.FILE  # type: ignore[attr-defined]
        print(shtab.complete(parser, str(shell)))
        parser.exit()


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """The arguments of a parser and of its commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)


def _shipped_names() -> dict[str, str]:
    """The names of the characters and of all their clips, with spaces between them."""
    from controller_node.references.files.clip import available_clips
    from msgs_config.character.file import shipped_characters
    from msgs_config.character.loading import load_character

    characters = list(shipped_characters())
    clips = {clip for name in characters for clip in available_clips(load_character(name))}
    return {"characters": " ".join(characters), "clips": " ".join(sorted(clips))}
