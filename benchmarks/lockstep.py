"""What lockstep over topics costs, beside a bare round trip and the loop in one process.

Of a tick over topics, (c) in two processes or (d) composed, what the loop in one process (b) takes
is no cost of the topics; the rest counts in bare round trips (a), in which another process is
woken twice.
"""

import numpy as np
from rich.console import Console
from rich.table import Table

from actuated_characters.runs.plan import RunPlan, make_plan
from benchmarks.closed_loop import WALK, in_process, over_topics
from benchmarks.support.printed import make_table
from benchmarks.support.ratios import Ratio
from benchmarks.support.round_trip import round_trips
from benchmarks.support.timing import timed
from msgs_config.arrays import FloatArray
from sim_node.physics.bullet.world import BulletWorld

_COUNT = 5000  # round trips
_DURATION = 20.0  # s of simulated time
_REFERENCES = {"pendulum": {"reference": "hold"}, "humanoid": WALK}


def measure_lockstep(console: Console) -> list[Ratio]:
    """Measure and print the table; the ratios for each character."""
    heading = ("", "p50", "p99", "ticks/s", "real-time factor")
    table = make_table("lockstep, one tick (µs)", heading)
    ratios = []
    for name, reference in _REFERENCES.items():
        console.print(f"lockstep: {name} ...")
        ratios += _measure(make_plan(name, _DURATION, reference, {}, {}), table)
    console.print(table)
    return ratios


def _measure(plan: RunPlan, table: Table) -> list[Ratio]:
    """Add the rows of one character; the ratios of a tick over topics to what it is made of."""
    name, rate = plan.character.name, plan.simulation.rate_hz
    layout = plan.character.layout
    with timed(BulletWorld, "step") as steps:
        in_process(plan)
    rows = {
        "(e) the engine's own step": _row(np.array(steps)),
        "(a) bare round trip, taken directly": _row(round_trips(layout, _COUNT, direct=True)),
        "(a') bare round trip, by executors": _row(round_trips(layout, _COUNT, direct=False)),
        "(b) in one process": _row(in_process(plan)),
        "(c) over topics": _reported(over_topics(plan)),
        "(d) over topics, composed": _reported(over_topics(plan, composed=True)),
    }
    for label, (p50, p99, per_second) in rows.items():
        factor = "" if label[:3] in ("(a)", "(a'", "(e)") else f"{per_second / rate:.1f}"
        table.add_row(f"{name} {label}", f"{p50:.0f}", f"{p99:.0f}", f"{per_second:.0f}", factor)
    engine, direct, _, joined, apart, composed = (values[0] for values in rows.values())
    return [
        Ratio(f"lockstep, {name}", apart / (joined + direct), "(c) / ((b) + (a))"),
        Ratio(f"two processes, {name}", (apart - joined) / direct, "((c) - (b)) / (a)"),
        Ratio(f"composed, {name}", (composed - joined) / direct, "((d) - (b)) / (a)"),
        Ratio(f"composed, {name}, all", composed / joined, "(d) / (b)"),
        Ratio(f"in one process, {name}", joined / engine, "(b) / (e)"),
    ]


def _reported(reports: list[dict[str, str]]) -> tuple[float, ...]:
    """The same of the simulator's own reports."""
    return tuple(float(reports[-1][key]) for key in ("tick_us_p50", "tick_us_p99", "ticks_per_s"))


def _row(durations: FloatArray) -> tuple[float, ...]:
    """Median and 99th percentile in microseconds, and how many a second, of durations in s."""
    p50, p99 = np.percentile(1e6 * durations, (50, 99))
    return float(p50), float(p99), float(1.0 / durations.mean())
