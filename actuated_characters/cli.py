"""The command `actuated_characters`: runs of simulator and controller, and what there is to run."""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module

from rich.console import Console
from rich.markup import escape
from rich.padding import Padding

from actuated_characters.commands.common.completion import add_names, complete
from actuated_characters.commands.common.interruption import raise_at_signals, was_interrupted
from actuated_characters.commands.common.overview import print_characters, print_overview
from actuated_characters.commands.common.settings import (
    NODES,
    add_character,
    add_command,
    parameters_of,
)
from actuated_characters.commands.compare import add_compare
from actuated_characters.commands.export import add_export
from actuated_characters.commands.fork import add_fork
from actuated_characters.commands.info import add_info
from actuated_characters.commands.motion.command import add_motion
from actuated_characters.commands.play import add_play
from actuated_characters.commands.reconstruct import add_reconstruct
from actuated_characters.commands.recover import add_recover
from actuated_characters.commands.render import add_render
from actuated_characters.commands.replay import add_replay
from actuated_characters.commands.report import add_report
from actuated_characters.commands.run import add_run
from actuated_characters.commands.view import add_view
from msgs_config.errors import ActuatedCharactersError
from msgs_config.runtime.process import EXIT_ERROR, limit_threads, open_missing_streams
from msgs_config.runtime.ros_environment import check_domain_id

_EXIT_INTERRUPTED = 130
_RUN = "run"  # this command alone prints the overview


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    open_missing_streams()
    limit_threads()
    raise_at_signals()
    try:
        parser = _parser()
        complete(parser)
        given = sys.argv[1:] if arguments is None else list(arguments)
        options = parser.parse_args(given)
        check_domain_id(os.environ)
        command = print_overview if given == [_RUN] else options.command
        code = command(options)
    except (ActuatedCharactersError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_ERROR
    except BaseException:  # an interrupted import may have raised an error of its own
        if not was_interrupted():
            raise
        print("interrupted", file=sys.stderr)
        return _EXIT_INTERRUPTED
    return int(code or 0)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="actuated_characters",
        description="Simulated characters, actuated by torques over ROS 2 topics.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the versions and exit")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for add in (
        *(add_run, add_play, add_view, add_fork, add_reconstruct, add_render, add_replay, add_info),
        *(add_report, add_compare, add_export, add_motion, add_recover),
    ):
        add(commands)
    # by its name alone: the lecture's figures know this package, which does not know them
    import_module("lecture.framework.command").add_study(commands)
    add_command(commands, _list, "list", "list the characters and their clips", "", [])
    parameters = add_command(
        commands,
        _parameters,
        "parameters",
        "list a node's parameters",
        "List a node's parameters.",
        ["parameters controller_node"],
    )
    parameters.add_argument("node", choices=(*NODES, "recorder"))
    add_character(parameters)
    for command in commands.choices.values():
        add_names(command)
    return parser


class _Version(argparse.Action):
    """Prints the versions of what the last bits of a run depend on, which take a while to find."""

    def __call__(self, parser: argparse.ArgumentParser, *ignored: object) -> None:
        from msgs_config.versions import installed_versions

        print("\n".join(f"{name} {version}" for name, version in installed_versions().items()))
        parser.exit()


def _list(options: argparse.Namespace) -> None:
    del options
    print_characters(Console())


def _parameters(options: argparse.Namespace) -> None:
    console = Console(highlight=False)
    for parameter in parameters_of(options.node, options.character):
        value = f"{_shortened(parameter.default)} {parameter.unit}".rstrip()
        choices = f": {' | '.join(parameter.choices)}" if parameter.choices else ""
        change = f" ({parameter.when_changed})" if parameter.when_changed else ""
        about = f"{parameter.description}{choices}{change}"
        if console.is_terminal:
            console.print(f"[bold]{escape(parameter.name)}[/bold]: {escape(value)}")
            console.print(Padding(escape(about), (0, 0, 0, 4)))
        else:  # a line for each parameter, so that they can be searched
            print(f"{parameter.name}: {value}  {about}")


def _shortened(value: object) -> str:
    """A default as a table shows it; a long list by its first entries."""
    if isinstance(value, list):
        shown = ", ".join(f"{item:g}" if isinstance(item, float) else item for item in value[:3])
        return f"[{shown}, ... {len(value)} in all]" if len(value) > 3 else f"[{shown}]"
    return f"{value:g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    sys.exit(main())
