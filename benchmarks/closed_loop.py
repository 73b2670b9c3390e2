"""The closed loop of simulator and controller: in one process, over topics, and composed."""

import time
from collections.abc import Mapping

import numpy as np

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan
from benchmarks.support.nodes import Nodes
from msgs_config.arrays import FloatArray

WALK: Mapping[str, object] = {"reference": "clip", "clip": "walk"}
"""What a humanoid tracks that is measured."""


def in_process(plan: RunPlan) -> FloatArray:
    """Durations (ticks,) in s of the ticks of a plan, without ROS."""
    times = [time.perf_counter()]
    for _ in ticks_in_process(plan):
        times.append(time.perf_counter())
    return np.diff(times)[1:]  # the first tick builds the world, too


def over_topics(plan: RunPlan, *, composed: bool = False) -> list[dict[str, str]]:
    """What the simulator reports in a run without a recorder, to the end.

    Its nodes have two processes, or one if they are `composed`.
    """
    with Nodes() as nodes:
        nodes.start_loop(plan.simulator, plan.controller, composed=composed)
        nodes.wait_until(lambda: nodes.tick > plan.ticks)
        return nodes.reports
