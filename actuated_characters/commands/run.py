"""The command `actuated_characters run`: simulator, controller and recorder, and their figures."""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import (
    add_repeated,
    bring_parameters,
    node_settings,
)
from msgs_config.errors import ConfigurationError, one_of

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.runs.plan import Plan
    from actuated_characters.runs.planned_throws import PlannedThrow
    from actuated_characters.runs.planned_wrenches import PlannedPush
    from controller_node.references.files.reconstructed import FoundWith
    from msgs_config.parameters import Values

_NODES = ("sim_node", "controller_node")
_DURATION = 10.0  # s
_NO_PUSH = "none"
_RECORDING = {  # options, and the recorder's parameters
    "storage": "storage",
    "compression": "compression",
    "topic": "topics",
    "exclude": "exclude",
}


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
        "--behaviour",
        choices=["tracking", "ragdoll", "active_ragdoll", "reactive"],
        help="track whatever comes (tracking, the default); be limp; go limp on a hard hit, and "
        "get up; or react to hits",
    )
    run.add_argument(
        "--planner",
        choices=["none", "predictive"],
        help="keep the motion by joint torques alone, planned ahead (predictive: without root "
        "assistance; needs the extra 'plan'), or not (none, the default)",
    )
    run.add_argument(
        "--duration",
        type=float,
        metavar="S",
        help=f"simulated time in s ({_DURATION:g}, or that of a reconstruction)",
    )
    run.add_argument(
        "--output", type=Path, metavar="DIR", help="where the results go (runs/CHARACTER-MOTION)"
    )
    run.add_argument("--overwrite", action="store_true", help="replace the results in DIR")
    _add_recorded(run)
    add_repeated(
        run,
        "--push",
        "LINK:FX,FY,FZ@S",
        "a force in N, world axes, on a link at a time in s, for sim_node.wrench_duration. A "
        "reconstruction brings those that it was found with, but for others that are given; none: "
        "without any",
    )
    add_repeated(
        run,
        "--throw",
        "'mass=KG speed=M/S at=S target=LINK'",
        "a ball that hits a link, where the reference has it, at a time in s; from=front, left, "
        "right, back, above or degrees (front), distance=M (2), radius=M",
    )
    run.add_argument(
        "--in-process", action="store_true", help="one process without ROS: the same states, no bag"
    )
    add_repeated(run, "--set", "NODE.NAME:=VALUE", "a parameter of sim_node or controller_node")


def _add_tracked(run: argparse.ArgumentParser) -> None:
    """Add the options that say what is tracked."""
    tracked = run.add_mutually_exclusive_group()
    tracked.add_argument(
        "--clip",
        help="track this motion clip: a name or a file. One by `reconstruct` brings the length, "
        "the parameters and the pushes that it was found with; --duration, --set and --push take "
        "precedence",
    )
    tracked.add_argument(
        "--keyframes", help="track these keyframes: a shipped name or a .yaml file"
    )
    tracked.add_argument(
        "--reference",
        choices=["hold", "step", "sine"],
        help="the rest pose (hold, the default), or a test signal from it",
    )


def _add_recorded(run: argparse.ArgumentParser) -> None:
    """Add the options that say what is recorded, and how."""
    run.add_argument("--no-record", action="store_true", help="write no bag")
    run.add_argument("--storage", choices=["mcap", "sqlite3"], help="how the bag is stored (mcap)")
    run.add_argument(
        "--compression", choices=["none", "zstd"], help="how the bag is compressed (none)"
    )
    run.add_argument(
        "--topic",
        action="append",
        metavar="NAME",
        help="record this topic beside those of the simulation; may be repeated",
    )
    run.add_argument(
        "--exclude",
        action="append",
        metavar="NAME",
        help="do not record this topic of the simulation, such as contacts; may be repeated",
    )


def _run(options: argparse.Namespace) -> None:
    from actuated_characters.runs.run_directory import plot_figures, prepare_directory

    run = planned_run(options)
    plan, motion = run.plan, _name_of(run.plan.controller)
    name = f"{plan.character.name}-{Path(motion).stem}"
    directory = (options.output or Path("runs") / name).absolute()
    prepare_directory(directory, overwrite=options.overwrite)
    for warning in run.warnings:
        print(warning)
    if run.pushes and not options.push:
        print(f"{options.clip} brings {len(run.pushes)} pushes (--push none: without them)")
    with progress_bar(f"{plan.character.name}: {motion}", plan.ticks, "ticks") as bar:

        def progress(ticks: int) -> None:
            bar.update(bar.task_ids[0], completed=min(ticks, plan.ticks))

        try:
            _run_plan(options, run, directory, progress)
        except KeyboardInterrupt:
            print(f"the results in {directory} are not complete", file=sys.stderr)
            raise
        progress(plan.ticks)
    plot_figures(directory)
    _report(directory)


