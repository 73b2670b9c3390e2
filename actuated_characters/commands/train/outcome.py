"""What became of a training: runs of its policy, their figures, and one to look at."""

import argparse
import shlex
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from actuated_characters.commands.common.progress import progress_bar, say
from actuated_characters.commands.common.settings import CHARACTER
from actuated_characters.commands.common.tables import make_facts_table
from actuated_characters.commands.train.preparing import given_parameters
from actuated_characters.training import acceptance
from actuated_characters.training.acceptance import Trial, figures
from actuated_characters.training.exercises import Exercise
from actuated_characters.training.exhibition import keep_run
from actuated_characters.training.training import Training
from msgs_config.errors import ActuatedCharactersError
from sim_node.physics.engine import INSTALLED_ENGINES

_TRIALS = 5


def try_policy(
    options: argparse.Namespace, exercises: Sequence[Exercise], output: Path
) -> dict[str, list[Trial]]:
    """Runs of the policy, by exercise and engine, as `run` makes them, with seeds of their own.

    Ctrl-C leaves out those that are not over.
    """
    given = given_parameters(options)
    jobs = [(exercise, engine) for exercise in exercises for engine in INSTALLED_ENGINES]
    trials: dict[str, list[Trial]] = {}
    with progress_bar("runs of its own", len(jobs) * _TRIALS, "runs", transient=True) as bar:
        try:
            for exercise, engine in jobs:
                name = f"{exercise.name}, {engine}"
                for number in range(1, _TRIALS + 1):
                    seed = options.seed + number  # another one than the training's
                    trial = acceptance.attempt(exercise, given, output, engine, seed)
                    trials.setdefault(name, []).append(trial)
                    bar.advance(bar.task_ids[0])
        except KeyboardInterrupt:
            say(f"interrupted; {output} has the figures of the runs that were over")
    return trials


def report(
    training: Training,
    output: Path,
    trials: dict[str, list[Trial]],
    spent: tuple[float, float],
) -> None:
    """Write the figures into the policy's file, and print them.

    Time spent is wall and processor's, in s.
    """
    found = figures(trials)
    training.save(output, found)
    wall, processors = (each / 60.0 for each in spent)
    facts = [
        (
            "training",
            f"{training.done:,} decisions; this time {wall:.1f} minutes, {processors:.1f} of "
            "processors",
        )
    ]
    facts += [
        (name, ", ".join(f"{k} {v}" for k, v in each.items())) for name, each in found.items()
    ]
    Console().print(make_facts_table(str(output), facts))


def show_run(options: argparse.Namespace, exercise: Exercise, output: Path) -> None:
    """Keep a run, its picture and its film beside the policy's file."""
    controller = {**given_parameters(options), "planner": "policy", "policy": str(output)}
    directory = output.with_name(f"{output.stem}-played").absolute()
    overwrite = options.overwrite or options.resume
    try:
        with progress_bar("a run to look at", 1.0, transient=True) as bar:

            def progress(share: float) -> None:
                bar.update(bar.task_ids[0], completed=share)

            for path in keep_run(
                *(exercise, controller, directory, progress), seed=1, overwrite=overwrite
            ):
                print(path)
    except KeyboardInterrupt:
        say(f"interrupted; the run in {directory} is not complete")
    except ActuatedCharactersError as error:
        say(f"no run to look at: {error}")  # the policy is in its file, all the same


def say_how_to_play(options: argparse.Namespace, exercise: Exercise, output: Path) -> None:
    """Print the command that plays the policy."""
    words = ["actuated_characters", "run", *exercise.options(given_parameters(options))]
    words += ["--planner", "policy"]
    if options.character != CHARACTER:
        words += ["--character", options.character]
    for text in (f"controller_node.policy:={output}", *options.set):
        words += ["--set", text]
    print("play it:", shlex.join(words))
