"""The command `actuated_characters motion reconstruct`: a clip by joint torques alone."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.commands.common.result_file import check_not_lost, result_file
from actuated_characters.commands.common.settings import (
    NODES,
    Commands,
    add_character,
    add_command,
    add_inputs,
    node_settings,
)
from actuated_characters.commands.common.skin_options import given_skin
from actuated_characters.commands.view import add_server, server_parameters
from msgs_config.errors import ConfigurationError
from msgs_config.runtime.extras import hint, is_installed, require_extra

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.reconstruction.reconstruction import Job

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
        [
            "motion reconstruct --clip walk --cycles 4 --output walk.json",
            "motion reconstruct --clip cartwheel --view",
        ],
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
    where = command.add_mutually_exclusive_group()
    where.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help="processes (as many as there are processors; more than one need the extra 'sweep')",
    )
    where.add_argument(
        "--scheduler", metavar="ADDRESS", help="of any cluster of Dask: tcp://HOST:PORT"
    )
    command.add_argument(
        "--view",
        action="store_true",
        help="show in a browser what becomes of the worlds, and in the end what was found, until "
        "Ctrl-C (needs the extra 'view'); where, is printed",
    )
    add_server(command)


def _reconstruct(options: argparse.Namespace) -> None:
    from actuated_characters.commands.motion.searching import run_search

    if options.view:
        require_extra("view", "--view")
    elif options.skin or options.skin_map:
        raise ConfigurationError("--skin and --skin-map are of --view")
    given_skin(options)  # its errors come before all the work
    run_search(_job(options), server_parameters(options) if options.view else None)


def _job(options: argparse.Namespace) -> "Job":
    """The search that the options describe; raises ActuatedCharactersError if it cannot be."""
    from actuated_characters.reconstruction.problem import Problem, duration_of
    from actuated_characters.reconstruction.reconstruction import Job
    from actuated_characters.reconstruction.search import SearchSettings
    from actuated_characters.reconstruction.workers import usual_count

    if options.scheduler is not None:
        require_extra("sweep", "--scheduler")
    workers = usual_count() if options.workers is None else options.workers
    if options.workers is None and not is_installed("sweep"):
        print(f"on one processor; for all of them: {hint('sweep')}")
    if workers < 1:
        raise ConfigurationError(f"--workers is {workers}; it must be 1 or more")
    if workers > 1:
        require_extra("sweep", "--workers above 1")
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
    problem.check()  # mistakes are reported before anything begins
    if options.output is None:
        output.parent.mkdir(exist_ok=True)
    return Job(problem, settings, output, workers, options.resume, options.scheduler)


def _output(options: argparse.Namespace) -> Path:
    """The result's file; raises ConfigurationError where it cannot be written."""
    from actuated_characters.reconstruction.checkpoint import checkpoint_path

    name = f"{Path(options.character).stem}-{Path(options.clip).stem}{_SUFFIX}"
    output = result_file(options.output, _FOLDER / name)
    files = (output, checkpoint_path(output))
    check_not_lost(files, resume=options.resume, overwrite=options.overwrite)
    return output
