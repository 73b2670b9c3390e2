"""Reconstruction: windows of worlds that plan, on one process and on two, for a walk."""

import os
import time
from collections.abc import Sequence

from rich.console import Console

from actuated_characters.reconstruction.problem import Problem
from actuated_characters.reconstruction.workers import Workers
from actuated_characters.reconstruction.world import Branch
from benchmarks.support.printed import make_table
from benchmarks.support.ratios import Ratio

_WINDOW = 24  # ticks, 0.1 s
_WORLDS = 8
_BRANCHES = [Branch(None, (seed,)) for seed in range(_WORLDS)]


def measure_reconstruction(console: Console) -> list[Ratio]:
    """Measure and print the table; what more processes add to the cost of a window."""
    console.print("reconstruction: humanoid, walk ...")
    counts = sorted({1, min(2, os.cpu_count() or 1), os.cpu_count() or 1})
    times = [_window_time(count) for count in counts]
    title = f"motion reconstruct --clip walk: a first window of 0.1 s of {_WORLDS} worlds, 240 Hz"
    table = make_table(title, ("processes", "wall time, s", "parallel efficiency"))
    for count, seconds in zip(counts, times, strict=True):
        table.add_row(str(count), f"{seconds:.1f}", f"{times[0] / (count * seconds):.2f}")
    console.print(table)
    return _ratios(counts[1:], times)


def _ratios(counts: Sequence[int], times: Sequence[float]) -> list[Ratio]:
    how = "a window's processor time / that in one process"
    return [
        Ratio(f"reconstruction, {count} processes", count * seconds / times[0], how)
        for count, seconds in zip(counts, times[1:], strict=True)
    ]


def _window_time(workers: int) -> float:
    """Wall time in s of a window, after one in which the processes begin."""
    problem = Problem("humanoid", "walk", 1.0)
    with Workers(problem, _WINDOW, workers) as pool:
        list(pool.grow(_BRANCHES[:workers]))
        began = time.perf_counter()
        list(pool.grow(_BRANCHES))
        return time.perf_counter() - began
