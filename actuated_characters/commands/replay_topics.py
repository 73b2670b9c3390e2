"""`replay --through-topics`: the bag in the place of the controller, or of the simulator."""

import argparse
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import add_repeated, node_settings
from actuated_characters.commands.replay_verdict import difference_error, named, verdict
from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # they take a second to import
    from actuated_characters.bags.recording import Recording
    from actuated_characters.replay.players.findings import CommandFindings
    from actuated_characters.replay.players.processes import Progress as Count
    from actuated_characters.replay.players.processes import Tell

_CONTROLLER, _SIMULATOR = "controller", "simulator"
_NODE = "controller_node"


def add_through_topics(parser: argparse.ArgumentParser) -> None:
    """Add the options to those of the command `replay`."""
    options = parser.add_argument_group(
        "through topics", "the real nodes, in lockstep, and the bag in the place of one of them"
    )
    options.add_argument(
        "--through-topics",
        nargs="?",
        choices=(_CONTROLLER, _SIMULATOR),
        const=_CONTROLLER,
        metavar="PLACE",
        help="controller (the default): the bag commands a simulator, whose states are compared; "
        "simulator: the bag's states drive a controller, whose commands are compared",
    )
    options.add_argument("--character", metavar="NAME", help="simulator: of several, this one")
    add_repeated(
        options,
        "--set",
        "controller_node.NAME:=VALUE",
        "simulator: another value of a parameter of the bag's controller, to see what that changes",
    )
    options.add_argument(
        "--no-start",
        action="store_true",
        help="simulator: start no controller, wait for your own on the present ROS_DOMAIN_ID",
    )


def replay_through_topics(options: argparse.Namespace) -> bool:
    """Do what the options say, and tell what it has shown; whether they say anything.

    Raises:
        ReplayError: something differs that should not.
        ActuatedCharactersError: an option or the bag cannot be used, or a process failed.
    """
    if options.through_topics == _SIMULATOR:
        _replay_states(options)
        return True
    for name, is_given in (
        ("--character", options.character is not None),
        ("--set", bool(options.set)),
        ("--no-start", options.no_start),
    ):
        if is_given:
            raise ConfigurationError(f"{name} is for --through-topics {_SIMULATOR}")
    if options.through_topics is None:
        return False
    _replay_commands(options)
    return True


def _replay_commands(options: argparse.Namespace) -> None:
    from actuated_characters.bags.recording import read_recordings
    from actuated_characters.replay.through_topics import replay_commands
    from actuated_characters.replay.world import worlds

    for number, together in enumerate(worlds(read_recordings(options.bag))):
        started = time.monotonic()
        with _progress_bar(options.bag, len(together[0].stamps_ns)) as (count, tell):
            result = replay_commands(
                options.bag, progress=count, tell=tell, tolerance=options.tolerance, world=number
            )
        for note in result.notes:
            print(f"note: {note}")
        if result.difference is not None:
            raise difference_error(options.bag, together, result.difference)
        tail = f"through topics in {time.monotonic() - started:.1f} s"
        print(verdict(together, result, options.tolerance, tail))


def _replay_states(options: argparse.Namespace) -> None:
    from actuated_characters.bags.recording import read_recording, read_recordings
    from actuated_characters.replay.through_topics import replay_states

    settings = node_settings(options.set, [_NODE])[_NODE]
    if options.no_start and settings:
        raise ConfigurationError("--set is for the controller that --no-start does not start")
    if options.no_start or options.character is not None:
        recordings = [read_recording(options.bag, options.character)]
    else:
        recordings = list(read_recordings(options.bag))
    if options.no_start:
        print(f"ROS_DOMAIN_ID={os.environ.get('ROS_DOMAIN_ID') or 0}", flush=True)
    for recording in recordings:
        with _progress_bar(options.bag, len(recording.stamps_ns)) as (count, tell):
            findings = replay_states(
                options.bag,
                progress=count,
                tell=tell,
                character=recording.name,
                settings=settings,
                start=not options.no_start,
            )
        _tell(options, recording, findings)


def _tell(options: argparse.Namespace, recording: "Recording", findings: "CommandFindings") -> None:
    """Print what was found. Raises ReplayError if commands differ that should not."""
    answers = f"the commands that answer {findings.states} states of {named(recording)}"
    if findings.identical:
        print(f"identical: {answers}")
        return
    first = findings.first or f"nothing commands {', '.join(findings.lacking)} any more"
    if findings.first is not None:
        Console().print(_table(findings))
        print(f"largest difference: {findings.largest}")
    if options.tolerance is not None and findings.within(options.tolerance):
        print(f"within {options.tolerance:g}: {answers}")
    elif options.set:  # they are to differ
        print(f"first difference: {first}")
    else:
        raise difference_error(options.bag, [recording], first)


def _table(findings: "CommandFindings") -> Table:
    table = Table(title="differences of effort, N m or N", title_justify="left")
    table.add_column("joint")
    for column in ("mean", "largest", "mean of the recorded"):
        table.add_column(column, justify="right")
    for joint in findings.joints:
        numbers = (joint.mean, joint.largest, joint.recorded)
        table.add_row(joint.name, *(f"{number:.4g}" for number in numbers))
    return table


@contextmanager
def _progress_bar(bag: Path, states: int) -> Iterator[tuple["Count", "Tell"]]:
    """A progress bar: what is told how far it is, and what is told what it waits for."""
    bar = progress_bar(bag.name, states, "states", transient=True)
    with bar:
        yield (
            lambda count: bar.update(bar.task_ids[0], completed=count),
            lambda line: bar.console.print(line, markup=False, highlight=False, soft_wrap=True),
        )
