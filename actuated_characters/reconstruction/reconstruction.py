"""A reconstruction from its beginning, or its checkpoint, to a file that is verified."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from actuated_characters.reconstruction.checkpoint import (
    checkpoint_path,
    read_checkpoint,
    write_checkpoint,
)
from actuated_characters.reconstruction.problem import Problem
from actuated_characters.reconstruction.search import Progress, SearchSettings, result, search
from actuated_characters.reconstruction.tree import Node
from actuated_characters.reconstruction.verification import ReconstructionMetrics, verified
from actuated_characters.reconstruction.workers import Workers
from actuated_characters.runs.plan import RunPlan
from controller_node.references.files.reconstructed import PLAN, RECONSTRUCTION
from controller_node.references.offsets import RecordedPlan
from msgs_config.arrays import FloatArray
from msgs_config.clips.reading import clip_path
from msgs_config.errors import RunError
from msgs_config.whole_files import write_whole


@dataclass(frozen=True)
class Reconstruction:
    """What has been reconstructed."""

    metrics: ReconstructionMetrics
    windows: int
    positions: FloatArray  # (t, n) after each tick
    desired: FloatArray  # (t, n) the motion's own


@dataclass(frozen=True)
class Job:
    """What is to be reconstructed, how, and into which file."""

    problem: Problem
    settings: SearchSettings
    output: Path
    workers: int = 1
    resume: bool = False
    scheduler: str | None = None  # the address of a cluster's, which grows the worlds

    @property
    def key(self) -> dict[str, Any]:
        """What a checkpoint must agree on."""
        return {**asdict(self.problem), **self.settings.content()}


def reconstruct(
    job: Job, report: Callable[[Progress, int], None] = lambda *_: None
) -> Reconstruction:
    """Search, write the file, and run it from a fresh world.

    `report` is told the progress and the number of windows. The checkpoint is removed when all is
    done, and stays in any other case.

    Raises:
        RunError: it failed too often without getting any further; the file has what was found
            until there.
        SimulationError: the file's run is not what was found.
        ActuatedCharactersError: a name or value is wrong.
    """
    checkpoint, plan = checkpoint_path(job.output), job.problem.plan()
    window = max(round(job.settings.window * plan.simulation.rate_hz), 1)
    windows = -(-plan.ticks // window)
    progress = read_checkpoint(checkpoint, job.key) if job.resume else Progress([])

    def after_window(progress: Progress) -> None:
        write_checkpoint(checkpoint, job.key, progress)
        report(progress, windows)

    report(progress, windows)
    with Workers(job.problem, window, job.workers, job.scheduler) as workers:
        stuck_at = search(workers, windows, job.settings, progress, after_window)
    best = result(progress)
    if best is None:
        raise RunError("all worlds were lost in the first window; nothing was written")
    _write(job, plan, best, None)
    if stuck_at is not None:
        raise RunError(
            f"{job.settings.tries} failures without getting any further, at last at window "
            f"{stuck_at + 1} of {windows}; {job.output} has the best attempt, "
            f"{best.tick / plan.simulation.rate_hz:.2f} s long; --resume tries again"
        )
    found = verified(job.problem, job.output, best)
    _write(job, plan, best, found.metrics)
    checkpoint.unlink(missing_ok=True)
    return Reconstruction(found.metrics, windows, found.positions, found.desired)


def _write(job: Job, plan: RunPlan, best: Node, metrics: ReconstructionMetrics | None) -> None:
    """Write the file: the clip, the plan that keeps it, and what they are of."""
    problem, rate = job.problem, plan.simulation.rate_hz
    delay = plan.simulation.command_delay_ticks
    made, last = [part for node in best.path for part in node.plans], best.tick + delay
    following = [*(tick for tick, _ in made[1:]), last]
    parts = tuple(
        (tick, offsets.during(tick, then - tick))
        for (tick, offsets), then in zip(made, following, strict=True)
    )
    found = RecordedPlan(rate, last, parts)
    clip = json.loads(clip_path(plan.character, problem.clip).read_text(encoding="utf-8"))
    content = {
        "Loop": clip["Loop"],
        PLAN: found.content(plan.character.layout.dof_names[6:]),
        RECONSTRUCTION: {
            "character": problem.character,
            "clip": problem.clip,
            "duration": problem.duration if best.tick == plan.ticks else best.tick / rate,
            "parameters": {
                "sim_node": dict(problem.simulator),
                "controller_node": problem.played_with,
            },
            "pushes": list(problem.pushes),
            "settings": job.settings.content(),
            "costs": [node.cost for node in best.path],
            "figures": None if metrics is None else asdict(metrics),
        },
        "Frames": clip["Frames"],
    }
    write_whole(job.output, json.dumps(content, allow_nan=False) + "\n")
