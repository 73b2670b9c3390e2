"""The command `actuated_characters train`: a policy that keeps a motion by joint torques alone."""

import argparse
import math
import os
import shlex
import signal
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import (
    CHARACTER,
    Commands,
    add_character,
    add_command,
    node_settings,
)
from actuated_characters.commands.common.tables import make_facts_table
from msgs_config.errors import ActuatedCharactersError, ConfigurationError

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.training.acceptance import Trial
    from actuated_characters.training.exercises import Exercise
    from actuated_characters.training.job import Job
    from actuated_characters.training.training import Progress, Training
    from controller_node.planner.policy.file import Policy

_FOLDER, _SUFFIX = Path("policies"), ".npz"
_DECISIONS_A_MINUTE = 500_000  # on two processors
_TRIALS = 5
_NAMED_CLIPS = 3  # in the name of a file
_USED = ("plan.weight.", "plan.gives_way")  # what training takes of a planner's parameters


def add_train(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command."""
    command = add_command(
        commands,
        _train,
        "train",
        "train a policy that keeps a motion by joint torques alone",
        "Train a small network that answers each state with offsets to a motion's angles, as a "
        "planner does, by trying in many worlds at once (proximal policy optimisation). Ctrl-C "
        "ends it and keeps the best so far. Play the result with `run --clip CLIP --planner policy "
        "--set controller_node.policy:=FILE`; the last lines say how.",
        [
            "train --clip walk --minutes 10",
            "train --clip walk --pushes 60 --output walk.npz",
            "train --steer --minutes 40 --from walk",
        ],
    )
    add_character(command)
    command.add_argument(
        "--clip",
        action="append",
        metavar="NAME",
        help="name of a clip, a file, or a folder of files; may be repeated: one policy for all of "
        "them (walk)",
    )
    command.add_argument(
        "--steer",
        action="store_true",
        help="learn to go where cmd_vel says, by the clips of `--reference steered`; beside "
        "clips, where --clip names some",
    )
    command.add_argument(
        "--minutes",
        type=float,
        default=10.0,
        metavar="M",
        help=f"how much is tried, in all: {_DECISIONS_A_MINUTE:,} decisions each, which take that "
        "long on two processors (%(default)g)",
    )
    command.add_argument(
        "--pushes",
        type=float,
        default=25.0,
        metavar="NS",
        help="impulse, in N s, of the hardest pushes that it learns to take; 0: none (%(default)g)",
    )
    command.add_argument("--seed", type=int, default=0, help="of all random numbers (0)")
    command.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help=f"the policy ({_FOLDER}/CHARACTER-CLIP{_SUFFIX})",
    )
    command.add_argument("--overwrite", action="store_true", help="replace FILE")
    start = command.add_mutually_exclusive_group()
    start.add_argument(
        "--resume", action="store_true", help="go on with the training in FILE, if there is one"
    )
    start.add_argument(
        "--from",
        metavar="POLICY",
        help="begin with what a shipped policy, or one in a file, can, of whatever motion",
    )
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="controller_node.NAME:=VALUE",
        help="a parameter, such as rate, gains or plan.weight; may be repeated",
    )
    command.add_argument(
        "--threads", type=int, metavar="N", help="of the worlds (one for each processor)"
    )


def _train(options: argparse.Namespace) -> None:
    from actuated_characters.training.exercises import Exercise
    from controller_node.planner.policy.file import STEERED
    from msgs_config.character.loading import load_character
    from msgs_config.clips.reading import expand_clips

    asked = options.clip or ([] if options.steer else ["walk"])
    clips = expand_clips(load_character(options.character), asked)
    for clip in clips:
        if Path(clip).stem == STEERED:
            raise ConfigurationError(f"--clip {clip}: a policy keeps that name for --steer")
    steered = [STEERED] if options.steer else []
    exercises = tuple(Exercise(options.character, name) for name in (*clips, *steered))
    output = _output(options, [*asked, *steered])
    from actuated_characters.training.training import Training

    began = time.process_time()
    job = _job(options, exercises)
    start = _start(options, job, output)
    output.parent.mkdir(exist_ok=True)
    training = Training(job, start, resumes=options.resume)
    try:
        spent = _go_on(training, job, output), time.process_time() - began
    finally:
        training.close()
    try:
        trials = _try(options, exercises, output)
    except KeyboardInterrupt:
        _say(f"interrupted; {output} has no figures of runs of its own")
        trials = {}
    _report(training, output, trials, spent)
    if trials:
        _show(options, exercises[0], output)
    for exercise in exercises:
        _say_how_to_play(options, exercise, output)


def _go_on(training: "Training", job: "Job", output: Path) -> float:
    """Train to the end, or to Ctrl-C; the policy is in its file then. Returns wall seconds."""
    began = time.monotonic()
    title = f"{job.character.name}: {', '.join(_few(job.names))}"
    try:
        with progress_bar(title, job.decisions, "decisions") as bar:
            while not training.is_over:
                progress = training.go_on()
                bar.update(bar.task_ids[0], completed=progress.decisions, state=_words(progress))
                if progress.is_better:
                    training.save(output, {})
                    if not bar.console.is_terminal:  # there the bar shows nothing until the end
                        _say(f"{progress.decisions:,} of {job.decisions:,}: {_words(progress)}")
    except KeyboardInterrupt as interrupted:
        if not training.has_best:
            raise  # so soon there is nothing better than what FILE may have
        if interrupted.args == (signal.SIGTERM,):
            training.save(output, {})
            raise  # who says so does not wait for runs
        _say(f"interrupted; the best so far is in {output}, and is tried (Ctrl-C leaves that out)")
    training.save(output, {})
    return time.monotonic() - began


def _say(text: str) -> None:
    Console(stderr=True).print(text, soft_wrap=True, markup=False, highlight=False)


def _words(progress: "Progress") -> str:
    return (
        f"lasts {progress.survived_s:.1f} s, pushes {progress.push:.0f} N s, "
        f"off {progress.off_m:.2f} m {progress.off_rad:.2f} rad"
    )


def _few(names: "Sequence[str]") -> list[str]:
    """The first ones, without their folders, and how many more there are."""
    few = [Path(name).stem for name in names[:_NAMED_CLIPS]]
    return few if len(names) <= _NAMED_CLIPS else [*few, f"and-{len(names) - _NAMED_CLIPS}-more"]


def _output(options: argparse.Namespace, names: "Sequence[str]") -> Path:
    """The policy's file, by what is asked for; raises ConfigurationError where it cannot be."""
    name = "-".join((Path(options.character).stem, *_few(names)))
    output: Path = options.output or _FOLDER / (name + _SUFFIX)
    if output.suffix != _SUFFIX:
        raise ConfigurationError(f"--output is {output}; it must end in {_SUFFIX}")
    if options.output is not None and not output.absolute().parent.is_dir():
        raise ConfigurationError(f"--output is {output}; there is no directory {output.parent}")
    if output.is_dir():
        raise ConfigurationError(f"--output is {output}; it is a directory")
    folder = next(each for each in output.absolute().parents if each.exists())
    if not os.access(folder, os.W_OK):
        raise ConfigurationError(f"--output is {output}; no permission to write to {folder}")
    if output.exists() and not (options.resume or options.overwrite):
        raise ConfigurationError(f"{output} exists; --resume goes on, --overwrite starts over")
    return output


def _job(options: argparse.Namespace, exercises: "Sequence[Exercise]") -> "Job":
    """What the options say; raises ActuatedCharactersError if it cannot be trained."""
    from actuated_characters.training.job import make_job

    given = _given(options)
    threads = options.threads if options.threads is not None else len(os.sched_getaffinity(0))
    for name, value, least in (
        *(("--minutes", options.minutes, 0.01), ("--pushes", options.pushes, 0.0)),
        *(("--threads", threads, 1), ("--seed", options.seed, 0)),
    ):
        if not least <= value < math.inf:
            raise ConfigurationError(f"{name} is {value:g}; it must be {least:g} or more")
    return make_job(
        exercises,
        given,
        decisions=round(_DECISIONS_A_MINUTE * options.minutes),
        most_push=options.pushes,
        seed=options.seed,
        threads=threads,
    )


def _start(options: argparse.Namespace, job: "Job", output: Path) -> "Policy | None":
    """The policy that a training begins with; raises ConfigurationError if it cannot."""
    from actuated_characters.training.job import check_resumed, check_start
    from controller_node.planner.policy.file import read_policy

    name = getattr(options, "from")
    if options.resume and output.exists():
        name = str(output)
    if name is None:
        if options.resume:
            _say(f"there is no {output}: the training begins")
        return None
    start = read_policy(name, job.character)
    if options.resume:
        check_resumed(job, start)
    check_start(job, start)
    return start


def _given(options: argparse.Namespace) -> dict[str, object]:
    """What `--set` sets; raises ConfigurationError for what training has no use for."""
    given = node_settings(options.set, ("controller_node",))["controller_node"]
    for name, value in given.items():
        if name in ("planner", "policy"):
            reason = "it is what `train` makes"
        elif name in ("behaviour", "reference", "clip"):
            reason = "`train` has the behaviour tracking, and clips of --clip or --steer"
        elif name.startswith("plan.") and not name.startswith(_USED):
            reason = f"training searches no plans; it takes {', '.join(_USED)} alone of plan.*"
        else:
            continue
        raise ConfigurationError(f"--set controller_node.{name}:={value}: {reason}")
    return given


def _try(
    options: argparse.Namespace, exercises: "Sequence[Exercise]", output: Path
) -> "dict[str, list[Trial]]":
    """Runs of the policy, by exercise and engine, as `run` makes them, with seeds of their own."""
    from actuated_characters.training.acceptance import attempt
    from sim_node.physics.engine import INSTALLED_ENGINES

    given = _given(options)
    jobs = [(exercise, engine) for exercise in exercises for engine in INSTALLED_ENGINES]
    trials: dict[str, list[Trial]] = {}
    with progress_bar("runs of its own", len(jobs) * _TRIALS, "runs", transient=True) as bar:
        for exercise, engine in jobs:
            found = trials.setdefault(f"{exercise.name}, {engine}", [])
            for number in range(1, _TRIALS + 1):
                seed = options.seed + number  # another one than the training's
                found.append(attempt(exercise, given, output, engine, seed))
                bar.advance(bar.task_ids[0])
    return trials


def _show(options: argparse.Namespace, exercise: "Exercise", output: Path) -> None:
    """Keep a run, its picture and its film beside the policy's file."""
    from actuated_characters.training.exhibition import keep_run

    controller = {**_given(options), "planner": "policy", "policy": str(output)}
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
        _say(f"interrupted; the run in {directory} is not complete")
    except ActuatedCharactersError as error:
        _say(f"no run to look at: {error}")  # the policy is in its file, all the same


def _report(
    training: "Training",
    output: Path,
    trials: "dict[str, list[Trial]]",
    spent: tuple[float, float],
) -> None:
    """Write the figures into the policy's file, and print them; time spent is wall and processor's,
    in s.
    """
    from actuated_characters.training.acceptance import figures

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


def _say_how_to_play(options: argparse.Namespace, exercise: "Exercise", output: Path) -> None:
    words = ["actuated_characters", "run", *exercise.options(_given(options))]
    words += ["--planner", "policy"]
    if options.character != CHARACTER:
        words += ["--character", options.character]
    for text in (f"controller_node.policy:={output}", *options.set):
        words += ["--set", text]
    print("play it:", shlex.join(words))
