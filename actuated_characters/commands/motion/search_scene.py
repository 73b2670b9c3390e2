"""Plays a scene that is a search for a motion, and then what it has found."""

import argparse
from pathlib import Path

from actuated_characters.commands.common.interruption import check_interruption
from actuated_characters.commands.motion.searching import run_search
from actuated_characters.commands.view import server_parameters
from actuated_characters.reconstruction.checkpoint import checkpoint_path
from actuated_characters.reconstruction.problem import Problem, duration_of
from actuated_characters.reconstruction.reconstruction import Job
from actuated_characters.reconstruction.search import SearchSettings
from actuated_characters.reconstruction.workers import usual_count
from actuated_characters.scenes.scene import CONTROLLER, SIMULATOR, Scene
from msgs_config.errors import ConfigurationError
from msgs_config.settings import Settings, parameter


class SearchedMotion(Settings):
    """The parameters `motion_reconstruct` of a scene, those of the command's options."""

    clip: str = parameter("walk", "name of a clip, or a file")
    cycles: int = parameter(1, "of the clip, one after another", minimum=1)
    worlds: int = parameter(SearchSettings.worlds, "simulated at the same time", minimum=1)
    kept: int = parameter(SearchSettings.survivors, "of them, after a window", minimum=1)
    window: float = parameter(SearchSettings.window, "its length", unit="s")
    seed: int = parameter(SearchSettings.seed, "of all random numbers")
    push: tuple[str, ...] = parameter((), "LINK:FX,FY,FZ@S, not foreseen")


def play_search(options: argparse.Namespace, scene: Scene) -> None:
    """Search and show it, with the options of `play`, until an interruption.

    Raises:
        ActuatedCharactersError: a name or value is wrong, or the search has failed.
    """
    directory = options.output or Path("runs") / f"play-{scene.name}"
    job = _job(scene, directory / f"{scene.name}.json", options.duration)
    if options.output and job.output.exists() and not options.overwrite:
        raise ConfigurationError(f"{job.output} exists; --overwrite replaces it")
    directory.mkdir(parents=True, exist_ok=True)
    viewer = None
    if not options.no_view:
        shown = {name: value for name, value in scene.viewer.items() if name != "about"}
        viewer = {**shown, **server_parameters(options)}
    check_interruption()  # all modules are imported by now
    if scene.title:
        print(scene.title, flush=True)
    try:
        run_search(job, viewer, str(scene.viewer.get("about", "")))
    except KeyboardInterrupt:
        checkpoint = checkpoint_path(job.output)
        print(f"ended; {checkpoint} has the search so far" if checkpoint.exists() else "ended")


def _job(scene: Scene, output: Path, most_seconds: float) -> Job:
    """The search that a scene describes, of a motion that lasts at most so many s."""
    motion = SearchedMotion.given(scene.search)
    if scene.characters:
        raise ConfigurationError(f"scene '{scene.name}': a search is for one character's motion")
    simulator, controller = (
        {name: value for name, value in scene.nodes[node].items() if name != "character"}
        for node in (SIMULATOR, CONTROLLER)
    )
    character = str(scene.simulator.get("character", ""))
    duration = min(duration_of(character, motion.clip, motion.cycles), most_seconds)
    problem = Problem(character, motion.clip, duration, simulator, controller, motion.push)
    settings = SearchSettings(motion.worlds, motion.kept, motion.window, motion.seed)
    settings.check()
    problem.check()
    return Job(problem, settings, output, usual_count())
