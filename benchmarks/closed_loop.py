"""The closed loop of simulator and controller: in one process, over topics, and composed."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import numpy as np

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan
from benchmarks.support.nodes import Nodes
from benchmarks.support.timing import TickTimes

WALK: Mapping[str, object] = {"reference": "clip", "clip": "walk"}
"""What a humanoid tracks that is measured."""

_WARM_UP = 200  # ticks
_REPORTED = ("tick_us_p50", "tick_us_p99", "ticks_per_s")


def in_process(plan: RunPlan) -> TickTimes:
    """What a tick of a plan takes without ROS."""
    ticks = ticks_in_process(plan)
    next(ticks)  # builds the world, too
    times, worked_before = [time.perf_counter()], time.process_time()
    for _ in ticks:
        times.append(time.perf_counter())
    return TickTimes.of(np.diff(times), time.process_time() - worked_before)


def over_topics(plan: RunPlan, *, composed: bool = False) -> list[dict[str, str]]:
    """What the simulator reports in a run without a recorder, to the end.

    Its nodes have two processes, or one if they are `composed`.
    """
    with Nodes() as nodes:
        nodes.start_loop(plan.simulator, plan.controller, composed=composed)
        nodes.wait_until(lambda: nodes.tick > plan.ticks)
        return nodes.reports


def tick_over_topics(plan: RunPlan, *, composed: bool = False, is_busy: bool = False) -> TickTimes:
    """What a tick of a plan takes over topics; `is_busy`: beside a busy loop for each processor."""
    # Without an end of its own: the processor time of a process that has ended is not known.
    simulator = {**plan.simulator, "max_ticks": 0}
    with Nodes() as nodes:
        nodes.start_loop(simulator, plan.controller, composed=composed)
        nodes.wait_until(lambda: nodes.tick > _WARM_UP)
        with _busy_loops(os.cpu_count() or 1 if is_busy else 0):
            begun = len(nodes.reports)
            nodes.wait_until(lambda: len(nodes.reports) > begun)
            first, worked_before = nodes.tick, nodes.loop_processor_time()
            nodes.wait_until(lambda: nodes.tick > first + plan.ticks)
            worked = nodes.loop_processor_time() - worked_before
        report, ticks = nodes.reports[-1], nodes.tick - first
    p50_us, p99_us, per_second = (float(report[key]) for key in _REPORTED)
    return TickTimes(p50_us, p99_us, per_second, 1e6 * worked / ticks)


@contextmanager
def _busy_loops(count: int) -> Iterator[None]:
    # In sessions of their own, for among those Linux divides a busy machine's time.
    loops = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"], start_new_session=True)
        for _ in range(count)
    ]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()
