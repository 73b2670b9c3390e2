"""How well a planned character goes where it is told to: `python -m benchmarks.planner.steering`.

A row a seed, by joint torques alone. A figure of eight in 60 s: from standing it is walked, then
run, then it stands again. And a stop: running at its largest speed it gets no further velocity.

The path error is the distance over the ground from the root to the course that the commands
prescribe, at the same tick; `beside` is that to the nearest point of the course, whenever it is
there. A character falls as `actuated_characters.metrics.falls` has it. It has stopped when the
speed of its root over the ground, mean over the 0.25 s around, stays below 0.15 m/s; that counts
from the timeout of the last velocity on, and in the figure of eight from the command to stop on.
All takes a quarter of an hour on two cores.
"""

import argparse
import math
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from multiprocessing import get_context

from msgs_config.runtime.process import limit_threads

limit_threads()

import numpy as np  # noqa: E402 - after the limit on threads
from rich.console import Console  # noqa: E402
from rich.progress import Progress  # noqa: E402
from rich.table import Table  # noqa: E402

from actuated_characters.commands.common.settings import node_settings  # noqa: E402
from actuated_characters.metrics.falls import FallWatch, PostureReader  # noqa: E402
from actuated_characters.runs.bare_loop import ticks_in_process  # noqa: E402
from actuated_characters.runs.plan import RunPlan, make_plan  # noqa: E402
from actuated_characters.runs.planned.velocities import plan_velocities  # noqa: E402
from benchmarks.planner.pushes import NODES  # noqa: E402
from controller_node.references.steering.reference import SteeredReference  # noqa: E402
from controller_node.references.steering.velocity import VelocityCommand  # noqa: E402
from msgs_config.arrays import FloatArray  # noqa: E402
from msgs_config.errors import ActuatedCharactersError, SimulationError  # noqa: E402

EIGHT = "1,0,0.4@1 1,0,-0.4@16.7 2.2,0,0.7@32.4 2.2,0,-0.7@41.4 0,0,0@50.4"
EIGHT_ENDS, EIGHT_LASTS = 50.4, 60.0  # s
DRIVEN, STOP_LASTS = 5.0, 10.0  # s
STANDS, OVER = 0.15, 0.25  # m/s, s: it stands if it is slower than this in the mean over that time
COLUMNS = ("seed", "fell at, s", "path error, m", "mean", "beside, m", "stop, s", "wall s per s")


@dataclass(frozen=True)
class Task:
    """What is tried: the figure of eight, or the stop."""

    seed: int
    is_eight: bool
    settings: tuple[str, ...]


@dataclass(frozen=True)
class DriveResult:
    """What has become of it; all numbers are of the time before a fall."""

    fell_at: float | None  # s
    largest: float  # m, of the path error
    mean: float  # m
    beside: float  # m, the largest distance of the root from the path
    stopped: float  # s after timeout or command; infinite if it has not
    wall: float  # s a simulated second


def attempt(task: Task) -> DriveResult:
    """Drive to the end, or to a fall."""
    plan = _plan(task)
    begun = time.monotonic()
    roots, fell = _roots(plan)
    wall = time.monotonic() - begun
    reference, rate = plan.reference, plan.simulation.rate_hz
    assert isinstance(reference, SteeredReference)
    courses = [reference.course(tick) for tick in range(1, len(roots) + 1)]
    course = np.array([(each.x, each.y) for each in courses])
    errors = np.linalg.norm(roots - course, axis=1)
    ends = EIGHT_ENDS if task.is_eight else DRIVEN + reference.limits.timeout
    return DriveResult(
        len(roots) / rate if fell else None,
        float(errors.max()),
        float(errors.mean()),
        max(float(np.linalg.norm(course - root, axis=1).min()) for root in roots[::12]),
        _stopped(roots[round(ends * rate) :], rate),
        wall * rate / len(roots),
    )


