"""A run of a policy that is kept, with a picture and a film: what a training has come to."""

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path

from actuated_characters.bags.recording import read_recordings
from actuated_characters.recorder.run_directory import STRIP, VIDEO, prepare_directory
from actuated_characters.render.movie import Movie, MovieSettings
from actuated_characters.render.stills import save_png, strip
from actuated_characters.report.metrics_plot import plot_metrics
from actuated_characters.runs.in_process import run_in_process
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.training.exercises import Exercise
from msgs_config.runtime.extras import PACKAGES

_LONGEST_S = 10.0
_PICTURES = 8


def keep_run(
    exercise: Exercise,
    controller: Mapping[str, object],
    directory: Path,
    progress: Callable[[float], None],
    *,
    seed: int,
    overwrite: bool,
) -> list[Path]:
    """Run an exercise into a directory; returns its pictures, and a film where PyAV is installed.

    Args:
        exercise: What is played, for ten seconds at the most.
        controller: Parameters of the controller.
        directory: The run's.
        progress: Is called with the share that is done, 0 to 1.
        seed: Says where it is steered.
        overwrite: Whether another run's results may be replaced.

    Raises:
        ActuatedCharactersError: it cannot be run, or written.
    """
    plan, velocities = exercise.plan(min(exercise.tried_s, _LONGEST_S), {}, controller, seed)
    prepare_directory(directory, overwrite=overwrite)
    run_in_process(
        plan,
        directory,
        progress=lambda ticks: progress(0.3 * ticks / plan.ticks),
        inputs=PlannedInputs(velocities=velocities),
    )
    plot_metrics(directory)
    recordings = read_recordings(directory)
    save_png(strip(recordings, _PICTURES, ghost=True), directory / STRIP)
    made = [directory / STRIP]
    if all(map(find_spec, PACKAGES["video"])):
        movie = Movie(recordings, MovieSettings())
        movie.save(directory / VIDEO, lambda done: progress(0.4 + 0.6 * done / len(movie)))
        made.append(directory / VIDEO)
    progress(1.0)
    return made