@dataclass(frozen=True)
class PlannedRun:
    """What the command's options ask for."""

    plan: "Plan"
    pushes: "Sequence[PlannedPush]"
    throws: "Sequence[PlannedThrow]"
    warnings: Sequence[str]  # what whoever runs it should know


def planned_run(options: argparse.Namespace) -> PlannedRun:
    """What is to be run; raises ActuatedCharactersError where it cannot be."""
    from actuated_characters.runs.planned_throws import plan_throws

    settings = node_settings(options.set, _NODES)
    for name in ("behaviour", "planner"):
        _set_option(name, getattr(options, name), settings["controller_node"])
    simulator, controller = settings["sim_node"], settings["controller_node"]
    found_in = bring_parameters(options.character, options.clip, simulator, controller)
    plan = _checked_plan(options, simulator, controller, found_in)
    pushes = _pushes(options.push, plan, found_in)
    throws, in_the_way = plan_throws(plan, options.throw)
    return PlannedRun(plan, pushes, throws, [*plan.warnings, *in_the_way])


def _checked_plan(
    options: argparse.Namespace,
    simulator: dict[str, object],
    controller: dict[str, object],
    found_in: "FoundWith | None",
) -> "Plan":
    """What is to be run; raises ActuatedCharactersError where options contradict each other."""
    from actuated_characters.runs.plan import make_plan
    from sim_node.node_settings import make_node_settings

    duration = _DURATION if found_in is None else found_in.duration
    if options.duration is not None:
        duration = options.duration
    plan = make_plan(options.character, duration, _reference(options), simulator, controller)
    if options.in_process and make_node_settings(plan.simulator).tick_period:
        raise ConfigurationError(
            "--in-process runs in lockstep as fast as it can; it takes neither 'mode' realtime "
            "nor a 'real_time_factor'"
        )
    about_bag = [f"--{name}" for name in _RECORDING if getattr(options, name) is not None]
    if about_bag and (options.in_process or options.no_record):
        raise ConfigurationError(
            f"{about_bag[0]} is about the bag; with --in-process or --no-record there is none"
        )
    for name in options.exclude or ():
        _check_excludable(name)
    return plan


def _check_excludable(name: str) -> None:
    """Raise ConfigurationError unless the recorder may do without a topic."""
    from actuated_characters.recorder.topics import EXCLUDABLE

    if name not in EXCLUDABLE and name.removeprefix("/") not in EXCLUDABLE:
        raise ConfigurationError(one_of("topic to --exclude:", name, EXCLUDABLE))


def _run_plan(
    options: argparse.Namespace,
    run: PlannedRun,
    directory: Path,
    progress: Callable[[int], None],
) -> None:
    from actuated_characters.runs.execution import run_in_process, run_over_topics

    plan, pushes, throws = run.plan, run.pushes, run.throws
    if options.in_process:
        run_in_process(plan, directory, progress=progress, pushes=pushes, throws=throws)
        return
    run_over_topics(
        plan,
        directory,
        write_bag=not options.no_record,
        progress=progress,
        recording=_recording(options),
        pushes=pushes,
        throws=throws,
    )


def _recording(options: argparse.Namespace) -> dict[str, object]:
    """The recorder's parameters that the options say."""
    given = {parameter: getattr(options, name) for name, parameter in _RECORDING.items()}
    return {parameter: value for parameter, value in given.items() if value is not None}


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


def _pushes(texts: list[str], plan: "Plan", found_in: "FoundWith | None") -> "list[PlannedPush]":
    """Those of `--push`; without any, those with which a reconstruction was found."""
    from actuated_characters.runs.planned_wrenches import parsed_push, pushes_within

    if _NO_PUSH in texts:
        if set(texts) != {_NO_PUSH}:
            raise ConfigurationError(f"--push {_NO_PUSH} goes with no other --push")
        return []
    if texts or found_in is None:
        return [parsed_push(text, plan) for text in texts]
    return pushes_within(found_in.pushes, plan)


def _set_option(name: str, value: str | None, controller: dict[str, object]) -> None:
    """Set what an option says. Raises ConfigurationError if `--set` says another value."""
    if value is not None and controller.setdefault(name, value) != value:
        raise ConfigurationError(
            f"--{name} is {value}, and --set controller_node.{name} is {controller[name]}; "
            "give one of them"
        )


def _report(directory: Path) -> None:
    from actuated_characters.runs.run_directory import read_figures

    summary, _ = read_figures(directory)
    table = Table(title=escape(f"results in {directory}"), title_justify="left")
    table.add_column("figure")
    table.add_column("value", justify="right", overflow="fold")
    for name, value in summary.items():
        table.add_row(name, _shown(value))
    Console().print(table)


def _shown(value: object) -> str:
    """A figure as the table has it."""
    if isinstance(value, dict):
        return ", ".join(f"{name}: {part}" for name, part in value.items()) or "none"
    if isinstance(value, float):
        return f"{value:.4g}"
    return "-" if value is None else str(value)
