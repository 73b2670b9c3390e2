"""How well clips are reconstructed: `python -m benchmarks.planner.reconstructions`.

A row a clip, one cycle of it: errors, means over ticks, and the time that it took.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

from msgs_config.runtime.process import limit_threads

limit_threads()

from rich.console import Console  # noqa: E402 - after the limit on threads
from rich.table import Table  # noqa: E402

from actuated_characters.commands.common.settings import node_settings  # noqa: E402
from actuated_characters.reconstruction.problem import Problem, duration_of  # noqa: E402
from actuated_characters.reconstruction.reconstruction import Job, reconstruct  # noqa: E402
from actuated_characters.reconstruction.search import SearchSettings  # noqa: E402
from msgs_config.character.loading import load_character  # noqa: E402
from msgs_config.clips.reading import available_clips  # noqa: E402
from msgs_config.errors import RunError  # noqa: E402

CHARACTER = "humanoid"
NODES = ("sim_node", "controller_node")


def main() -> int:
    """Reconstruct clips, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    clips = available_clips(load_character(CHARACTER))
    parser.add_argument("clips", nargs="*", default=clips, help=f"({' '.join(clips)})")
    parser.add_argument("--seed", type=int, default=1, help="(%(default)s)")
    parser.add_argument("--worlds", type=int, default=SearchSettings.worlds, help="(%(default)s)")
    parser.add_argument("--kept", type=int, default=SearchSettings.survivors, help="(%(default)s)")
    parser.add_argument("--workers", type=int, default=2, help="processes (%(default)s)")
    parser.add_argument("--set", action="append", default=[], help="NODE.NAME:=VALUE, as of run")
    options = parser.parse_args()
    console = Console(width=100)
    table = Table(title=f"{options.worlds} worlds, seed {options.seed}", title_justify="left")
    for column in ("clip", "centre of mass, m", "joints, rad", "wall time, s"):
        table.add_column(column, justify="right" if column != "clip" else "left")
    for clip in options.clips:
        row = _row(clip, options)
        console.print(clip, *row)
        table.add_row(clip, *row)
    console.print(table)
    return 0


def _row(clip: str, options: argparse.Namespace) -> list[str]:
    """The errors of a clip, and the wall time, s."""
    given = node_settings(options.set, NODES)
    duration = duration_of(CHARACTER, clip, 1)
    problem = Problem(CHARACTER, clip, duration, given["sim_node"], given["controller_node"])
    settings = SearchSettings(options.worlds, options.kept, seed=options.seed)
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as directory:
        job = Job(problem, settings, Path(directory) / "motion.json", options.workers)
        try:
            metrics = reconstruct(job).metrics
        except RunError as error:
            return [str(error).partition(";")[0], "", f"{time.perf_counter() - began:.0f}"]
    return [
        f"{metrics.centre_error_mean_m:.3f}",
        f"{metrics.joint_error_mean_rad:.3f}",
        f"{time.perf_counter() - began:.0f}",
    ]


if __name__ == "__main__":
    sys.exit(main())