def _plan(task: Task) -> RunPlan:
    given = node_settings(task.settings, NODES)
    own = {"planner": "predictive", "plan.seed": task.seed, "plan.workers": 1}
    plan = make_plan(
        "humanoid",
        EIGHT_LASTS if task.is_eight else STOP_LASTS,
        {"reference": "steered"},
        given["sim_node"],
        own | given["controller_node"],
    )
    if task.is_eight:
        return plan_velocities(plan, EIGHT)[0]
    reference, rate = plan.reference, plan.simulation.rate_hz
    assert isinstance(reference, SteeredReference)
    for tick in range(0, round(DRIVEN * rate) + 1, rate // 10):
        command = VelocityCommand(tick, reference.limits.speed)
        reference = reference.steered(command, 0).reference
    return replace(plan, reference=reference)


def _roots(plan: RunPlan) -> tuple[FloatArray, bool]:
    """Places of the root on the ground (t, 2) m after each tick, and whether it fell at the end."""
    fall = FallWatch(PostureReader(plan.character), plan.simulation.rate_hz)
    roots: list[tuple[float, float]] = []
    try:
        for tick in ticks_in_process(plan):
            if fall.has_fallen(tick.state.position):
                return np.array(roots), True
            x, y = tick.following.position[:2].tolist()
            roots.append((x, y))
    except SimulationError:
        return np.array(roots), True
    return np.array(roots), False


def _stopped(roots: FloatArray, rate: int) -> float:
    """How long after the first row a root stands for good, s; infinite if it does not."""
    ticks = round(OVER * rate)
    moved = np.linalg.norm(roots[ticks:] - roots[:-ticks], axis=1)
    moves = np.flatnonzero(moved > STANDS * OVER)
    if len(moved) == 0 or (len(moves) and moves[-1] == len(moved) - 1):
        return math.inf
    return float(moves[-1] + 1 + ticks / 2) / rate if len(moves) else 0.0


def main() -> int:
    """Drive with each seed, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5, help="(%(default)s)")
    parser.add_argument("--set", action="append", default=[], help="NODE.NAME:=VALUE, as of run")
    parser.add_argument("--only", choices=("eight", "stop"), help="(both)")
    parser.add_argument("--processes", type=int, default=2, help="(%(default)s)")
    options = parser.parse_args()
    if min(options.seeds, options.processes) < 1:
        parser.error("--seeds and --processes must be 1 or more")
    kinds = [kind for kind in ("eight", "stop") if options.only in (None, kind)]
    seeds, settings = range(1, options.seeds + 1), tuple(options.set)
    tasks = [Task(seed, kind == "eight", settings) for kind in kinds for seed in seeds]
    console = Console(width=100)
    try:
        _plan(tasks[0])  # a mistake shows at once
        done = _attempts(tasks, options.processes, console)
    except ActuatedCharactersError as error:
        raise SystemExit(f"error: {error}") from error
    except KeyboardInterrupt:
        raise SystemExit(130) from None
    for number, kind in enumerate(kinds):
        console.print(_table(kind, done[number * len(seeds) :][: len(seeds)]))
    return 0


def _attempts(tasks: Sequence[Task], processes: int, console: Console) -> list[DriveResult]:
    """What has become of each task; says so as soon as it is known."""
    done = []
    with (
        get_context("spawn").Pool(
            processes, signal.signal, (signal.SIGINT, signal.SIG_IGN)
        ) as pool,
        Progress(console=console) as progress,
    ):
        bar = progress.add_task("drives", total=len(tasks))
        for task, drive in zip(tasks, pool.imap(attempt, tasks), strict=True):
            done.append(drive)
            kind = "eight" if task.is_eight else "stop"
            progress.print(f"{kind}, seed {task.seed}: {', '.join(_cells(drive))}")
            progress.advance(bar)
    return done


def _table(kind: str, drives: Sequence[DriveResult]) -> Table:
    table = Table(*COLUMNS, title=kind, title_justify="left")
    for seed, drive in enumerate(drives, 1):
        table.add_row(str(seed), *_cells(drive))
    return table


def _cells(drive: DriveResult) -> list[str]:
    return [
        "-" if drive.fell_at is None else f"{drive.fell_at:.2f}",
        f"{drive.largest:.2f}",
        f"{drive.mean:.2f}",
        f"{drive.beside:.2f}",
        f"{drive.stopped:.2f}",
        f"{drive.wall:.2f}",
    ]


if __name__ == "__main__":
    sys.exit(main())
