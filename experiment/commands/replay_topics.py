"""`replay --through-topics`: the bag in the place of the controller, or of the simulator."""

import argparse
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import yaml
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
from rich.table import Table

from msgs_config.errors import ConfigurationError, ReplayError

if TYPE_CHECKING:  # they take a second to import
    from experiment.bags.recording import Recording
    from experiment.replay.comparison import ReplayResult
    from experiment.replay.player_findings import CommandFindings
    from experiment.replay.player_processes import Progress as Count
    from experiment.replay.player_processes import Tell

_CONTROLLER, _SIMULATOR = "controller", "simulator"
_SET = "controller_node."


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
    options.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="controller_node.NAME:=VALUE",
        help="simulator: another value of a parameter of the bag's controller, to see what that "
        "changes; may be repeated",
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
    from experiment.bags.recording import read_recordings
    from experiment.replay.through_topics import replay_commands
    from experiment.replay.world import worlds

    for number, together in enumerate(worlds(read_recordings(options.bag))):
        started = time.monotonic()
        with _progress_bar(options.bag, len(together[0].stamps_ns)) as (count, tell):
            result = replay_commands(
                options.bag, progress=count, tell=tell, tolerance=options.tolerance, world=number
            )
        for note in result.notes:
            print(f"note: {note}")
        if result.difference is not None:
            raise ReplayError(f"{options.bag}: {result.difference}")
        print(_verdict(together, result, options.tolerance, time.monotonic() - started))


def _verdict(
    together: "Sequence[Recording]",
    result: "ReplayResult",
    tolerance: float | None,
    wall_time: float,
) -> str:
    """What a replay has shown, in one line."""
    names = " and ".join(_named(recording) for recording in together)
    episodes = f"{result.episodes} episode{'s' * (result.episodes != 1)}"
    head = f"{result.states} states of {names}, {episodes}"
    tail = f"through topics in {wall_time:.1f} s"
    if tolerance is None:
        hashes = ", ".join(
            f"of {name} {digest}" if name else digest
            for name, digest in result.state_hashes.items()
        )
        return f"identical: {head}, state hash {hashes}; {tail}"
    largest = ", ".join(f"{value:.3g} {unit}" for unit, value in sorted(result.largest.items()))
    return f"within {tolerance:g}: {head}, largest differences {largest}; {tail}"


def _named(recording: "Recording") -> str:
    character = recording.character.name
    return f"{recording.name} ({character})" if recording.name else character


def _replay_states(options: argparse.Namespace) -> None:
    from experiment.bags.recording import read_recording, read_recordings
    from experiment.replay.through_topics import replay_states

    settings = _settings(options.set)
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
    answers = f"the commands that answer {findings.states} states of {_named(recording)}"
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
        raise ReplayError(f"{options.bag}: {first}")


def _table(findings: "CommandFindings") -> Table:
    table = Table(title="differences of effort, N m or N", title_justify="left")
    table.add_column("joint")
    for column in ("mean", "largest", "mean of the recorded"):
        table.add_column(column, justify="right")
    for joint in findings.joints:
        numbers = (joint.mean, joint.largest, joint.recorded)
        table.add_row(joint.name, *(f"{number:.4g}" for number in numbers))
    return table


def _settings(texts: Sequence[str]) -> dict[str, object]:
    """What `--set controller_node.NAME:=VALUE` says; values are YAML."""
    settings: dict[str, object] = {}
    for text in texts:
        name, assigns, value = text.partition(":=")
        if not (assigns and name.startswith(_SET) and len(name) > len(_SET)):
            raise ConfigurationError(f"--set {text}: write it as {_SET}NAME:=VALUE")
        try:
            settings[name.removeprefix(_SET)] = yaml.safe_load(value)
        except (yaml.YAMLError, ValueError, RecursionError) as error:
            raise ConfigurationError(f"--set {text}: the value is not valid YAML") from error
    return settings


@contextmanager
def _progress_bar(bag: Path, states: int) -> Iterator[tuple["Count", "Tell"]]:
    """A progress bar: what is told how far it is, and what is told what it waits for."""
    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("states"),
        console=Console(stderr=True),
        transient=True,
    )
    task = bar.add_task(bag.name, total=states)
    with bar:
        yield (
            lambda count: bar.update(task, completed=count),
            lambda line: bar.console.print(line, markup=False, highlight=False, soft_wrap=True),
        )
