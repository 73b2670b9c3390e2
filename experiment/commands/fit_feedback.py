"""The command `actuated_characters fit-feedback`: a window feedback for a motion that repeats."""

import argparse
from pathlib import Path

from rich.console import Console

from experiment.commands.checks import check_output, worker_count
from experiment.commands.progress import search_bar
from msgs_config.errors import ConfigurationError

_LEAST_ROUNDS, _MOST_ROUNDS = 1, 1000


def add_fit_feedback(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    command = commands.add_parser(
        "fit-feedback",
        help="fit the feedback that holds a repeated motion, pushed or not",
        description=(
            "Fit a window feedback to a motion that repeats itself: runs with random offsets show "
            "how its deviations go on, the regulator of least cost follows from that, and its own "
            "runs, pushed and not, are data for the next one. The result is for `reconstruct "
            "--window-feedback FILE`."
        ),
        epilog="example: actuated_characters fit-feedback --clip walk --rate 480 --delay-ticks 1 "
        "--output walk.gains.json",
    )
    command.set_defaults(command=_fit_feedback)
    command.add_argument("--character", default="humanoid", help="name (%(default)s)")
    command.add_argument("--clip", default="walk", help="name of a clip, or a file (%(default)s)")
    command.add_argument(
        "--cycles",
        type=int,
        default=8,
        metavar="N",
        help="of the clip, in each run; 2 or more (%(default)s)",
    )
    command.add_argument(
        "--output", type=Path, required=True, metavar="FILE", help="a .json file, the result"
    )
    command.add_argument("--overwrite", action="store_true", help="replace FILE")
    command.add_argument(
        "--first",
        metavar="FILE",
        help="a window feedback to begin from: a file, or the name of a shipped one (none)",
    )
    command.add_argument(
        "--rounds", type=int, default=30, metavar="N", help="of fit and trial (%(default)s)"
    )
    command.add_argument(
        "--push",
        type=float,
        default=5.0,
        metavar="NS",
        help="N s, each two seconds from random sides (%(default)s)",
    )
    command.add_argument(
        "--headings",
        type=int,
        default=6,
        metavar="N",
        help="of the motion, as the engine's friction is not the same in all directions "
        "(%(default)s)",
    )
    command.add_argument("--seed", type=int, default=1, help="of all random numbers (1)")
    command.add_argument("--rate", type=int, default=240, metavar="HZ", help="control rate (240)")
    command.add_argument(
        "--delay-ticks", type=int, default=0, metavar="D", help="by which commands come late (0)"
    )
    command.add_argument(
        "--workers", type=int, metavar="N", help="processes (as many as there are cores)"
    )


def _fit_feedback(options: argparse.Namespace) -> None:
    from experiment.samcon.gains_file import check_joints, read_gains, write_gains
    from experiment.samcon.problem import Problem
    from experiment.samcon.reconstruction import duration_of
    from experiment.samcon.settings import preset
    from experiment.samcon.window_fitting import WindowFit, WindowFitState, fitted_windows

    workers = _checked(options)
    settings = preset(options.character, options.clip, options.rate, seed=options.seed)
    duration = duration_of(options.character, options.clip, options.cycles)
    first = read_gains(options.first) if options.first else None
    windows = None if first is None else first.windows
    settings = settings.dividing(duration / options.cycles, windows)
    simulator = {"rate": options.rate, "command_delay_ticks": options.delay_ticks}
    problem = Problem.of(options.character, options.clip, duration, settings, simulator)
    plan = problem.plan()  # what is wrong is said before anything begins
    problem.windows(plan)
    if first is not None:
        check_joints(options.first, first, plan.character.layout)
    fit = WindowFit(options.rounds, options.push, options.headings)
    bar = search_bar()
    task = bar.add_task(
        f"{options.character}: {options.clip}", total=fit.rounds, state="looks around"
    )

    def report(state: WindowFitState) -> None:
        held = f"{state.held:.0f} of {state.windows} windows, best {state.best:.0f}"
        bar.update(task, completed=state.round, state=held)
        write_gains(options.output, state.gains)

    with bar:
        found, held = fitted_windows(problem, settings, options.cycles, fit, workers, report, first)
        write_gains(options.output, found)
    Console().print(
        f"{options.output}: in the trials that chose it, pushed by {fit.push:g} N s each two "
        f"seconds, it held for {held:.0%} of {duration:.3g} s on average"
    )


def _checked(options: argparse.Namespace) -> int:
    """How many processes; raises ConfigurationError where options cannot be used."""
    from experiment.samcon.workers import MOST_ENGINES

    output: Path = options.output
    check_output(output)
    if output.exists() and not options.overwrite:
        raise ConfigurationError(f"{output} exists; --overwrite replaces it")
    for name, value, least, most in (
        ("rounds", options.rounds, _LEAST_ROUNDS, _MOST_ROUNDS),
        ("cycles", options.cycles, 2, 1000),
        ("headings", options.headings, 1, MOST_ENGINES),
        ("push", options.push, 0.0, 1000.0),
    ):
        if not least <= value <= most:
            raise ConfigurationError(f"--{name} is {value:g}; it must be {least:g} to {most:g}")
    return worker_count(options.workers)
