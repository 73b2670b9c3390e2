"""The command `actuated_characters shrink`: the fewest and smallest inputs with which it falls."""

import argparse
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.interruption import check_interruption
from actuated_characters.commands.common.progress import say
from actuated_characters.commands.common.row_workers import add_workers, worker_count
from actuated_characters.commands.common.settings import Commands, add_bag, add_command
from msgs_config.errors import ConfigurationError, RunError

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.shrink.minimal import Sizes
    from actuated_characters.shrink.shrinking import Shrinking
    from actuated_characters.shrink.trials import Trials


def add_shrink(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    command = add_command(
        commands,
        _shrink,
        "shrink",
        "the fewest and smallest inputs with which a run still falls",
        "Of a recorded run whose character fell, find the fewest and smallest inputs with which it "
        "still falls, at most 1 s later: pushes, balls, commanded velocities, changed parameters. "
        "Without any of them it does not, nor with 5 % less of one. The result is a run of its "
        "own, which can be replayed. Ctrl-C keeps the best so far.",
        ["shrink runs/felled"],
    )
    add_bag(command)
    command.add_argument(
        "--output",
        type=Path,
        metavar="DIR",
        help="where the results go (RUN-shrunk, with a number if it exists)",
    )
    command.add_argument("--overwrite", action="store_true", help="replace the results in DIR")
    add_workers(command)


def _shrink(options: argparse.Namespace) -> None:
    from actuated_characters.bags.format.metadata import BAG
    from actuated_characters.recorder.run_directory import (
        LOGS,
        PARAMETERS,
        prepare_directory,
        prepare_free_directory,
    )
    from actuated_characters.shrink.shrinking import plan_shrinking
    from actuated_characters.shrink.trials import Trials

    workers = worker_count(options)
    run = options.bag.absolute()
    run = run.parent if run.name == BAG else run
    directory = (options.output or run.with_name(f"{run.name}-shrunk")).absolute()
    if directory.resolve() == run.resolve():
        raise ConfigurationError(f"--output {directory} is the run that is to be shrunk")
    shrinking = plan_shrinking(options.bag)
    for warning in shrinking.fork.warnings:
        print(warning)
    if options.output is None and not options.overwrite:
        directory = prepare_free_directory(directory)
    else:
        prepare_directory(directory, overwrite=options.overwrite)
    check_interruption()  # all modules are imported by now
    with tempfile.TemporaryDirectory() as folder:
        trials = Trials(shrinking, Path(folder))
        try:
            sizes = _searched(trials, workers)
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt) and trials.best is not None:
                say("interrupted; the best so far, which may not be the least:")
                _write(shrinking, trials.best, directory)
            else:
                for folder in (directory / PARAMETERS, directory / LOGS, directory):
                    with suppress(OSError):  # it is not empty
                        folder.rmdir()
            raise
    _write(shrinking, sizes, directory)


def _searched(trials: "Trials", workers: int) -> "Sizes":
    """Have the trials done; shows how far they are."""
    from actuated_characters.shrink.trials import shrink

    total = trials.shrinking.total
    with Console(stderr=True).status("") as status:

        def report(trials: "Trials") -> None:
            best = trials.best or dict.fromkeys(trials.shrinking.order, 1.0)
            shares = ", ".join(f"{100.0 * size:.3g} %" for size in best.values())
            left = f"{len(best)} of {total} inputs left" + (f" ({shares})" if trials.best else "")
            status.update(f"trial {trials.count}: {left}")

        trials.report = report
        with trials.at_once(workers):
            return shrink(trials)


def _write(shrinking: "Shrinking", sizes: "Sizes", directory: Path) -> None:
    """Say what is left, and run it into a directory, whole or not at all."""
    from actuated_characters.bags.format.metadata import BAG
    from actuated_characters.recorder.run_directory import read_metrics
    from actuated_characters.report.metrics_plot import plot_metrics
    from actuated_characters.shrink.shrinking import run_shrunk

    print(f"{len(sizes)} of {shrinking.total} inputs are left" + (":" if sizes else ""))
    for line in [*shrinking.describe(sizes), f"--duration {shrinking.duration:g}"]:
        print(f"  {line}", flush=True)
    try:
        run_shrunk(shrinking, sizes, directory)
        plot_metrics(directory)
        fell_at = read_metrics(directory)[0]["fell_at_s"]
    except BaseException:
        shutil.rmtree(directory, ignore_errors=True)  # a part of it would look like the whole
        raise
    if fell_at is None:
        raise RunError(f"with what is left it does not fall in a whole run: {directory}")
    print(f"it falls at {fell_at:.3g} s; the run: {directory / BAG}")
