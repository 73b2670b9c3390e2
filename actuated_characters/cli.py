"""The command `actuated_characters`: runs of simulator and controller, and what there is to run."""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module

from msgs_config.runtime.process import EXIT_ERROR, limit_threads, open_missing_streams

limit_threads()  # before anything imports numpy

from actuated_characters.commands.author import add_author
from actuated_characters.commands.common.completion import add_names, complete
from actuated_characters.commands.common.interruption import raise_at_signals, was_interrupted
from actuated_characters.commands.common.overview import print_overview
from actuated_characters.commands.compare import add_compare
from actuated_characters.commands.explain.command import add_explain
from actuated_characters.commands.export import add_export
from actuated_characters.commands.fork import add_fork
from actuated_characters.commands.info import add_info
from actuated_characters.commands.motion.command import add_motion
from actuated_characters.commands.play import add_play
from actuated_characters.commands.render import add_render
from actuated_characters.commands.replay import add_replay
from actuated_characters.commands.report import add_report
from actuated_characters.commands.run import add_run
from actuated_characters.commands.search import add_search
from actuated_characters.commands.shrink import add_shrink
from actuated_characters.commands.sweep import add_sweep
from actuated_characters.commands.take import add_take
from actuated_characters.commands.train.command import add_train
from actuated_characters.commands.trial import add_trial
from actuated_characters.commands.verify import add_verify
from actuated_characters.commands.view import add_view
from msgs_config.errors import ActuatedCharactersError
from msgs_config.runtime.ros_environment import check_domain_id

_EXIT_INTERRUPTED = 130
_RUN = "run"  # this command alone prints the overview


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    open_missing_streams()
    try:
        raise_at_signals()  # within, for a signal that waits is raised at once
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
        *(add_run, add_play, add_view, add_fork, add_render, add_replay, add_info, add_report),
        *(add_compare, add_export, add_motion, add_author, add_take, add_train, add_explain),
        *(add_sweep, add_search, add_shrink, add_trial, add_verify),
    ):
        add(commands)
    # by its name alone: the lecture's figures know this package, which does not know them
    import_module("lecture.framework.command").add_study(commands)
    import_module("lecture.labs.command").add_grade(commands)
    for command in commands.choices.values():
        add_names(command)
    return parser


class _Version(argparse.Action):
    """Prints the versions of what the last bits of a run depend on, which take a while to find."""

    def __call__(self, parser: argparse.ArgumentParser, *ignored: object) -> None:
        from msgs_config.versions import installed_versions

        print("\n".join(f"{name} {version}" for name, version in installed_versions().items()))
        parser.exit()


if __name__ == "__main__":
    sys.exit(main())
