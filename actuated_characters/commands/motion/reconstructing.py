"""The command `actuated_characters motion reconstruct`: a clip by joint torques alone."""

import argparse
import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.result_file import check_not_lost, result_file
from actuated_characters.commands.common.settings import (
    CHARACTER,
    NODES,
    Commands,
    add_character,
    add_command,
    add_inputs,
    node_settings,
)
from actuated_characters.commands.common.tables import make_facts_table
from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.reconstruction.reconstruction import Job, Reconstruction
    from actuated_characters.reconstruction.search import Progress as SearchProgress

_FOLDER, _SUFFIX = Path("reconstructions"), ".json"
_OWN = ("planner", "reference", "clip", "plan.seed", "plan.workers", "planning_delay_ticks")


def add_motion_reconstruct(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters motion`."""
    command = add_command(
        commands,
        _reconstruct,
        "reconstruct",
        "have a character do a captured motion with joint torques alone",
        "Plan a motion clip ahead in several worlds at once, of which the best go on after each "
        "window, until the character does it without root assistance (sampling-based motion "
        "control, Liu et al. 2010, with planned samples). The result is a clip file with the plan "
        "and the parameters of its run: play it with `run --clip FILE`.",
        ["motion reconstruct --clip walk --cycles 4 --output walk.json"],
    )
    add_character(command)
    command.add_argument("--clip", default="walk", help="name of a clip, or a file (%(default)s)")
    command.add_argument(
        "--cycles", type=int, default=1, metavar="N", help="of the clip, one after another (1)"
    )
    command.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help=f"a {_SUFFIX} file, the result ({_FOLDER}/CHARACTER-CLIP{_SUFFIX})",
    )
    command.add_argument("--overwrite", action="store_true", help="replace FILE")
    command.add_argument(
        "--resume", action="store_true", help="go on where a search for FILE was stopped"
    )
    _add_search(command)


def _add_search(command: argparse.ArgumentParser) -> None:
    """Add the options of the search."""
    for name, default, metavar, about in (
        ("--seed", 1, None, "of all random numbers"),
        ("--worlds", 8, "N", "simulated at the same time"),
        ("--kept", 2, "N", "of them, after a window"),
        ("--window", 0.1, "S", "length, s"),
        ("--rate", 240, "HZ", "control rate"),
        ("--delay-ticks", 0, "D", "by which commands come late"),
    ):
        command.add_argument(
            name,
            type=type(default),
            default=default,
            metavar=metavar,
            help=f"{about} (%(default)s)",
        )
    add_inputs(
        command,
        "not foreseen; the run has it as well",
        ", such as controller_node.plan.samples:=64",
    )
    command.add_argument(
        "--workers", type=int, metavar="N", help="processes (as many as there are cores)"
    )


def _reconstruct(options: argparse.Namespace) -> None:
    from actuated_characters.reconstruction.reconstruction import reconstruct

    job = _job(options)
    with progress_bar(f"{job.problem.character}: {job.problem.clip}", 1, "windows") as bar:

        def report(progress: "SearchProgress", windows: int) -> None:
            state = f"best cost {progress.levels[-1][0].cost:.3g}" if progress.levels else ""
            task = bar.task_ids[0]
            bar.update(task, completed=progress.window, total=windows, state=state)

        found = reconstruct(job, report)
    _report(job, found)


def _job(options: argparse.Namespace) -> "Job":
    """The search that the options describe; raises ActuatedCharactersError if it cannot be."""
    from actuated_characters.reconstruction.problem import Problem, duration_of
    from actuated_characters.reconstruction.reconstruction import Job
    from actuated_characters.reconstruction.search import SearchSettings
    from sim_node.node_settings import NodeSettings

    workers = options.workers if options.workers is not None else os.cpu_count() or 1
    if workers < 1:
        raise ConfigurationError(f"--workers is {workers}; it must be 1 or more")
    output = _output(options)
    given = node_settings(options.set, NODES)
    for name in _OWN:
        if name in given["controller_node"]:
            raise ConfigurationError(
                f"--set controller_node.{name}: motion reconstruct sets it itself"
            )
    simulator = {"rate": options.rate, "command_delay_ticks": options.delay_ticks}
    problem = Problem(
        options.character,
        options.clip,
        duration_of(options.character, options.clip, options.cycles),
        simulator | given["sim_node"],
        given["controller_node"],
        tuple(options.push),
    )
    settings = SearchSettings(options.worlds, options.kept, options.window, options.seed)
    settings.check()
    plan = problem.plan()  # mistakes are reported before anything begins
    problem.planned_pushes(plan)
    if NodeSettings.of(plan.simulator).tick_period:
        raise ConfigurationError(
            "motion reconstruct simulates as fast as it can; it takes neither 'mode' realtime nor "
            "a 'real_time_factor'"
        )
    if options.output is None:
        output.parent.mkdir(exist_ok=True)
    return Job(problem, settings, output, workers, options.resume)


def _output(options: argparse.Namespace) -> Path:
    """The result's file; raises ConfigurationError where it cannot be written."""
    from actuated_characters.reconstruction.checkpoint import checkpoint_path

    name = f"{Path(options.character).stem}-{Path(options.clip).stem}{_SUFFIX}"
    output = result_file(options.output, _FOLDER / name)
    files = (output, checkpoint_path(output))
    check_not_lost(files, resume=options.resume, overwrite=options.overwrite)
    return output


def _report(job: "Job", found: "Reconstruction") -> None:
    """Print the figures, and the command that plays the file."""
    metrics = found.metrics
    facts = {
        "length": f"{job.problem.duration:g} s, {metrics.ticks} ticks, {found.windows} windows",
        "centre of mass error, mean": f"{metrics.centre_error_mean_m:.3f} m",
        "joint error, mean": f"{metrics.joint_error_mean_rad:.3f} rad",
        "lowest root": f"{metrics.least_root_height_m:.3f} m",
        "fell": str(metrics.fell),
        "state_hash": metrics.state_hash,
    }
    console = Console()
    console.print(make_facts_table(str(job.output), facts.items()))
    command = f"actuated_characters run --clip {shlex.quote(str(job.output))}"
    if job.problem.character != CHARACTER:
        command += f" --character {shlex.quote(job.problem.character)}"
    console.print("play it over topics:", command, soft_wrap=True, markup=False)
