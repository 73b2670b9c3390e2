"""How fast a recording is read and replayed, on one core."""

import tempfile
import time
from pathlib import Path

from rich.console import Console
from rich.table import Table

from experiment.bags.recording import read_recordings
from experiment.figures import prepare_directory
from experiment.plan import make_plan
from experiment.replay.replay import replay
from experiment.run import run_over_topics
from msgs_config.errors import ReplayError

_DURATION = 20.0  # s of simulated time
_WALK: dict[str, object] = {"reference": "clip", "clip": "walk"}


def measure_replay(console: Console) -> None:
    """Record a walk with all topics, replay it, and print the table.

    Raises:
        ReplayError: it did not come again.
    """
    console.print("replay: humanoid ...")
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder) / "run"
        prepare_directory(directory, overwrite=False)
        plan = make_plan("humanoid", _DURATION, _WALK, {}, {})
        run_over_topics(plan, directory, write_bag=True, progress=lambda ticks: None)
        times = [time.process_time()]
        recordings = read_recordings(directory)
        times.append(time.process_time())
        result = replay(recordings)
        times.append(time.process_time())
    if result.difference is not None:
        raise ReplayError(str(result.difference))
    table = Table(title="replay of a walk, one core", title_justify="left")
    for column in ("", "µs a tick", "real-time factor"):
        table.add_column(column, justify="right" if column else "left")
    for label, seconds in (
        ("reading the bag", times[1] - times[0]),
        ("torques against commands, simulation, comparison", times[2] - times[1]),
        ("together", times[2] - times[0]),
    ):
        factor = f"{_DURATION / seconds:.1f}"
        table.add_row(label, f"{1e6 * seconds / plan.ticks:.0f}", factor)
    console.print(table)
