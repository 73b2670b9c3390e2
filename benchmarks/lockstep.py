"""What lockstep over topics costs, beside a bare round trip and the loop in one process.

Of a tick over topics, (c) in two processes or (d) composed, what the loop in one process (b) takes
is no cost of the topics; the rest counts in bare round trips (a), in which another process is
woken twice. (f) is (c) on a busy machine: beside a busy loop for each processor.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple

import numpy as np
from rich.console import Console

from actuated_characters.runs.plan import RunPlan, make_plan
from benchmarks.closed_loop import WALK, in_process, tick_over_topics
from benchmarks.support.machine import describe_machine
from benchmarks.support.printed import make_table
from benchmarks.support.ratios import Ratio
from benchmarks.support.round_trip import round_trips
from benchmarks.support.timing import TickTimes, timed_engine

_COUNT = 5000  # round trips
_DURATION = 20.0  # s of simulated time
_PAIRS = 3  # pairs of runs on a quiet machine and on a busy one
_REFERENCES = {"pendulum": {"reference": "hold"}, "humanoid": WALK}
_WHAT = {
    "e": "the engine's own step",
    "a": "bare round trip, taken directly",
    "a'": "bare round trip, by executors",
    "b": "in one process",
    "c": "over topics",
    "d": "over topics, composed",
    "f": "over topics, beside other work",
}
_LOOPS = "bcdf"
_RATIO_HEADING = ("", "median wall time", "ratio", "processor time", "ratio")

Times = Mapping[str, float]  # µs, by the letters of what was measured
Formula = Callable[[Times], float]
RATIOS: tuple[tuple[str, str, Formula], ...] = (
    ("lockstep, {}", "(c) / ((b) + (a))", lambda us: us["c"] / (us["b"] + us["a"])),
    ("two processes, {}", "((c) - (b)) / (a)", lambda us: (us["c"] - us["b"]) / us["a"]),
    ("composed, {}", "((d) - (b)) / (a)", lambda us: (us["d"] - us["b"]) / us["a"]),
    ("composed, {}, all", "(d) / (b)", lambda us: us["d"] / us["b"]),
    ("in one process, {}", "(b) / (e)", lambda us: us["b"] / us["e"]),
)
_BUSY: tuple[str, str, Formula] = (
    "two processes, {}, busy machine",
    "(f) / (c)",
    lambda us: us["f"] / us["c"],
)
"""Of processor times alone: by wall time other work takes its share of the machine."""


def measure_lockstep(console: Console) -> list[Ratio]:
    """Measure and print the tables; the ratios for each character."""
    machine = describe_machine()
    heading = ("", "p50", "p99", "ticks/s", "real-time factor", "processor time")
    ticks = make_table(f"lockstep, one tick (µs); {machine}", heading)
    ratio_table = make_table(f"ratios in lockstep, and of which µs; {machine}", _RATIO_HEADING)
    ratios = []
    for name, reference in _REFERENCES.items():
        console.print(f"lockstep: {name} ...")
        plan = make_plan(name, _DURATION, reference, {}, {})
        times = _measure(plan)
        for letter, each in times.items():
            rate = plan.simulation.rate_hz if letter in _LOOPS else None
            ticks.add_row(f"{name} ({letter}) {_WHAT[letter]}", *_cells(each, rate))
        wall = {letter: each.p50_us for letter, each in times.items()}
        worked = {letter: each.processor_us for letter, each in times.items()}
        for figure, how, formula in RATIOS:
            ratios.append(Ratio(figure.format(name), formula(wall), how))
            by_wall, by_work = (made_of(how, formula, us) for us in (wall, worked))
            ratio_table.add_row(f"{ratios[-1].figure}: {how}", *by_wall, *by_work)
        figure, how, formula = _BUSY
        ratios.append(Ratio(figure.format(name), formula(worked), f"{how}, processor time"))
        ratio_table.add_row(f"{ratios[-1].figure}: {how}", "", "", *made_of(how, formula, worked))
    console.print(ticks)
    console.print(ratio_table)
    return ratios


def _measure(plan: RunPlan) -> dict[str, TickTimes]:
    """The times of one character, by the letters of what was measured."""
    layout = plan.character.layout
    with timed_engine() as steps:
        in_process(plan)
    times = {
        "e": TickTimes.of(np.array(steps)),
        "a": round_trips(layout, _COUNT, direct=True),
        "a'": round_trips(layout, _COUNT, direct=False),
        "b": in_process(plan),
        "d": tick_over_topics(plan, composed=True),
    }
    pairs = [  # they take turns: the machine may be busier at times
        [tick_over_topics(plan, is_busy=is_busy) for is_busy in (False, True)]
        for _ in range(_PAIRS)
    ]
    for letter, runs in zip("cf", zip(*pairs, strict=True), strict=True):
        times[letter] = _median(runs)
    return {letter: times[letter] for letter in _WHAT}


def _median(runs: Sequence[TickTimes]) -> TickTimes:
    return TickTimes(*np.median([astuple(run) for run in runs], axis=0).tolist())


def _cells(times: TickTimes, rate: float | None) -> list[str]:
    """A row's cells; with the real-time factor if it is of ticks at that rate, Hz."""
    values = (times.p50_us, times.p99_us, times.per_second)
    factor = "" if rate is None else f"{times.per_second / rate:.1f}"
    worked = "" if math.isnan(times.processor_us) else f"{times.processor_us:.0f}"
    return [*(f"{value:.0f}" for value in values), factor, worked]


def made_of(how: str, formula: Formula, us: Times) -> tuple[str, str]:
    """A ratio's formula with numbers for its letters, and its value; empty if one is unknown."""
    value = formula(us)
    numbers = re.sub(r"\((\w)\)", lambda match: f"{us[match[1]]:.0f}", how)
    return ("", "") if math.isnan(value) else (numbers, f"{value:.2f}")
