"""Edits of a timeline: how soon a push that was changed at 8 s of 10 s is simulated again."""

import time
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml
from rich.console import Console

from actuated_characters.timeline.takes import takes_of
from actuated_characters.timeline.taking import make_take, plan_take
from benchmarks.support.printed import make_table
from benchmarks.support.ratios import Ratio

_EDITED = 8.0  # s
_FORCES = (20.0, 25.0, 30.0, 35.0)  # N: of the whole take, and of its edits
_CONTENT = {
    "duration": 10.0,
    "keys": [
        {
            "out": "never",
            "poses": [
                {"at": float(second), "pose": {"right_elbow": 0.5 + 0.1 * (second % 3)}}
                for second in range(10)
            ],
        }
    ],
}
_RUNS: dict[str, dict[str, object]] = {
    "planned": {},
    "with assistance": {
        "run": {"planner": "none"},
        "set": {"controller_node.root_assistance": True},
    },
}


def measure_editing(console: Console) -> list[Ratio]:
    """Measure and print the table; what an edit costs beside the whole take."""
    console.print("edits of a timeline: humanoid, 10 s ...")
    heading = ("", "whole take, wall s", "edit, wall s", "edit, CPU s")
    table, ratios = make_table(f"a push at {_EDITED:g} s of 10 s is changed", heading), []
    for name, run in _RUNS.items():
        with TemporaryDirectory() as directory:
            file = Path(directory) / "edited.yaml"
            whole, *edits = (_take(file, run, force) for force in _FORCES)
        wall, processor = min(edits)
        table.add_row(name, f"{whole[0]:.2f}", f"{wall:.2f}", f"{processor:.2f}")
        ratios.append(Ratio(f"edit, {name}", wall / whole[0], "wall, edit / whole take"))
    console.print(table)
    return ratios


def _take(file: Path, run: dict[str, object], force: float) -> tuple[float, float]:
    """Wall and CPU seconds of the next take, once the push has a force in N."""
    push = {"at": _EDITED, "link": "chest", "force": [force, 0.0, 0.0]}
    file.write_text(yaml.safe_dump({**_CONTENT, **run, "pushes": [push]}))
    started, used = time.perf_counter(), time.process_time()
    takes = takes_of(str(file))
    before = takes.all()
    take = make_take(plan_take(str(file), takes, before[-1] if before else None))
    assert (take.begin > 0.0) == bool(before)
    return time.perf_counter() - started, time.process_time() - used
