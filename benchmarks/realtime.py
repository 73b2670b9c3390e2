"""How punctual the simulator is in real time at 1 kHz, with the controller over topics."""

from rich.console import Console
from rich.table import Table

from actuated_characters.runs.plan import make_plan
from benchmarks.closed_loop import over_topics
from benchmarks.support.ratios import Ratio

_CHARACTER, _RATE, _DURATION = "franka_panda", 1000, 20.0  # Hz, s


def measure_realtime(console: Console) -> list[Ratio]:
    """Measure and print the table; punctuality is no ratio of costs."""
    console.print(f"realtime: {_CHARACTER} for {_DURATION:g} s ...")
    settings: dict[str, object] = {"mode": "realtime", "rate": _RATE}
    plan = make_plan(_CHARACTER, _DURATION, {"reference": "hold"}, settings, {})
    plan.simulator["wait_for_subscribers"] = 1  # the world begins when its controller is there
    reports = over_topics(plan)
    last = reports[-1]
    ages = [float(r["command_age_ms"]) for r in reports if r["command_age_ms"] != "none"]
    rows = {
        "ticks": last["tick"],
        "ticks a second": last["ticks_per_s"],
        "a tick begins late by, p50 (µs)": last["late_us_p50"],
        "p99 (µs)": last["late_us_p99"],
        "p99.9 (µs)": last["late_us_p99.9"],
        "missed deadlines": last["missed_deadlines"],
        f"age of the commands, largest of {len(ages)} reports (ms)": f"{max(ages):g}",
        "commands held too long": last["command_timeouts"],
    }
    title = f"real time, {_CHARACTER} at {_RATE} Hz, two processes"
    table = Table(title=title, title_justify="left", show_header=False)
    for label, value in rows.items():
        table.add_row(label, value)
    console.print(table)
    return []
