"""Runs as the rows of a sweep ask for them: by the options of `run --in-process`."""

import argparse
from collections.abc import Sequence
from functools import cache
from typing import NoReturn

from actuated_characters.commands.common.planned_run import planned_run
from actuated_characters.commands.run import add_run, check_options, recording_of
from actuated_characters.sweep.row import AskedRun
from msgs_config.errors import ConfigurationError

_OWN = {"parameters", "output", "topic", "set", "host", "port", "fps", "skin", "skin-map"}
"""Options of `run` that a sweep gives itself, or that are of what its runs have not; so are all
those without a value."""


class _RowParser(argparse.ArgumentParser):
    """A parser whose errors are those of this package."""

    def error(self, message: str) -> NoReturn:
        """Raise ConfigurationError rather than end the process."""
        raise ConfigurationError(message)


def row_options() -> dict[str, bool]:
    """The options of `run` that a row may have, and whether they may be repeated."""
    (commands,) = (each for each in _parser()._actions if isinstance(each.choices, dict))
    assert isinstance(commands.choices, dict)
    given = [action for action in commands.choices["run"]._actions if action.nargs != 0]
    names = {action.option_strings[-1].removeprefix("--"): action for action in given}
    return {
        name: isinstance(action, argparse._AppendAction)
        for name, action in names.items()
        if name not in _OWN
    }


def asked_run(arguments: Sequence[str]) -> AskedRun:
    """The run that `run --in-process` with these arguments makes.

    Raises:
        ActuatedCharactersError: there is none; says why.
    """
    options = _parser().parse_args(["run", *arguments, "--in-process"])
    run = planned_run(options)
    check_options(options, run.plan)
    return AskedRun(run.plan, run.inputs, recording_of(options, run.plan), run.warnings)


@cache
def _parser() -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = _RowParser(prog="actuated_characters")
    add_run(parser.add_subparsers())
    return parser
