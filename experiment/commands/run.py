"""The command `actuated_characters run`: simulator, controller and recorder, and their figures."""

import argparse
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import yaml
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from msgs_config.errors import ConfigurationError, one_of

if TYPE_CHECKING:  # it takes a second to import
    from experiment.plan import Plan
    from experiment.planned_push import PlannedPush
    from msgs_config.parameters import Values

_NODES = ("sim_node", "controller_node")


def add_run(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    run = commands.add_parser(
        "run",
        help="run simulator, controller and recorder",
        description="Run simulator, controller and recorder in lockstep, and report the figures.",
        epilog="example: actuated_characters run --clip walk --set controller_node.law:=pd",
    )
    run.set_defaults(command=_run)
    run.add_argument(
        "--character",
        default="humanoid",
        help="name, or path of a .yaml or .urdf file (%(default)s)",
    )
    _add_tracked(run)
    run.add_argument(
        "--duration",
        type=float,
        default=10.0,
        metavar="S",
        help="simulated time in s (%(default)g)",
    )
    run.add_argument(
        "--output", type=Path, metavar="DIR", help="where the results go (runs/CHARACTER-MOTION)"
    )
    run.add_argument("--overwrite", action="store_true", help="replace the results in DIR")
    run.add_argument("--no-record", action="store_true", help="write no bag")
    run.add_argument(
        "--contacts", action="store_true", help="have the bag hold what touched what, too"
    )
    run.add_argument(
        "--push",
        action="append",
        default=[],
        metavar="LINK:FX,FY,FZ@S",
        help="a force in N, world axes, on a link at a time in s, for sim_node.wrench_duration; "
        "may be repeated",
    )
    run.add_argument(
        "--in-process", action="store_true", help="one process without ROS: the same states, no bag"
    )
    run.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NODE.NAME:=VALUE",
        help="a parameter of sim_node or controller_node; may be repeated",
    )


def _add_tracked(run: argparse.ArgumentParser) -> None:
    """Add the options that say what is tracked."""
    tracked = run.add_mutually_exclusive_group()
    tracked.add_argument("--clip", help="track this motion clip: a name or a file")
    tracked.add_argument(
        "--keyframes", help="track these keyframes: a shipped name or a .yaml file"
    )
    tracked.add_argument(
        "--reference",
        choices=["hold", "step", "sine"],
        help="the rest pose (hold, the default), or a test signal from it",
    )


def _run(options: argparse.Namespace) -> None:
    from experiment.figures import plot_figures, prepare_directory

    settings = _settings(options.set)
    plan = _checked_plan(options, settings["sim_node"], settings["controller_node"])
    pushes = [_push(text, plan) for text in options.push]
    motion = _name_of(plan.controller)
    name = f"{plan.character.name}-{Path(motion).stem}"
    directory = (options.output or Path("runs") / name).absolute()
    prepare_directory(directory, overwrite=options.overwrite)
    for note in plan.notes:
        print(note)
    with _progress_bar(f"{plan.character.name}: {motion}", plan.ticks) as bar:

        def progress(ticks: int) -> None:
            bar.update(bar.task_ids[0], completed=min(ticks, plan.ticks))

        try:
            _run_plan(options, plan, directory, pushes, progress)
        except KeyboardInterrupt:
            print(f"the results in {directory} are not complete", file=sys.stderr)
            raise
        progress(plan.ticks)
    plot_figures(directory)
    _report(directory)


def _checked_plan(
    options: argparse.Namespace, simulator: dict[str, object], controller: dict[str, object]
) -> "Plan":
    """What is to be run; raises ActuatedCharactersError where options contradict each other."""
    from experiment.plan import make_plan
    from sim_node.parameters import tick_period

    plan = make_plan(
        options.character, options.duration, _reference(options), simulator, controller
    )
    if options.in_process and tick_period(plan.simulator):
        raise ConfigurationError(
            "--in-process runs in lockstep as fast as it can; it takes neither 'mode' realtime "
            "nor a 'real_time_factor'"
        )
    if options.contacts and (options.in_process or options.no_record):
        raise ConfigurationError(
            "--contacts is about the bag; with --in-process or --no-record there is none"
        )
    return plan


def _run_plan(
    options: argparse.Namespace,
    plan: "Plan",
    directory: Path,
    pushes: "Sequence[PlannedPush]",
    progress: Callable[[int], None],
) -> None:
    from experiment.run import run_in_process, run_over_topics

    if options.in_process:
        run_in_process(plan, directory, progress=progress, pushes=pushes)
        return
    run_over_topics(
        plan,
        directory,
        write_bag=not options.no_record,
        progress=progress,
        contacts=options.contacts,
        pushes=pushes,
    )


def _name_of(controller: "Values") -> str:
    """The name of the motion that a controller's parameters say."""
    kind = controller.text("reference")
    return controller.text(kind) if kind in ("clip", "keyframes") else kind


def _reference(options: argparse.Namespace) -> dict[str, object]:
    """The controller's parameters of what is tracked."""
    for kind in ("clip", "keyframes"):
        name = getattr(options, kind)
        if name is not None:
            return {"reference": kind, kind: name}
    return {"reference": options.reference or "hold"}


def _push(text: str, plan: "Plan") -> "PlannedPush":
    """What `--push LINK:FX,FY,FZ@S` says."""
    from experiment.planned_push import planned_push

    found = re.fullmatch(r"(.+):([^,@]+),([^,@]+),([^,@]+)@([^,@]+)", text)
    try:
        if found is None:
            raise ValueError
        x, y, z, time = (float(number) for number in found.groups()[1:])
    except ValueError:
        raise ConfigurationError(
            f"--push {text}: write it as LINK:FX,FY,FZ@S, such as chest:100,0,0@1.5"
        ) from None
    return planned_push(plan, found[1], (x, y, z), time)


def _settings(texts: Sequence[str]) -> dict[str, dict[str, object]]:
    """What `--set NODE.NAME:=VALUE` says, by node; values are YAML."""
    settings: dict[str, dict[str, object]] = {node: {} for node in _NODES}
    for text in texts:
        name, assigns, value = text.partition(":=")
        node, dot, parameter = name.partition(".")
        if not (assigns and dot and parameter):
            raise ConfigurationError(f"--set {text}: write it as NODE.NAME:=VALUE")
        if node not in settings:
            raise ConfigurationError(f"--set {text}: {one_of('node', node, list(_NODES))}")
        try:
            settings[node][parameter] = yaml.safe_load(value)
        except (yaml.YAMLError, ValueError, RecursionError) as error:
            raise ConfigurationError(f"--set {text}: the value is not valid YAML") from error
    return settings


def _progress_bar(description: str, ticks: int) -> Progress:
    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f} ticks"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )
    bar.add_task(description, total=ticks)
    return bar


def _report(directory: Path) -> None:
    from experiment.figures import read_figures

    summary, _ = read_figures(directory)
    table = Table(title=escape(f"results in {directory}"), title_justify="left")
    table.add_column("figure")
    table.add_column("value", justify="right", overflow="fold")
    for name, value in summary.items():
        shown = f"{value:.4g}" if isinstance(value, float) else str(value)
        table.add_row(name, "-" if value is None else shown)
    Console().print(table)
