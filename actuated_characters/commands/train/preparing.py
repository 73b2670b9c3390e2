"""What `train` is asked for: its exercises, its job, what it begins with, and its file."""

import argparse
import math
import os
from collections.abc import Sequence
from pathlib import Path

from actuated_characters.commands.common.progress import say
from actuated_characters.commands.common.result_file import check_not_lost, result_file
from actuated_characters.commands.common.settings import node_settings
from actuated_characters.commands.train.command import DECISIONS_A_MINUTE, FOLDER, SUFFIX
from actuated_characters.training.exercises import Exercise
from actuated_characters.training.job import (
    HIDDEN,
    Job,
    check_resumed,
    check_start,
    make_job,
    taught_by,
)
from controller_node.planner.policy.file import STEERED, Policy, read_policy, shipped_policies
from msgs_config.character.loading import load_character
from msgs_config.clips.reading import expand_clips
from msgs_config.errors import ConfigurationError

_NAMED_CLIPS = 3  # in the name of a file
_USED = ("plan.weight.", "plan.gives_way")  # what training takes of a planner's parameters


def asked_for(options: argparse.Namespace) -> tuple[list[Exercise], Path]:
    """The exercises of the options, and the policy's file.

    Raises:
        ActuatedCharactersError: there is no such clip, or the file cannot be.
    """
    asked = options.clip or ([] if options.steer else ["walk"])
    clips = expand_clips(load_character(options.character), asked)
    for clip in clips:
        if Path(clip).stem == STEERED:
            raise ConfigurationError(f"--clip {clip}: a policy keeps that name for --steer")
    steered = [STEERED] if options.steer else []
    exercises = [Exercise(options.character, name) for name in (*clips, *steered)]
    return exercises, output_file(options, [*asked, *steered])


def output_file(options: argparse.Namespace, names: Sequence[str]) -> Path:
    """The policy's file, by what is asked for; raises ConfigurationError where it cannot be."""
    name = "-".join((Path(options.character).stem, *few(names)))
    output = result_file(options.output, FOLDER / (name + SUFFIX))
    check_not_lost([output], resume=options.resume, overwrite=options.overwrite)
    return output


def few(names: Sequence[str]) -> list[str]:
    """The first ones, without their folders, and how many more there are."""
    first = [Path(name).stem for name in names[:_NAMED_CLIPS]]
    more = len(names) - len(first)
    return [*first, f"and-{more}-more"] if more else first


def given_parameters(options: argparse.Namespace) -> dict[str, object]:
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


def job_of(options: argparse.Namespace, exercises: Sequence[Exercise]) -> Job:
    """What the options say; raises ActuatedCharactersError if it cannot be trained."""
    given = given_parameters(options)
    threads = options.threads if options.threads is not None else len(os.sched_getaffinity(0))
    hidden = HIDDEN if options.hidden is None else options.hidden
    for name, value, least in (
        *(("--minutes", options.minutes, 0.01), ("--pushes", options.pushes, 0.0)),
        *(("--threads", threads, 1), ("--seed", options.seed, 0), ("--hidden", hidden, 2)),
    ):
        if not least <= value < math.inf:
            raise ConfigurationError(f"{name} is {value:g}; it must be {least:g} or more")
    return make_job(
        exercises,
        given,
        decisions=round(DECISIONS_A_MINUTE * options.minutes),
        most_push=options.pushes,
        seed=options.seed,
        threads=threads,
        after=options.after,
        hidden=hidden,
    )


def taught(options: argparse.Namespace, job: Job) -> Job:
    """The job with the policies that `--imitate` names, or the shipped ones of its exercises.

    Raises:
        ConfigurationError: there are none, or they cannot be imitated.
    """
    if options.imitate is None:
        return job
    shipped = shipped_policies()
    names = options.imitate or [each for each in job.names if each in shipped]
    if not names:
        raise ConfigurationError(
            f"--imitate: no policy of {', '.join(job.names)} is shipped; name a file"
        )
    job = taught_by(job, [read_policy(name, job.character) for name in names])
    alone = [name for name, each in zip(job.names, job.teachers, strict=True) if each is None]
    if alone:
        say(f"nobody to imitate knows {', '.join(alone)}, learned from its reward alone")
    return job


def start_of(options: argparse.Namespace, job: Job, output: Path) -> Policy | None:
    """The policy that a training begins with; raises ConfigurationError if it cannot."""
    name = getattr(options, "from")
    if options.resume and output.exists():
        name = str(output)
    if name is None:
        if options.resume:
            say(f"there is no {output}: the training begins")
        return None
    start = read_policy(name, job.character)
    if options.resume:
        check_resumed(job, start)
    check_start(job, start)
    return start
