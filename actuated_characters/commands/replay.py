"""The command `actuated_characters replay`: does what was recorded come again, to the last bit?"""

import argparse
import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import (
    add_bag,
    add_command,
    add_repeated,
    node_settings,
)
from msgs_config.errors import ConfigurationError, ReplayError
from msgs_config.runtime.ros_environment import DISCOVERY_RANGE, LOCALHOST, is_discovery_off
from msgs_config.versions import describe_changes, installed_versions

if TYPE_CHECKING:  # they take a second to import
    from actuated_characters.bags.recording import Recording
    from actuated_characters.replay.command_comparison import CommandComparison
    from actuated_characters.replay.comparison import ReplayResult

_LARGEST_TOLERANCE = 1e6
_CONTROLLER, _SIMULATOR = "controller", "simulator"
_NODE = "controller_node"


def add_replay(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    parser = add_command(
        commands,
        _replay,
        "replay",
        "simulate a recorded run again, and compare every state to the last bit",
        "Simulate a recorded run again, without ROS: the torques and pushes that were "
        "really applied, tick by tick, in the world that the recording describes. Every state is "
        "compared with the recorded one to the last bit, and the torques with the commands. Ends "
        "with code 0 if all is identical, else it says which tick and degree of freedom differ "
        "first.",
        ["replay runs/demo"],
    )
    add_bag(parser)
    parser.add_argument(
        "--tolerance",
        type=float,
        metavar="X",
        help="let positions and velocities differ by so much (rad, m, rad/s, m/s; with "
        "--through-topics simulator commands, N m or N): for a bag from another machine, whose "
        "last bits may be other ones",
    )
    _add_through_topics(parser)


def _add_through_topics(parser: argparse.ArgumentParser) -> None:
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


def _replay(options: argparse.Namespace) -> None:
    tolerance = options.tolerance
    if tolerance is not None and not 0.0 <= tolerance <= _LARGEST_TOLERANCE:
        raise ConfigurationError(
            f"--tolerance is {tolerance}; it must be 0 to {_LARGEST_TOLERANCE:g}"
        )
    if options.through_topics == _SIMULATOR:
        _replay_states(options)
        return
    for name, is_given in (
        ("--character", options.character is not None),
        ("--set", bool(options.set)),
        ("--no-start", options.no_start),
    ):
        if is_given:
            raise ConfigurationError(f"{name} is for --through-topics {_SIMULATOR}")
    if options.through_topics == _CONTROLLER:
        _replay_commands(options)
    else:
        _replay_alone(options)


def _replay_alone(options: argparse.Namespace) -> None:
    """Replay a bag in this process."""
    from actuated_characters.bags.recording import read_recordings
    from actuated_characters.replay.replay import replay, tick_count

    started = time.monotonic()
    recordings = read_recordings(options.bag)
    with _progress(options.bag, tick_count(recordings), "ticks") as (count, _):
        result = replay(recordings, tolerance=options.tolerance, progress=count)
    _check_result(options, recordings, result)
    if options.tolerance is None:
        _check_summaries(options.bag, recordings, result)
    simulated = max(float(recording.times[-1]) for recording in recordings)
    speed = simulated / (time.monotonic() - started)
    print(_verdict(recordings, result, options.tolerance, f"{speed:.3g} times real time"))


def _replay_commands(options: argparse.Namespace) -> None:
    """Replay a bag with itself in the place of the controller, world by world."""
    from actuated_characters.bags.recording import read_recordings
    from actuated_characters.replay.through_topics import replay_commands
    from actuated_characters.replay.world import worlds

    for number, together in enumerate(worlds(read_recordings(options.bag))):
        started = time.monotonic()
        with _progress(options.bag, len(together[0].stamps_ns), "states") as (count, tell):
            result = replay_commands(
                options.bag, progress=count, tell=tell, tolerance=options.tolerance, world=number
            )
        _check_result(options, together, result)
        tail = f"through topics in {time.monotonic() - started:.1f} s"
        print(_verdict(together, result, options.tolerance, tail))


def _replay_states(options: argparse.Namespace) -> None:
    """Replay a bag with itself in the place of the simulator, character by character."""
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
        if is_discovery_off(os.environ):
            raise ConfigurationError(
                f"{DISCOVERY_RANGE} is OFF: the controller that --no-start waits for could not be "
                f"found; set it to {LOCALHOST} for both"
            )
        print(f"ROS_DOMAIN_ID={os.environ.get('ROS_DOMAIN_ID') or 0}", flush=True)
    for recording in recordings:
        with _progress(options.bag, len(recording.stamps_ns), "states") as (count, tell):
            comparison = replay_states(
                options.bag,
                progress=count,
                tell=tell,
                character=recording.name,
                settings=settings,
                start=not options.no_start,
            )
        _print_comparison(options, recording, comparison)


def _print_comparison(
    options: argparse.Namespace, recording: "Recording", comparison: "CommandComparison"
) -> None:
    """Print how commands differ. Raises ReplayError if they differ and should not."""
    answers = f"the commands that answer {comparison.states} states of {_named(recording)}"
    if comparison.identical:
        print(f"identical: {answers}")
        return
    first = comparison.first or f"nothing commands {', '.join(comparison.lacking)} any more"
    if comparison.first is not None:
        Console().print(_joint_table(comparison))
        print(f"largest difference: {comparison.largest}")
    if options.tolerance is not None and comparison.within(options.tolerance):
        print(f"within {options.tolerance:g}: {answers}")
    elif options.set:  # with --set the answers are to differ
        print(f"first difference: {first}")
    else:
        raise _difference_error(
            options.bag, [recording], first, *_changed_files(options, recording)
        )


def _changed_files(options: argparse.Namespace, recording: "Recording") -> list[str]:
    """What of a controller that was started here is not as it was when it was recorded."""
    from actuated_characters.replay.players.controller_parameters import changed_files

    return [] if options.no_start else changed_files(recording)


def _joint_table(comparison: "CommandComparison") -> Table:
    table = Table(title="differences of effort, N m or N", title_justify="left")
    table.add_column("joint")
    for column in ("mean", "largest", "mean of the recorded"):
        table.add_column(column, justify="right")
    for joint in comparison.joints:
        numbers = (joint.mean, joint.largest, joint.recorded)
        table.add_row(joint.name, *(f"{number:.4g}" for number in numbers))
    return table


def _check_result(
    options: argparse.Namespace, recordings: "Sequence[Recording]", result: "ReplayResult"
) -> None:
    """Print the notes of a replay. Raises ReplayError if states differ."""
    for remark in result.remarks:
        print(f"note: {remark}")
    if result.difference is not None:
        raise _difference_error(options.bag, recordings, result.difference)


def _difference_error(
    bag: Path, recordings: "Sequence[Recording]", difference: object, *causes: str
) -> ReplayError:
    """An error of one line: the first difference, and the versions that are not the recorded."""
    present = installed_versions()
    changes = dict.fromkeys(describe_changes(each.versions, present) for each in recordings)
    return ReplayError("; ".join(filter(None, [f"{bag}: {difference}", *causes, *changes])))


def _verdict(
    recordings: "Sequence[Recording]", result: "ReplayResult", tolerance: float | None, tail: str
) -> str:
    """One line on a replay without differences, which ends with `tail`."""
    names = " and ".join(_named(recording) for recording in recordings)
    episodes = f"{result.episodes} episode{'s' * (result.episodes != 1)}"
    head = f"{result.states} states of {names}, {episodes}"
    if tolerance is None:
        hashes = ", ".join(
            f"of {name} {digest}" if name else digest
            for name, digest in result.state_hashes.items()
        )
        return f"identical: {head}, state hash {hashes}; {tail}"
    largest = ", ".join(f"{value:.3g} {unit}" for unit, value in sorted(result.largest.items()))
    return f"within {tolerance:g}: {head}, largest differences {largest}; {tail}"


def _named(recording: "Recording") -> str:
    """A recording's character, and its name where it has one."""
    character = recording.character.name
    return f"{recording.name} ({character})" if recording.name else character


def _check_summaries(bag: Path, recordings: "Sequence[Recording]", result: "ReplayResult") -> None:
    """Compare the hashes with those that the recorder has written beside the bag, if it has.

    They are of all states that it received: of a part of them there is no hash to compare with.
    """
    from actuated_characters.recorder.run_directory import metrics_directory
    from actuated_characters.replay.world import cut_world, worlds

    for together in worlds(recordings):
        for recording, cut in zip(together, cut_world(together)[0], strict=True):
            if len(cut.stamps_ns) < len(recording.stamps_ns) or recording.skipped_states:
                continue
            is_alone = len(recordings) == 1 and not recording.world.name
            written = _written_hash(metrics_directory(bag, recording.name, is_alone=is_alone))
            found = result.state_hashes[recording.name]
            if written not in (None, found):
                raise ReplayError(
                    f"{bag}: all states of the bag came again, but they are not those of the run: "
                    f"their hash is {found}, and in summary.json it is {written}"
                )


def _written_hash(directory: Path) -> str | None:
    from actuated_characters.recorder.run_directory import SUMMARY

    try:
        content = json.loads((directory / SUMMARY).read_text(encoding="utf-8"))
        return str(content["state_hash"])
    except (OSError, ValueError, KeyError, TypeError):  # a lone bag, or another recorder's files
        return None


@contextmanager
def _progress(
    bag: Path, total: int, unit: str
) -> Iterator[tuple[Callable[[int], None], Callable[[str], None]]]:
    """A progress bar; yields functions that show how many are done, and print a line above it."""
    with progress_bar(bag.name, total, unit, transient=True) as bar:
        yield (
            lambda count: bar.update(bar.task_ids[0], completed=count),
            lambda line: bar.console.print(line, markup=False, highlight=False, soft_wrap=True),
        )
