"""The command `actuated_characters reconstruct`: captured motion with joint torques alone."""

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from actuated_characters.commands.common.checks import check_output, worker_count
from actuated_characters.commands.common.progress import search_bar
from actuated_characters.commands.common.settings import add_repeated, node_settings
from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.reconstruction.reconstruction import Job, Reconstruction
    from actuated_characters.reconstruction.search import Progress as SearchProgress

_NODES = ("sim_node", "controller_node")
_OWN = ("planner", "reference", "clip", "plan.seed", "plan.workers", "planning_delay_ticks")
_CHARACTER = "humanoid"


def add_reconstruct(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    command = commands.add_parser(
        "reconstruct",
        help="have a character do a captured motion with joint torques alone",
        description=(
            "Plan a motion clip ahead in several worlds at once, of which the best go on after "
            "each window, until the character does it without root assistance (sampling-based "
            "motion control, Liu et al. 2010, with planned samples). The result is a clip file "
            "with the plan and the parameters of its run: play it with `run --clip FILE`."
        ),
        epilog="example: actuated_characters reconstruct --clip walk --cycles 4 --output walk.json",
    )
    command.set_defaults(command=_reconstruct)
    command.add_argument("--character", default=_CHARACTER, help="name (%(default)s)")
    command.add_argument("--clip", default="walk", help="name of a clip, or a file (%(default)s)")
    command.add_argument(
        "--cycles", type=int, default=1, metavar="N", help="of the clip, one after another (1)"
    )
    command.add_argument(
        "--output", type=Path, required=True, metavar="FILE", help="a .json file, the result"
    )
    command.add_argument("--overwrite", action="store_true", help="replace FILE")
    command.add_argument(
        "--resume", action="store_true", help="go on where a search for FILE was stopped"
    )
    _add_search(command)


def _add_search(command: argparse.ArgumentParser) -> None:
    """Add the options of how it is searched."""
    command.add_argument("--seed", type=int, default=1, help="of all random numbers (1)")
    command.add_argument("--worlds", type=int, default=8, metavar="N", help="(%(default)s)")
    command.add_argument(
        "--kept", type=int, default=2, metavar="N", help="of them, after a window (%(default)s)"
    )
    command.add_argument(
        "--window", type=float, default=0.1, metavar="S", help="length, s (%(default)s)"
    )
    command.add_argument("--rate", type=int, default=240, metavar="HZ", help="control rate (240)")
    command.add_argument(
        "--delay-ticks", type=int, default=0, metavar="D", help="by which commands come late (0)"
    )
    add_repeated(
        command,
        "--set",
        "NODE.NAME:=VALUE",
        "parameter of sim_node or controller_node, such as controller_node.plan.samples:=64",
    )
    add_repeated(
        command,
        "--push",
        "LINK:FX,FY,FZ@S",
        "a force in N, world axes, on a link at a time in s, not foreseen; the run has it as well",
    )
    command.add_argument(
        "--workers", type=int, metavar="N", help="processes (as many as there are cores)"
    )


def _reconstruct(options: argparse.Namespace) -> None:
    from controller_node.planner.factory import saying_what_it_needs
    from controller_node.planner.settings import PREDICTIVE

    with saying_what_it_needs(PREDICTIVE):
        from actuated_characters.reconstruction.reconstruction import reconstruct
    job = _job(options)
    bar = search_bar()
    task = bar.add_task(f"{job.problem.character}: {job.problem.clip}", total=1, state="begins")

    def report(progress: "SearchProgress", windows: int) -> None:
        state = f"best cost {progress.levels[-1][0].cost:.3g}" if progress.levels else ""
        bar.update(task, completed=progress.window, total=windows, state=state)

    with bar:
        found = reconstruct(job, report)
    _report(job, found)


def _job(options: argparse.Namespace) -> "Job":
    """What is to be done; raises ActuatedCharactersError where options cannot be used."""
    from actuated_characters.reconstruction.problem import Problem, duration_of
    from actuated_characters.reconstruction.reconstruction import Job
    from actuated_characters.reconstruction.search import Settings
    from sim_node.node_settings import make_node_settings

    workers = worker_count(options.workers)
    _check_output(options)
    given = node_settings(options.set, _NODES)
    for name in _OWN:
        if name in given["controller_node"]:
            raise ConfigurationError(f"--set controller_node.{name}: reconstruct sets it itself")
    simulator = {"rate": options.rate, "command_delay_ticks": options.delay_ticks}
    problem = Problem(
        options.character,
        options.clip,
        duration_of(options.character, options.clip, options.cycles),
        simulator | given["sim_node"],
        given["controller_node"],
        tuple(options.push),
    )
    settings = Settings(options.worlds, options.kept, options.window, options.seed)
    settings.check()
    plan = problem.plan()  # what is wrong is said before anything begins
    problem.planned_pushes(plan)
    if make_node_settings(plan.simulator).tick_period:
        raise ConfigurationError(
            "reconstruct simulates as fast as it can; it takes neither 'mode' realtime nor a "
            "'real_time_factor'"
        )
    return Job(problem, settings, options.output, workers, options.resume)


def _check_output(options: argparse.Namespace) -> None:
    """Raise ConfigurationError where the result cannot be written."""
    from actuated_characters.reconstruction.checkpoint import checkpoint_path

    output: Path = options.output
    check_output(output)
    if options.resume or options.overwrite:
        return
    for file in (output, checkpoint_path(output)):
        if file.exists():
            raise ConfigurationError(f"{file} exists; --resume goes on, --overwrite starts over")


def _report(job: "Job", found: "Reconstruction") -> None:
    figures = found.figures
    rows = {
        "length": f"{job.problem.duration:g} s, {figures.ticks} ticks, {found.windows} windows",
        "centre of mass error, mean": f"{figures.centre_error_mean_m:.3f} m",
        "joint error, mean": f"{figures.joint_error_mean_rad:.3f} rad",
        "lowest root": f"{figures.least_root_height_m:.3f} m",
        "fell": str(figures.fell),
        "state_hash": figures.state_hash,
    }
    table = Table(title=escape(str(job.output)), title_justify="left", show_header=False)
    for name, value in rows.items():
        table.add_row(name, value)
    console = Console()
    console.print(table)
    console.print("play it over topics:", _play_command(job), soft_wrap=True, markup=False)


def _play_command(job: "Job") -> str:
    """How to have the file played, which brings the parameters that it was found with."""
    command = f"actuated_characters run --clip {shlex.quote(str(job.output))}"
    if job.problem.character != _CHARACTER:
        command += f" --character {shlex.quote(job.problem.character)}"
    return command
