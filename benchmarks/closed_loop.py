"""The closed loop of simulator and controller: in one process, over topics, and composed."""

import time

import numpy as np

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan
from benchmarks.support.nodes import Nodes
from msgs_config.arrays import FloatArray
from msgs_config.messages import topics


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
        if composed:
            nodes.start_composed(plan.simulator, plan.controller)
            nodes.wait_until(lambda: nodes.reports and int(nodes.reports[-1]["tick"]) > plan.ticks)
            return nodes.reports
        nodes.start(topics.SIM_NODE, plan.simulator)
        if not plan.simulator["wait_for_subscribers"]:
            nodes.wait_until(lambda: nodes.reports)  # the simulator's reports are heard from now on
        nodes.start(topics.CONTROLLER_NODE, plan.controller)
        nodes.wait_until(lambda: nodes.reports and int(nodes.reports[-1]["tick"]) > plan.ticks)
        return nodes.reports
