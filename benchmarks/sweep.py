"""What a sweep costs beside its runs: processor time of the command, and of the same runs alone.

Both go side by side, so that whatever else the machine does counts for both alike.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from actuated_characters.commands.common.row_runs import asked_run, row_options
from actuated_characters.sweep.file import read_sweep
from actuated_characters.sweep.row import FIGURES, RowTask, compute
from benchmarks.support.machine import describe_machine
from benchmarks.support.printed import make_table

_FILE = "run: {{clip: walk, duration: {seconds:g}}}\nseeds: {rows}\n"
_ALONE = "--alone"


def main() -> None:
    """Measure, and print the table; `--alone FILE` is how it calls itself for the runs alone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=100, help="of the sweep (%(default)s)")
    parser.add_argument("--seconds", type=float, default=5.0, help="of each run (%(default)g)")
    parser.add_argument("--workers", type=int, nargs="*", default=[1, 2], help="(%(default)s)")
    parser.add_argument(_ALONE, type=Path, metavar="FILE", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.alone is not None:
        _run_alone(options.alone)
        return
    title = f"{options.rows} runs of {options.seconds:g} s; {describe_machine()}"
    table = make_table(title, ("workers", "sweep, processor time", "the runs alone", "ratio"))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "sweep.yaml"
        file.write_text(_FILE.format(seconds=options.seconds, rows=options.rows), "utf-8")
        for workers in options.workers:
            output = ["--output", f"{folder}/{workers}", "--workers", str(workers)]
            sweep = _start(["-m", "actuated_characters.cli", "sweep", str(file), *output])
            alone = _start(["-m", "benchmarks.sweep", _ALONE, str(file)])
            spent, runs = _processor_time(sweep), _processor_time(alone)
            table.add_row(str(workers), f"{spent:.1f} s", f"{runs:.1f} s", f"{spent / runs:.2f}")
    Console().print(table)


def _run_alone(file: Path) -> None:
    """Run the rows of a file one after the other."""
    for row in read_sweep(file, row_options(), FIGURES).rows():
        assert not compute(RowTask(row.number, row.arguments, "none", file.parent), asked_run).error


def _start(arguments: Sequence[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL)


def _processor_time(process: subprocess.Popen[bytes]) -> float:
    """Processor time of a process and all that it has started, s; waits for its end."""
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    main()
