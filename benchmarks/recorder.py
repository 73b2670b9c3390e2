"""What the recorder takes: a share of a core, and how much slower the loop is beside it."""

import tempfile
import time
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from actuated_characters.runs.plan import RunPlan, make_plan
from benchmarks.support.nodes import Nodes, processor_time
from benchmarks.support.ratios import Ratio
from msgs_config.messages import topics

CHARACTER, RATE = "humanoid", 1000  # Hz
_DURATION = 6.0  # s of simulated time of one run
_REAL_TIME_DURATION = 10.0  # s
_PAIRS = 5  # of runs with and without a recorder


@dataclass(frozen=True)
class Timing:
    """What one run took."""

    ticks_per_s: float
    share: float  # of a core, that the recorder had; 0 without one


def walk(duration: float) -> RunPlan:
    """The run that is measured: the humanoid's walk by stable PD, at 1 kHz."""
    reference: dict[str, object] = {"reference": "clip", "clip": "walk"}
    return make_plan(CHARACTER, duration, reference, {"rate": RATE}, {})


def _real_time() -> RunPlan:
    """The same messages in real time, of a ragdoll: late efforts cannot make it diverge."""
    reference: dict[str, object] = {"reference": "clip", "clip": "walk"}
    simulator = {"rate": RATE, "mode": "realtime"}
    return make_plan(CHARACTER, _REAL_TIME_DURATION, reference, simulator, {"law": "zero"})


def time_run(plan: RunPlan, *, recorded: bool) -> Timing:
    """Run simulator and controller, with a recorder of everything or without."""
    with Nodes() as nodes, tempfile.TemporaryDirectory() as directory:
        recorder = None
        if recorded:
            recorder = nodes.start(topics.RECORDER_NODE, {"directory": directory})
        listeners = {"wait_for_subscribers": 1 + recorded}
        nodes.start(topics.CONTROLLER_NODE, {**plan.controller, **listeners})
        nodes.start(topics.SIM_NODE, {**plan.simulator, **listeners})
        nodes.wait_until(lambda: _tick(nodes) > 1)
        first, began = _tick(nodes), time.monotonic()
        busy = processor_time(recorder) if recorder else 0.0
        nodes.wait_until(lambda: _tick(nodes) > plan.ticks)
        taken = time.monotonic() - began
        used = processor_time(recorder) - busy if recorder else 0.0
        return Timing((_tick(nodes) - first) / taken, used / taken)


def _tick(nodes: Nodes) -> int:
    return int(nodes.reports[-1]["tick"]) if nodes.reports else 0


def measure_recorder(console: Console) -> list[Ratio]:
    """Measure and print the table; how much slower the loop is, and the recorder's share."""
    console.print(f"recorder: {CHARACTER} at {RATE} Hz, {_PAIRS} pairs of runs ...")
    plan = walk(_DURATION)
    without, beside = [], []
    for _ in range(_PAIRS):  # in turns: the machine may be busier at times
        without.append(time_run(plan, recorded=False))
        beside.append(time_run(plan, recorded=True))
    real_time = time_run(_real_time(), recorded=True)
    ratios = [a.ticks_per_s / b.ticks_per_s for a, b in zip(without, beside, strict=True)]
    share = _median([t.share for t in beside])
    rows = {
        "ticks a second without it": f"{_median([t.ticks_per_s for t in without]):.0f}",
        "beside it": f"{_median([t.ticks_per_s for t in beside]):.0f}",
        "slow-down": f"{_median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})",
        "its share of a core": f"{share:.0%}",
        f"in real time, {real_time.ticks_per_s:.0f} ticks a second": f"{real_time.share:.0%}",
    }
    title = f"recorder of all topics, {CHARACTER} at {RATE} Hz in lockstep, medians"
    table = Table(title=title, title_justify="left", show_header=False)
    for label, value in rows.items():
        table.add_row(label, value)
    console.print(table)
    return [
        Ratio("recorder, slow-down", _median(ratios), "a tick beside it / one without it"),
        Ratio("recorder, share", share, "its processor time / the run's"),
    ]


def _median(values: list[float]) -> float:
    return float(np.median(values))
