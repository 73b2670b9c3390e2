"""Which clips are reconstructed with joint torques alone: `python -m benchmarks.samcon_clips`.

A row a clip: of how many seeds it was done to its end, and how well. It takes hours.
"""

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from msgs_config.process import limit_threads

limit_threads()

import numpy as np  # noqa: E402 - after the limit on threads
from rich.console import Console  # noqa: E402
from rich.table import Table  # noqa: E402

from controller_node.references.corrected_file import read_reconstruction  # noqa: E402
from experiment.samcon.problem import Problem  # noqa: E402
from experiment.samcon.reconstruction import Job, duration_of, reconstruct  # noqa: E402
from experiment.samcon.settings import preset  # noqa: E402
from experiment.samcon.verification import Figures  # noqa: E402
from msgs_config.errors import RunError  # noqa: E402

CLIPS = [
    *("walk", "walk:2", "walk:4", "run", "run:2", "jump", "kick"),
    *("cartwheel", "roll", "spin", "spinkick", "dance_a"),
]
CENTRE_ERROR, JOINT_ERROR = 0.15, 0.30  # m, rad; what counts as done is not farther away


@dataclass(frozen=True)
class Attempt:
    """What has become of a clip with one seed."""

    figures: Figures | None  # None: it failed
    reached: float  # share of the windows

    @property
    def done(self) -> bool:
        """Whether it is what was wanted."""
        return (
            self.figures is not None
            and not self.figures.fell
            and self.figures.centre_error_mean_m <= CENTRE_ERROR
            and self.figures.joint_error_mean_rad <= JOINT_ERROR
        )


def main() -> int:
    """Reconstruct clips with some seeds, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "clips", nargs="*", default=CLIPS, help=f"or CLIP:CYCLES ({' '.join(CLIPS)})"
    )
    parser.add_argument("--seeds", type=int, default=5, help="(%(default)s)")
    parser.add_argument("--samples", type=int, default=1000, help="a window (%(default)s)")
    parser.add_argument("--workers", type=int, default=1, help="processes (%(default)s)")
    options = parser.parse_args()
    console = Console(width=100)
    table = Table(title=f"{options.samples} samples a window", title_justify="left")
    for column in ("clip", "done", "to its end", "reached", "centre, m", "joints, rad"):
        table.add_column(column, justify="right" if column != "clip" else "left")
    for clip, (name, cycles) in [(clip, _parsed(clip)) for clip in options.clips]:
        attempts = []
        for seed in range(1, options.seeds + 1):
            attempts.append(_attempt(name, cycles, seed, options.samples, options.workers))
            console.print(f"{clip}, seed {seed}: {attempts[-1]}")
        table.add_row(clip, *_row(attempts))
    console.print(table)
    return 0


def _parsed(clip: str) -> tuple[str, int]:
    """The name and the cycles that CLIP or CLIP:CYCLES says."""
    name, _, cycles = clip.partition(":")
    if cycles and not cycles.isdecimal():
        raise SystemExit(f"{clip}: write it as CLIP or CLIP:CYCLES, such as walk:4")
    return name, int(cycles or 1)


def _attempt(clip: str, cycles: int, seed: int, samples: int, workers: int) -> Attempt:
    settings = preset("humanoid", clip, samples=samples, seed=seed)
    duration = duration_of("humanoid", clip, cycles)
    problem = Problem.of("humanoid", clip, duration, settings)
    with tempfile.TemporaryDirectory() as directory:
        output = Path(directory) / "motion.json"
        try:
            found = reconstruct(Job(problem, cycles, settings, output, workers))
        except RunError:
            costs = read_reconstruction(output)["costs"]
            return Attempt(None, len(costs) * settings.window / duration)
    return Attempt(found.figures, 1.0)


def _row(attempts: list[Attempt]) -> list[str]:
    figures = [attempt.figures for attempt in attempts if attempt.figures is not None]
    centre = [figure.centre_error_mean_m for figure in figures]
    joints = [figure.joint_error_mean_rad for figure in figures]
    return [
        f"{sum(attempt.done for attempt in attempts)} of {len(attempts)}",
        f"{len(figures)} of {len(attempts)}",
        f"{100.0 * np.mean([attempt.reached for attempt in attempts]):.0f} %",
        f"{np.mean(centre):.3f}" if centre else "-",
        f"{np.mean(joints):.3f}" if joints else "-",
    ]


if __name__ == "__main__":
    sys.exit(main())
