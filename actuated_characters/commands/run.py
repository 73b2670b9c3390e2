"""The command `actuated_characters run`: simulator, controller and recorder, and their figures."""

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.interruption import check_interruption
from actuated_characters.commands.common.parameter_list import print_parameters
from actuated_characters.commands.common.planned_run import DURATION, PlannedRun, planned_run
from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.run_options import (
    ALL_SENSORS,
    add_loop,
    add_recorded,
    add_tracked,
    add_viewed,
)
from actuated_characters.commands.common.settings import (
    CHARACTER,
    NODES,
    Commands,
    add_character,
    add_command,
    add_inputs,
    add_repeated,
)
from actuated_characters.commands.common.skin_options import given_skin
from actuated_characters.commands.common.tables import make_table
from actuated_characters.commands.view import server_parameters
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.runtime.extras import require_extra

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.runs.plan import RunPlan

_RECORDING = {  # the recorder's parameters by the names of options
    "compression": "compression",
    "log_time": "log_time",
    "topic": "topics",
    "sensor": "sensors",
    "exclude": "exclude",
}


def add_run(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    run = add_command(
        commands,
        _run,
        "run",
        "run simulator, controller and recorder",
        "Run simulator, controller and recorder in lockstep, and report the figures. Without any "
        "option: say what there is to run.",
        ["run --clip walk --set controller_node.gain_scale.p:=0.5"],
    )
    run.add_argument(
        "--parameters",
        choices=(*NODES, "recorder"),
        help="list this node's parameters, with the values that the run would have, and end",
    )
    add_character(run, None, f"{CHARACTER}, or that of a timeline")
    add_tracked(run)
    run.add_argument(
        "--duration",
        type=float,
        metavar="S",
        help=f"simulated time in s ({DURATION:g}, or that of a reconstruction or timeline)",
    )
    run.add_argument(
        "--output",
        type=Path,
        metavar="DIR",
        help="where the results go (runs/CHARACTER-MOTION, with a number if it exists)",
    )
    run.add_argument("--overwrite", action="store_true", help="replace the results in DIR")
    add_recorded(run)
    add_inputs(
        run,
        "for sim_node.wrench_duration. A reconstruction brings those that it was found with, "
        "unless others are given; none: without any",
    )
    add_repeated(
        run,
        "--throw",
        "'mass=KG speed=M/S at=S target=LINK'",
        "a ball that hits a link, where the reference has it, at a time in s; from=front, left, "
        "right, back, above or degrees (front), distance=M (2), radius=M; shape=box "
        "size=LENGTHxWIDTHxHEIGHT (m), with slide=true along the ground",
    )
    add_loop(run)
    add_viewed(run)


def _run(options: argparse.Namespace) -> None:
    from actuated_characters.recorder.run_directory import (
        PLOT,
        prepare_directory,
        prepare_free_directory,
        read_metrics,
    )
    from actuated_characters.report.metrics_plot import describe_metrics, plot_metrics

    if options.parameters is not None:
        plan = planned_run(options).plan
        check_options(options, plan)
        print_parameters(options.parameters, plan, recording_of(options, plan))
        return
    if options.view:
        require_extra("view", "--view")
        given_skin(options)  # its errors come before all the work
    elif options.skin or options.skin_map:
        raise ConfigurationError("--skin and --skin-map are of --view")
    if not options.in_process:
        require_extra("wheels", "a run over topics, unlike one --in-process,")
    run = planned_run(options)
    plan, motion = run.plan, run.plan.motion_name
    check_options(options, plan)
    name = f"{plan.character.name}-{Path(motion).stem}"
    directory = (options.output or Path("runs") / name).absolute()
    if options.output is None and not options.overwrite:
        directory = prepare_free_directory(directory)
    else:
        prepare_directory(directory, overwrite=options.overwrite)
    for warning in run.warnings:
        print(warning)
    if run.inputs.pushes and not options.push and options.timeline is None:
        print(f"{options.clip} brings {len(run.inputs.pushes)} pushes (--push none: without them)")
    with progress_bar(f"{plan.character.name}: {motion}", plan.ticks, "ticks") as bar:

        def progress(ticks: int) -> None:
            bar.update(bar.task_ids[0], completed=min(ticks, plan.ticks))

        try:
            hits = _run_plan(options, run, directory, progress)
        except KeyboardInterrupt:
            print(f"the results in {directory} are not complete", file=sys.stderr)
            raise
        progress(plan.ticks)
    plot_metrics(directory)
    metrics = describe_metrics(read_metrics(directory)[0])
    Console().print(make_table(f"results in {directory}", ("figure", "value"), metrics))
    own = len(hits) - len(options.throw)  # those of a timeline come first
    names = [f"throws {number}" for number in range(1, own + 1)]
    for name, hit in zip(
        [*names, *(f"throw '{each}'" for each in options.throw)], hits, strict=True
    ):
        print(f"{name}: {hit}")
    print(f"a picture of the figures: {directory / PLOT}")


def check_options(options: argparse.Namespace, plan: "RunPlan") -> None:
    """Raise ConfigurationError where options contradict each other."""
    if options.in_process and options.view:
        raise ConfigurationError("--view shows what is on ROS' topics; --in-process has none")
    if options.in_process and options.topic:
        raise ConfigurationError(
            "--topic records what other nodes publish; with --in-process there are none"
        )
    about_bag = [name for name in _RECORDING if getattr(options, name) is not None]
    if about_bag and options.no_record:
        option = about_bag[0].replace("_", "-")
        raise ConfigurationError(f"--{option} is about the bag; with --no-record there is none")
    if options.exclude:
        from actuated_characters.recorder.topics import EXCLUDABLE

        for name in options.exclude:
            if not {name, name.removeprefix("/")} & set(EXCLUDABLE):
                raise ConfigurationError(one_of("topic to --exclude:", name, EXCLUDABLE))
    _recorded_sensors(options, plan)


def _recorded_sensors(options: argparse.Namespace, plan: "RunPlan") -> list[str] | None:
    """The topics of `--sensor`. Raises ConfigurationError if the character has no such sensor."""
    if options.sensor is None:
        return None
    known = [sensor.topic for sensor in plan.character.sensors]
    if not known:
        raise ConfigurationError(f"--sensor: character '{plan.character.name}' has no sensors")
    if ALL_SENSORS in options.sensor:
        return known
    for name in options.sensor:
        if name not in known:
            raise ConfigurationError(one_of("--sensor:", name, [*known, ALL_SENSORS]))
    return list(options.sensor)


def recording_of(options: argparse.Namespace, plan: "RunPlan") -> dict[str, object]:
    """The recorder's parameters that are given."""
    given = {parameter: getattr(options, name) for name, parameter in _RECORDING.items()}
    given["sensors"] = _recorded_sensors(options, plan)
    return {name: value for name, value in given.items() if value is not None}


def _run_plan(
    options: argparse.Namespace,
    planned: PlannedRun,
    directory: Path,
    progress: Callable[[int], None],
) -> list[str]:
    """Run a plan; returns of each throw whether the ball hit, and when."""
    from actuated_characters.runs.execution import run_over_topics
    from actuated_characters.runs.in_process import run_in_process
    from actuated_characters.runs.planned.throw_hits import describe_hits, read_states

    check_interruption()  # all modules are imported by now
    plan, throws = planned.plan, planned.inputs.throws
    if options.in_process:
        run = run_in_process
    else:
        viewer = server_parameters(options) if options.view else None
        run = partial(run_over_topics, composed=options.composed, viewer=viewer)
    run(
        plan,
        directory,
        write_bag=not options.no_record,
        progress=progress,
        recording=recording_of(options, plan),
        inputs=planned.inputs,
    )
    has_states = throws and not options.no_record
    return describe_hits(plan, throws, read_states(directory) if has_states else None)
