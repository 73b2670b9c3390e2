"""Sampling-based motion control: samples a second on one process and on two, for a walk."""

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.ratios import Ratio
from benchmarks.yardstick import yardstick_us
from experiment.samcon.problem import Problem
from experiment.samcon.reconstruction import Job, reconstruct
from experiment.samcon.settings import preset

_DURATION = 0.3  # s of the motion
_SAMPLES = 1000  # a window


@dataclass(frozen=True)
class Speed:
    """How fast a search went."""

    workers: int
    samples_a_second: float


def measure_samcon(console: Console) -> list[Ratio]:
    """Measure and print the table; what a sample costs, and what more processes add to it."""
    console.print("sampling-based motion control: humanoid, walk ...")
    counts = sorted({1, min(2, os.cpu_count() or 1), os.cpu_count() or 1})
    speeds = [_speed(workers) for workers in counts]
    title = f"reconstruct --clip walk: {_SAMPLES} samples a window of 0.1 s, 240 Hz, no look ahead"
    table = Table(title=title, title_justify="left")
    for column in ("processes", "samples / s", "times real time", "parallel efficiency"):
        table.add_column(column, justify="right")
    for speed in speeds:
        efficiency = speed.samples_a_second / (speed.workers * speeds[0].samples_a_second)
        table.add_row(
            str(speed.workers),
            f"{speed.samples_a_second:.0f}",
            f"{0.1 * speed.samples_a_second:.0f}",
            f"{efficiency:.2f}",
        )
    console.print(table)
    return _ratios(speeds)


def _ratios(speeds: list[Speed]) -> list[Ratio]:
    one, *others = speeds
    sample_us = 1e6 / one.samples_a_second
    ratios = [Ratio("search for a motion", sample_us / yardstick_us(), "sample / yardstick")]
    for speed in others:
        cost = speed.workers * one.samples_a_second / speed.samples_a_second
        how = "a sample's processor time / that in one process"
        ratios.append(Ratio(f"search for a motion, {speed.workers} processes", cost, how))
    return ratios


def _speed(workers: int) -> Speed:
    settings = preset("humanoid", "walk", samples=_SAMPLES, lookahead=0)
    problem = Problem.of("humanoid", "walk", _DURATION, settings)
    with tempfile.TemporaryDirectory() as directory:
        output = Path(directory) / "walk.json"
        found = reconstruct(Job(problem, 1, settings, output, workers))
    return Speed(workers, found.samples_a_second)
