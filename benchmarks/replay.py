"""How fast a recording is read and replayed, on one core."""

import tempfile
import time
from pathlib import Path

import numpy as np
from rich.console import Console

from actuated_characters.bags.recording import read_recordings
from actuated_characters.recorder.run_directory import prepare_directory
from actuated_characters.replay.replay import replay
from actuated_characters.runs.execution import run_over_topics
from actuated_characters.runs.plan import make_plan
from benchmarks.closed_loop import WALK
from benchmarks.support.printed import make_table
from benchmarks.support.ratios import Ratio
from benchmarks.support.timing import yardstick_us
from msgs_config.errors import ReplayError

_DURATION = 20.0  # s of simulated time


def measure_replay(console: Console) -> list[Ratio]:
    """Record a walk with all topics, replay it, and print the table; ratios to the yardstick.

    Raises:
        ReplayError: it did not come again.
    """
    console.print("replay: humanoid ...")
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder) / "run"
        prepare_directory(directory, overwrite=False)
        plan = make_plan("humanoid", _DURATION, WALK, {}, {})
        run_over_topics(plan, directory, write_bag=True)
        times = [time.process_time()]
        recordings = read_recordings(directory)
        times.append(time.process_time())
        result = replay(recordings)
        times.append(time.process_time())
    if result.difference is not None:
        raise ReplayError(str(result.difference))
    table = make_table("replay of a walk, one core", ("", "µs a tick", "real-time factor"))
    reading, repeating = (1e6 * float(taken) / plan.ticks for taken in np.diff(times))
    for label, us in (
        ("reading the bag", reading),
        ("torques against commands, simulation, comparison", repeating),
        ("together", reading + repeating),
    ):
        factor = f"{1e6 * _DURATION / (us * plan.ticks):.1f}"
        table.add_row(label, f"{us:.0f}", factor)
    console.print(table)
    unit = yardstick_us()
    return [
        Ratio("replay, reading", reading / unit, "a tick / yardstick"),
        Ratio("replay, repeating", repeating / unit, "a tick / yardstick"),
    ]
