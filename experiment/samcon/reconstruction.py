"""A reconstruction from its beginning, or its checkpoint, to a file that is verified."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from controller_node.references.clip_file import clip_path, read_clip
from controller_node.references.corrected import Corrections
from controller_node.references.corrected_file import write_corrected
from experiment.samcon.checkpoint import checkpoint_path, read_checkpoint, write_checkpoint
from experiment.samcon.gain_space import Gains
from experiment.samcon.problem import Problem
from experiment.samcon.rollout import Rollout
from experiment.samcon.search import Failure, Progress, first_progress, result, search
from experiment.samcon.settings import Settings
from experiment.samcon.tree import Node
from experiment.samcon.verification import Figures, verified
from experiment.samcon.workers import Workers, rollout_of
from msgs_config.character_loading import load_character
from msgs_config.errors import ConfigurationError, RunError


@dataclass(frozen=True)
class Reconstruction:
    """What has been reconstructed."""

    figures: Figures
    cost: float  # mean of the windows
    windows: int
    samples: int
    samples_a_second: float  # of this process's run; of a resumed one, since it was resumed


@dataclass(frozen=True)
class Job:
    """What is to be reconstructed, how, and into which file."""

    problem: Problem
    cycles: int
    settings: Settings
    output: Path
    workers: int = 1
    cluster: str = ""
    resume: bool = False

    @property
    def key(self) -> dict[str, Any]:
        """What a checkpoint must agree on."""
        return {**asdict(self.problem), **self.settings.content()}

    def with_feedback(self, gains: Gains) -> "Job":
        """The same with another balance feedback."""
        return replace(
            self,
            problem=replace(self.problem, feedback=gains),
            settings=replace(self.settings, feedback=gains),
        )


def duration_of(character: str, clip: str, cycles: int) -> float:
    """How long some cycles of a clip last, s.

    Raises:
        ActuatedCharactersError: there is no such clip, or it does not go on from its end.
    """
    frames = read_clip(load_character(character), clip)
    if cycles < 1:
        raise ConfigurationError(f"--cycles is {cycles}; it must be 1 or more")
    if cycles > 1 and not frames.wraps:
        raise ConfigurationError(f"--cycles is {cycles}; the clip '{clip}' ends, it must be 1")
    return cycles * float(frames.times[-1])


def reconstruct(
    job: Job, report: Callable[[Progress, int, float], None] = lambda *_: None
) -> Reconstruction:
    """Search, write the file, and run it from a fresh world.

    `report` is told the progress, the number of windows and the samples a second so far. The
    checkpoint is removed when all is done, and stays in any other case.

    Raises:
        RunError: it failed too often without getting any further; the file has what was found
            until there.
        SimulationError: the file's run is not what was found.
        ActuatedCharactersError: a name or value is wrong.
    """
    checkpoint, key = checkpoint_path(job.output), job.key
    with Workers(job.problem, job.workers, job.cluster) as workers:
        rollout = rollout_of(job.problem)
        progress = first_progress(rollout)
        if job.resume:
            progress = read_checkpoint(checkpoint, key)
        pace = _Pace(progress.samples)

        def after_window(progress: Progress) -> None:
            write_checkpoint(checkpoint, key, progress)
            report(progress, len(rollout.windows), pace.after(progress.samples))

        report(progress, len(rollout.windows), 0.0)
        failure = search(rollout, workers, job.settings, progress, after_window)
        speed = pace.samples_a_second
        best, ends = result(progress, workers), rollout.windows.ends
        _write(job, rollout, best, progress, None)
    if failure is not None:
        raise RunError(_failed(job, failure, best, ends))
    figures = verified(job.problem, job.output, best)
    _write(job, rollout, best, progress, figures)
    checkpoint.unlink(missing_ok=True)
    cost = float(np.mean([node.cost for node in best.path]))
    return Reconstruction(figures, cost, len(best.path), progress.samples, speed)


class _Pace:
    """Samples a second, without the first window's, in which the processes begin."""

    def __init__(self, samples: int) -> None:
        self._marks = [(samples, time.perf_counter())]
        self.samples_a_second = 0.0

    def after(self, samples: int) -> float:
        """The pace after so many samples in all."""
        self._marks.append((samples, time.perf_counter()))
        (before, started), (now, ended) = self._marks[len(self._marks) > 2], self._marks[-1]
        self.samples_a_second = (now - before) / max(ended - started, 1e-9)
        return self.samples_a_second


def _write(
    job: Job, rollout: Rollout, best: Node, progress: Progress, figures: Figures | None
) -> None:
    """Write the file: the corrections, and what they are of."""
    character, path = rollout.plan.character, best.path
    reconstruction = {
        "character": job.problem.character,
        "clip": job.problem.clip,
        "cycles": job.cycles,
        "duration": job.problem.duration,
        "parameters": {
            "sim_node": dict(job.problem.simulator),
            "controller_node": {"root_assistance": False, **job.problem.controller},
        },
        "pushes": list(job.problem.pushes),
        "settings": job.settings.content(),
        "complete": len(path) == len(rollout.windows),
        "costs": [node.cost for node in path],
        "samples": progress.samples,
        "figures": None if figures is None else asdict(figures),
    }
    corrections = Corrections(rollout.windows.ends[: len(path)], best.offsets)
    write_corrected(
        job.output,
        clip_path(character, job.problem.clip),
        character.layout,
        corrections,
        reconstruction,
        job.problem.feedback,
        rollout.window_gains,
    )


def _failed(job: Job, failure: Failure, best: Node, ends: tuple[float, ...]) -> str:
    reached = ends[len(best.path) - 1] if best.path else 0.0
    costs = ", ".join("lost" if np.isinf(cost) else f"{cost:.3g}" for cost in failure.costs)
    return (
        f"{job.settings.tries} failures without getting any further, at last at window "
        f"{failure.window + 1} of {len(ends)} (its best samples cost: {costs}); "
        f"{job.output} has the best attempt, {reached:.2f} s long"
    )
