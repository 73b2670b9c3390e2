"""The command `actuated_characters fork`: a recorded run again up to a time, and then otherwise."""

import argparse
import sys
from pathlib import Path

from rich.console import Console

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import (
    CHARACTER,
    NODES,
    Commands,
    add_bag,
    add_command,
    add_inputs,
    add_repeated,
    node_settings,
)
from actuated_characters.commands.common.tables import make_table

_ABOUT = (
    "Repeat a recorded run up to a time, bit for bit, with the real nodes, and go on otherwise: "
    "with pushes, throws and parameters that count from that tick on. The fork is recorded as a "
    "run that says where it comes from. What the recording was sent after that time (pushes, "
    "throws, resets, parameters, trajectories, strengths) is sent again, too. Each state up to the "
    "fork is compared with the recorded one."
)


def add_fork(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    fork = add_command(
        commands,
        _fork,
        "fork",
        "repeat a recorded run up to a time, and go on otherwise",
        _ABOUT,
        [
            "fork runs/demo --at 3.2 --push chest:150,0,0@3.3",
            "fork runs/demo --at 3.2 --set controller_node.gain_scale.p:=0.7 --duration 10",
        ],
    )
    fork.set_defaults(character=CHARACTER)  # a shell completes this character's parameters
    add_bag(fork)
    at = "time of the last state in common, in s since the first one"
    fork.add_argument("--at", type=float, required=True, metavar="S", help=at)
    add_inputs(fork, "from --at on", " that may change in a run (live), from --at on")
    add_repeated(
        fork,
        "--throw",
        "'mass=KG speed=M/S at=S target=LINK'",
        "a ball that hits a link, where the recording has it, at a time in s; as those of `run`",
    )
    fork.add_argument(
        "--no-later-inputs",
        action="store_true",
        help="leave out what the recording was sent from --at on",
    )
    fork.add_argument(
        "--duration", type=float, metavar="S", help="length from the first state on, s (the run's)"
    )
    fork.add_argument(
        "--output",
        type=Path,
        metavar="DIR",
        help="where the results go (RUN-fork, with a number if it exists)",
    )
    fork.add_argument(
        "--from-start",
        action="store_true",
        help="repeat, and record, the whole past; else only what follows the last keyframe before "
        "--at, which the recording has every few seconds",
    )
    fork.add_argument("--overwrite", action="store_true", help="replace the results in DIR")
    fork.add_argument(
        "--through-topics",
        action="store_true",
        help="run all nodes as processes that speak over topics, not in this process: the same bag",
    )


def _fork(options: argparse.Namespace) -> None:
    from actuated_characters.bags.format.metadata import BAG
    from actuated_characters.fork.execution import describe_new_hits, run_fork
    from actuated_characters.fork.plan import ForkInputs, plan_fork
    from actuated_characters.recorder.run_directory import (
        PLOT,
        prepare_directory,
        prepare_free_directory,
        read_metrics,
    )
    from actuated_characters.report.metrics_plot import describe_metrics, plot_metrics
    from msgs_config.errors import ConfigurationError

    run = options.bag.absolute()
    run = run.parent if run.name == BAG else run
    directory = (options.output or run.with_name(f"{run.name}-fork")).absolute()
    if directory.resolve() == run.resolve():
        raise ConfigurationError(f"--output {directory} is the run that is forked")
    settings = node_settings(options.set, NODES)
    inputs = ForkInputs(settings, options.push, options.throw, not options.no_later_inputs)
    planned = plan_fork(
        options.bag, options.at, inputs, options.duration, from_start=options.from_start
    )
    if options.output is None and not options.overwrite:
        directory = prepare_free_directory(directory)
    else:
        prepare_directory(directory, overwrite=options.overwrite)
    for warning in planned.warnings:
        print(warning)
    last = planned.plan.ticks
    name = f"{planned.recording.character.name}: {run.name}, forked"
    with progress_bar(name, last, "ticks") as bar:
        try:
            run_fork(
                planned,
                directory,
                progress=lambda ticks: bar.update(bar.task_ids[0], completed=min(ticks, last)),
                through_topics=options.through_topics,
            )
        except KeyboardInterrupt:
            print(f"the results in {directory} are not complete", file=sys.stderr)
            raise
        bar.update(bar.task_ids[0], completed=last)
    plot_metrics(directory)
    metrics = describe_metrics(read_metrics(directory)[0])
    Console().print(make_table(f"results in {directory}", ("figure", "value"), metrics))
    for text, hit in zip(options.throw, describe_new_hits(planned, directory), strict=False):
        print(f"throw '{text}': {hit}")
    print(f"forked from {planned.origin}")
    print(f"a picture of the figures: {directory / PLOT}")
