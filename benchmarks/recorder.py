"""What the recorder takes: a share of a core, and how much slower the loop is beside it."""

import tempfile
import time
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from actuated_characters.runs.plan import RunPlan, make_plan
from benchmarks.closed_loop import WALK
from benchmarks.support.nodes import Nodes, processor_time
from benchmarks.support.ratios import Ratio
from msgs_config.messages import topics

CHARACTER, RATE = "humanoid", 1000  # Hz
_DURATION = 20.0  # s of simulated time of one run: several of the reports, one a second
_REAL_TIME_DURATION = 10.0  # s
_PAIRS = 5  # pairs of runs with and without a recorder


@dataclass(frozen=True)
class RunTiming:
    """What one run took."""

    ticks_per_s: float
    share: float  # share of a core that the recorder had; 0 without one


def walk(duration: float) -> RunPlan:
    """The run that is measured: the humanoid's walk by stable PD, at 1 kHz."""
    return make_plan(CHARACTER, duration, WALK, {"rate": RATE}, {})


def _real_time() -> RunPlan:
    """The same messages in real time, of a ragdoll: late efforts cannot make it diverge."""
    simulator = {"rate": RATE, "mode": "realtime"}
    return make_plan(CHARACTER, _REAL_TIME_DURATION, WALK, simulator, {"law": "zero"})


def time_run(plan: RunPlan, *, recorded: bool, composed: bool) -> RunTiming:
    """Run simulator and controller as `run` does, with a recorder of everything or without."""
    with Nodes() as nodes, tempfile.TemporaryDirectory() as directory:
        recorder = None
        if recorded:
            recorder = nodes.start(topics.RECORDER_NODE, {"directory": directory})
        listeners = {"wait_for_subscribers": 1 + recorded}
        simulator, controller = {**plan.simulator, **listeners}, {**plan.controller, **listeners}
        nodes.start_loop(simulator, controller, composed=composed)
        nodes.wait_until(lambda: nodes.tick > 1)
        first, began = nodes.tick, time.monotonic()
        busy = processor_time(recorder.pid) if recorder else 0.0
        nodes.wait_until(lambda: nodes.tick > plan.ticks)
        taken = time.monotonic() - began
        used = processor_time(recorder.pid) - busy if recorder else 0.0
        return RunTiming((nodes.tick - first) / taken, used / taken)


def measure_recorder(console: Console) -> list[Ratio]:
    """Measure and print the table; how much slower the loop is, and the recorder's share."""
    console.print(f"recorder: {CHARACTER} at {RATE} Hz, {_PAIRS} pairs of runs, two ways ...")
    plan = walk(_DURATION)
    pairs: dict[bool, list[tuple[RunTiming, RunTiming]]] = {True: [], False: []}
    for _ in range(_PAIRS):  # they take turns: the machine may be busier at times
        for composed, timings in pairs.items():
            without = time_run(plan, recorded=False, composed=composed)
            timings.append((without, time_run(plan, recorded=True, composed=composed)))
    real_time = time_run(_real_time(), recorded=True, composed=False)
    title = f"recorder of all topics, {CHARACTER} at {RATE} Hz in lockstep, medians"
    table = Table("", "composed", "two processes", title=title, title_justify="left")
    ratios = {composed: _slow_downs(timings) for composed, timings in pairs.items()}
    shares = {way: _median([beside.share for _, beside in runs]) for way, runs in pairs.items()}
    table.add_row("ticks a second without it", *(_ticks(runs, 0) for runs in pairs.values()))
    table.add_row("beside it", *(_ticks(runs, 1) for runs in pairs.values()))
    spans = [f"{_median(r):.2f} ({min(r):.2f} to {max(r):.2f})" for r in ratios.values()]
    table.add_row("slow-down", *spans)
    table.add_row("its share of a core", *(f"{share:.0%}" for share in shares.values()))
    label = f"in real time, {real_time.ticks_per_s:.0f} ticks a second"
    table.add_row(label, "", f"{real_time.share:.0%}")
    console.print(table)
    how = "a tick beside it / one without it"
    return [
        Ratio("recorder, slow-down", _median(ratios[False]), how),
        Ratio("recorder, slow-down, composed", _median(ratios[True]), how),
        Ratio("recorder, share", shares[False], "its processor time / the run's"),
    ]


def _slow_downs(timings: list[tuple[RunTiming, RunTiming]]) -> list[float]:
    return [without.ticks_per_s / beside.ticks_per_s for without, beside in timings]


def _ticks(timings: list[tuple[RunTiming, RunTiming]], which: int) -> str:
    return f"{_median([pair[which].ticks_per_s for pair in timings]):.0f}"


def _median(values: list[float]) -> float:
    return float(np.median(values))
