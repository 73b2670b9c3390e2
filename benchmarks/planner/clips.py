"""Which clips are kept by planning ahead, and how well: `python -m benchmarks.planner.clips`.

A row a clip, one cycle of it with each seed in one process, as over topics: how many came to the
end, and medians over the seeds. It takes half an hour on two cores. `--set` and `--mass` make the
world another one than the planner takes it for.
"""

import argparse
import re
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

from msgs_config.runtime.process import limit_threads

limit_threads()

import numpy as np  # noqa: E402 - after the limit on threads
import yaml  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.progress import track  # noqa: E402
from rich.table import Table  # noqa: E402

from actuated_characters.commands.common.settings import node_settings  # noqa: E402
from actuated_characters.metrics.error_measures import is_lost, joint_errors  # noqa: E402
from actuated_characters.runs.bare_loop import ticks_in_process  # noqa: E402
from actuated_characters.runs.plan import RunPlan, make_plan  # noqa: E402
from actuated_characters.runs.planned.wrenches import parse_pushes_within  # noqa: E402
from controller_node.parameters import make_controller  # noqa: E402
from msgs_config.character.dynamics import DynamicsModel  # noqa: E402
from msgs_config.character.loading import load_character  # noqa: E402
from msgs_config.clips.reading import available_clips, read_clip  # noqa: E402
from msgs_config.errors import (  # noqa: E402
    ActuatedCharactersError,
    ConfigurationError,
    SimulationError,
)

NODES = ("sim_node", "controller_node")


@dataclass(frozen=True)
class Attempt:
    """What has become of a clip with one seed."""

    centre_error: float  # m, mean over ticks
    joint_error: float  # rad, mean over ticks and actuated joints
    lost_at: float | None  # s


@dataclass(frozen=True)
class Task:
    """What is tried."""

    character: str
    world: str  # the character that is simulated, which the planner need not know
    clip: str
    seed: int
    duration: float | None  # s; None: a cycle
    settings: tuple[str, ...]
    pushes: tuple[str, ...]


def main() -> int:
    """Plan clips with some seeds, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clips", nargs="*", help="(all)")
    parser.add_argument("--character", default="humanoid", help="(%(default)s)")
    parser.add_argument("--seeds", type=int, default=5, help="(%(default)s)")
    parser.add_argument("--duration", type=float, help="s of each; else a cycle")
    parser.add_argument("--set", action="append", default=[], help="NODE.NAME:=VALUE, as of run")
    parser.add_argument("--push", action="append", default=[], help="LINK:FX,FY,FZ@S, as of run")
    parser.add_argument("--mass", type=float, help="factor on each link's, unknown to the planner")
    parser.add_argument("--processes", type=int, default=2, help="(%(default)s)")
    options = parser.parse_args()
    if min(options.seeds, options.processes) < 1:
        parser.error("--seeds and --processes must be 1 or more")
    with TemporaryDirectory() as folder:
        try:
            return _table(options, Path(folder))
        except ActuatedCharactersError as error:
            raise SystemExit(f"error: {error}") from error


def _table(options: argparse.Namespace, folder: Path) -> int:
    character = options.character
    clips = options.clips or available_clips(load_character(character))
    world = character if options.mass is None else _with_mass(character, options.mass, folder)
    settings, pushes = tuple(options.set), tuple(options.push)
    tasks = [
        Task(character, world, clip, seed, options.duration, settings, pushes)
        for clip in clips
        for seed in range(1, options.seeds + 1)
    ]
    console = Console(width=100)
    for task in tasks[:: options.seeds]:
        _plan(task, world)  # a mistake shows at once
    with ProcessPoolExecutor(options.processes, get_context("spawn")) as pool:
        done = list(track(pool.map(attempt, tasks), total=len(tasks), console=console))
    table = Table(title=f"seeds 1 to {options.seeds}", title_justify="left")
    for column in ("clip", "to the end", "centre of mass, m", "joints, rad", "lost at, s"):
        table.add_column(column, justify="right" if column != "clip" else "left")
    for number, clip in enumerate(clips):
        table.add_row(clip, *_row(done[number * options.seeds :][: options.seeds]))
    console.print(table)
    return 0


def attempt(task: Task) -> Attempt:
    """Track a clip until it is lost or ends."""
    plan, own = _plan(task, task.world), _plan(task, task.character)
    controller = make_controller(own.character, own.reference, own.controller)
    pushes = parse_pushes_within(task.pushes, plan)
    layout, rate = plan.character.layout, _rate(plan)
    centre = DynamicsModel(plan.character).centre_of_mass_at
    off, turns = [], []
    try:
        for number, tick in enumerate(ticks_in_process(plan, pushes, controller=controller), 1):
            got = tick.following.position
            wanted = plan.reference.sample(number / rate).configuration.position
            here, there = centre(got), centre(wanted)
            off.append(float(np.linalg.norm(here - there)))
            turns.append(float(joint_errors(layout, got[np.newaxis], wanted[np.newaxis]).mean()))
            if is_lost(here, there):
                return Attempt(float(np.mean(off)), float(np.mean(turns)), number / rate)
    except SimulationError:
        return Attempt(float(np.mean(off)), float(np.mean(turns)), len(off) / rate)
    return Attempt(float(np.mean(off)), float(np.mean(turns)), None)


def _with_mass(character: str, factor: float, folder: Path) -> str:
    """The file of a character whose links are heavier by a factor."""
    file = load_character(character).file
    content = yaml.safe_load(file.read_text("utf-8"))
    if content.get("inertia") != "shapes":
        raise ConfigurationError("--mass is for a character whose inertia is that of its shapes")
    urdf = load_character(character).loading.urdf_path
    text = re.sub(
        r'(<mass\s+value\s*=\s*")([^"]+)',
        lambda found: f"{found[1]}{factor * float(found[2])!r}",
        urdf.read_text("utf-8"),
    )
    (folder / urdf.name).write_text(text, "utf-8")
    (folder / file.name).write_text(yaml.safe_dump(content | {"urdf": urdf.name}), "utf-8")
    return str(folder / file.name)


def _plan(task: Task, character: str) -> RunPlan:
    settings = node_settings(task.settings, NODES)
    cycle = float(read_clip(load_character(character), task.clip).times[-1])
    return make_plan(
        character,
        task.duration or cycle,
        {"reference": "clip", "clip": task.clip},
        settings["sim_node"],
        {"planner": "predictive", "plan.workers": 1, "plan.seed": task.seed}
        | settings["controller_node"],
    )


def _rate(plan: RunPlan) -> int:
    return plan.simulation.rate_hz


def _row(attempts: Sequence[Attempt]) -> list[str]:
    failure_times = [f"{each.lost_at:.2f}" for each in attempts if each.lost_at is not None]
    return [
        f"{len(attempts) - len(failure_times)} of {len(attempts)}",
        f"{np.median([each.centre_error for each in attempts]):.3f}",
        f"{np.median([each.joint_error for each in attempts]):.3f}",
        " ".join(failure_times),
    ]


if __name__ == "__main__":
    sys.exit(main())
