"""The command `actuated_characters replay`: does what was recorded come again, to the last bit?"""

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.replay_topics import add_through_topics, replay_through_topics
from actuated_characters.commands.replay_verdict import difference_error, verdict
from msgs_config.errors import ConfigurationError, ReplayError

if TYPE_CHECKING:  # they take a second to import
    from actuated_characters.bags.recording import Recording
    from actuated_characters.replay.comparison import ReplayResult

_LARGEST_TOLERANCE = 1e6


def add_replay(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    parser = commands.add_parser(
        "replay",
        help="simulate a recorded run again, and compare every state to the last bit",
        description="Simulate a recorded run again, without ROS: the torques and pushes that were "
        "really applied, tick by tick, in the world that the recording describes. Every state is "
        "compared with the recorded one to the last bit, and the torques with the commands. Ends "
        "with code 0 if all is identical, else it says which tick and degree of freedom differ "
        "first.",
        epilog="example: actuated_characters replay runs/demo",
    )
    parser.set_defaults(command=_replay)
    parser.add_argument("bag", type=Path, metavar="BAG", help="a run's directory, or a bag")
    parser.add_argument(
        "--tolerance",
        type=float,
        metavar="X",
        help="let positions and velocities differ by so much (rad, m, rad/s, m/s; with "
        "--through-topics simulator commands, N m or N): for a bag from another machine, whose "
        "last bits may be other ones",
    )
    add_through_topics(parser)


def _replay(options: argparse.Namespace) -> None:
    tolerance = options.tolerance
    if tolerance is not None and not 0.0 <= tolerance <= _LARGEST_TOLERANCE:
        raise ConfigurationError(
            f"--tolerance is {tolerance}; it must be 0 to {_LARGEST_TOLERANCE:g}"
        )
    if replay_through_topics(options):
        return
    from actuated_characters.bags.recording import read_recordings
    from actuated_characters.replay.replay import replay, tick_count

    started = time.monotonic()
    recordings = read_recordings(options.bag)
    with progress_bar(options.bag.name, tick_count(recordings), "ticks", transient=True) as bar:
        result = replay(
            recordings,
            tolerance=tolerance,
            progress=lambda done: bar.update(bar.task_ids[0], completed=done),
        )
    for note in result.notes:
        print(f"note: {note}")
    if result.difference is not None:
        raise difference_error(options.bag, recordings, result.difference)
    if tolerance is None:
        _check_summaries(options.bag, recordings, result)
    simulated = max(float(recording.times[-1]) for recording in recordings)
    speed = simulated / (time.monotonic() - started)
    print(verdict(recordings, result, tolerance, f"{speed:.3g} times real time"))


def _check_summaries(bag: Path, recordings: "Sequence[Recording]", result: "ReplayResult") -> None:
    """Compare the hashes with those that the recorder has written beside the bag, if it has.

    They are of all that was heard: what was not replayed whole cannot be compared with them.
    """
    from actuated_characters.replay.world import common_rows, worlds
    from actuated_characters.runs.run_directory import figures_directory

    for together in worlds(recordings):
        rows, count = common_rows(together)
        for recording, row in zip(together, rows, strict=True):
            if row or count < len(recording.stamps_ns) or recording.skipped_states:
                continue
            is_alone = len(recordings) == 1 and not recording.world.name
            written = _written_hash(figures_directory(bag, recording.name, is_alone=is_alone))
            found = result.state_hashes[recording.name]
            if written not in (None, found):
                raise ReplayError(
                    f"{bag}: all states of the bag came again, but they are not those of the run: "
                    f"their hash is {found}, and in summary.json it is {written}"
                )


def _written_hash(directory: Path) -> str | None:
    from actuated_characters.runs.run_directory import SUMMARY

    try:
        content = json.loads((directory / SUMMARY).read_text(encoding="utf-8"))
        return str(content["state_hash"])
    except (OSError, ValueError, KeyError, TypeError):  # a bag alone, or of another recorder
        return None
