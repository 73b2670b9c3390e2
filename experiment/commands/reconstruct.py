"""The command `actuated_characters reconstruct`: captured motion with joint torques alone."""

import argparse
import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiment.commands.checks import check_output, worker_count
from experiment.commands.progress import search_bar
from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # it takes a second to import
    from rich.progress import Progress

    from experiment.samcon.fitting import State as FitState
    from experiment.samcon.reconstruction import Job, Reconstruction
    from experiment.samcon.search import Progress as SearchProgress
    from experiment.samcon.settings import Settings
    from experiment.samcon.trials import Fit

_CHARACTER = "humanoid"


def add_reconstruct(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    command = commands.add_parser(
        "reconstruct",
        help="have a character do a captured motion with joint torques alone",
        description=(
            "Search corrections of a motion clip with which the character does it without root "
            "assistance (sampling-based motion control, Liu et al. 2010). The result is a clip "
            "file with the parameters of its run: play it with `run --clip FILE`."
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
    command.add_argument(
        "--samples", type=int, metavar="N", help="a window (the preset's, or 1000)"
    )
    command.add_argument(
        "--kept", type=int, metavar="N", help="of them to go on from (the preset's, or 80)"
    )
    command.add_argument(
        "--window", type=float, metavar="S", help="length of a window, s (the preset's, or 0.1)"
    )
    command.add_argument(
        "--open-loop", action="store_true", help="without the feedbacks of the preset"
    )
    command.add_argument(
        "--window-feedback",
        metavar="FILE",
        help="of `fit-feedback` for the same motion, rate and delay, or the name of a shipped one, "
        "or none (the preset's)",
    )
    command.add_argument(
        "--fit",
        type=int,
        default=0,
        metavar="N",
        help="fit the balance feedback first: try N of them, in sixteens; it then acts alone (0)",
    )
    command.add_argument(
        "--fit-assistance",
        type=float,
        default=0.0,
        metavar="SHARE",
        help="of the root's gains, which the fit begins with and withdraws step by step (0)",
    )
    command.add_argument(
        "--fit-push",
        type=float,
        default=0.0,
        metavar="NS",
        help="N s, of the pushes in the last runs of the fit, each two seconds (0)",
    )
    command.add_argument(
        "--fit-headings",
        type=int,
        default=1,
        metavar="N",
        help="of the motion, at which each feedback is tried: for what turns, as the engine's "
        "friction is not the same in all directions (1)",
    )
    command.add_argument("--rate", type=int, default=240, metavar="HZ", help="control rate (240)")
    command.add_argument(
        "--delay-ticks", type=int, default=0, metavar="D", help="by which commands come late (0)"
    )
    command.add_argument(
        "--push",
        action="append",
        default=[],
        metavar="LINK:FX,FY,FZ@S",
        help="a force in N, world axes, on a link at a time in s, that the search knows "
        "beforehand; it comes in the run as well; may be repeated",
    )
    command.add_argument(
        "--workers", type=int, metavar="N", help="processes (as many as there are cores)"
    )
    command.add_argument(
        "--cluster", default="", metavar="ADDRESS", help="of a dask scheduler, for its workers"
    )


def _reconstruct(options: argparse.Namespace) -> None:
    from experiment.samcon.reconstruction import reconstruct
    from experiment.samcon.trials import Fit

    job = _job(options)
    bar = search_bar()
    task = bar.add_task(f"{job.problem.character}: {job.problem.clip}", total=1, state="begins")

    def report(progress: "SearchProgress", windows: int, rate: float) -> None:
        best = progress.levels[-1][0]
        state = f"best cost {best.cost:.3g}, {rate:.0f} samples/s" if rate else ""
        bar.update(task, completed=progress.window, total=windows, state=state)

    with bar:
        if options.fit:
            fit = Fit(options.fit, options.fit_assistance, options.fit_push, options.fit_headings)
            job = _fitted(job, fit, bar)
        found = reconstruct(job, report)
    _report(job, found)


def _fitted(job: "Job", fit: "Fit", bar: "Progress") -> "Job":
    """The job with a feedback that has been fitted to its motion."""
    from experiment.samcon.fitting import fitted

    task = bar.add_task("feedback", total=fit.count, state="begins")

    def report(state: "FitState") -> None:
        level = state.level
        held = f"{level.assistance:.3f} assistance, " if level.assistance else ""
        pushed = f", {level.push:g} N s" if level.push else ""
        bar.update(
            task,
            completed=min(state.done, fit.count),
            state=f"{held}{level.windows} windows{pushed}: mean cost {state.cost:.3g}",
        )

    return job.with_feedback(fitted(job.problem, job.settings, fit, job.workers, report))


def _job(options: argparse.Namespace) -> "Job":
    """What is to be done; raises ActuatedCharactersError where options cannot be used."""
    from experiment.samcon.gains_file import check_cycle, check_joints, read_gains
    from experiment.samcon.problem import Problem, windows_a_cycle
    from experiment.samcon.reconstruction import Job, duration_of

    workers = worker_count(options.workers)
    _check_output(options)
    _check_fit(options)
    settings = _settings(options)
    duration = duration_of(options.character, options.clip, options.cycles)
    by_window = read_gains(settings.window_feedback) if settings.window_feedback else None
    if by_window is not None and options.window is None:
        settings = settings.dividing(duration / options.cycles, by_window.windows)
    problem = Problem.of(
        options.character,
        options.clip,
        duration,
        settings,
        {"rate": options.rate, "command_delay_ticks": options.delay_ticks},
        options.push,
    )
    # what is wrong is said before anything begins
    plan = problem.plan()
    problem.planned_pushes(plan)
    windows = len(problem.windows(plan))
    if by_window is not None:
        check_joints(settings.window_feedback, by_window, plan.character.layout)
        check_cycle(by_window.windows, windows_a_cycle(windows, options.cycles))
    return Job(
        problem, options.cycles, settings, options.output, workers, options.cluster, options.resume
    )


def _settings(options: argparse.Namespace) -> "Settings":
    """Those of the preset, but for what is given, and for the feedbacks of what is resumed."""
    from experiment.samcon.checkpoint import checkpoint_path, read_feedbacks
    from experiment.samcon.settings import preset

    given = {name: getattr(options, name) for name in ("samples", "kept", "window", "seed")}
    if options.open_loop:
        given |= {"feedback": {}, "window_feedback": ""}
    elif options.fit or options.window_feedback == "none":
        given["window_feedback"] = ""
    else:
        given["window_feedback"] = options.window_feedback
    settings = preset(
        options.character,
        options.clip,
        options.rate,
        **{name: value for name, value in given.items() if value is not None},
    )
    if not options.resume or options.open_loop:
        return settings
    gains, name = read_feedbacks(checkpoint_path(options.output))  # fitted, or named, before
    settings = replace(settings, feedback=gains)
    if options.window_feedback is None:
        settings = replace(settings, window_feedback=name)
    return settings


def _check_output(options: argparse.Namespace) -> None:
    """Raise ConfigurationError where the result cannot be written."""
    from experiment.samcon.checkpoint import checkpoint_path

    output: Path = options.output
    check_output(output)
    if options.resume or options.overwrite:
        return
    for file in (output, checkpoint_path(output)):
        if file.exists():
            raise ConfigurationError(f"{file} exists; --resume goes on, --overwrite begins anew")


def _check_fit(options: argparse.Namespace) -> None:
    """Raise ConfigurationError where --fit cannot be used."""
    from experiment.samcon.workers import MOST_ENGINES

    if options.fit < 0:
        raise ConfigurationError(f"--fit is {options.fit}; it must be 0 or more")
    for name, most in (("fit_assistance", 1.0), ("fit_push", 1000.0)):
        value, option = getattr(options, name), f"--{name.replace('_', '-')}"
        if not 0.0 <= value <= most:
            raise ConfigurationError(f"{option} is {value:g}; it must be 0 to {most:g}")
        if value and not options.fit:
            raise ConfigurationError(f"{option} is for --fit, which says how many are tried")
    if not 1 <= options.fit_headings <= MOST_ENGINES:
        raise ConfigurationError(
            f"--fit-headings is {options.fit_headings}; it must be 1 to {MOST_ENGINES}"
        )
    if options.fit_headings > 1 and not options.fit:
        raise ConfigurationError("--fit-headings is for --fit, which says how many are tried")
    if options.window_feedback not in (None, "none") and (options.fit or options.open_loop):
        raise ConfigurationError(
            "--window-feedback acts beside the preset's feedback; --fit and --open-loop do without"
        )
    if not options.fit:
        return
    if options.open_loop:
        raise ConfigurationError("--fit fits the feedback, which --open-loop leaves out")
    if options.resume:
        raise ConfigurationError("--fit begins anew; --resume goes on with what was fitted before")
    if options.cluster:
        raise ConfigurationError("--fit runs on this machine's processes, not on a --cluster")


def _report(job: "Job", found: "Reconstruction") -> None:
    figures = found.figures
    rows = {
        "length": f"{job.problem.duration:g} s, {figures.ticks} ticks, {found.windows} windows",
        "samples": f"{found.samples}, {found.samples_a_second:.0f} a second",
        "cost, mean": f"{found.cost:.3g}",
        "centre of mass error, mean": f"{figures.centre_error_mean_m:.3f} m",
        "joint error, mean": f"{figures.joint_error_mean_rad:.3f} rad",
        "lowest root": f"{figures.least_root_height_m:.3f} m",
        "root force, mean": f"{figures.assist_force_mean_n:.3g} N",
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
