"""The command `actuated_characters`: runs of simulator and controller, and what there is to run."""

import argparse
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

import yaml
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from experiment.cli_render import add_render
from experiment.cli_study import add_study
from msgs_config.errors import ActuatedCharactersError, ConfigurationError, one_of
from msgs_config.parameters import Parameter
from msgs_config.process import EXIT_ERROR, limit_threads

_NODES = ("sim_node", "controller_node")
_interrupted = False
_EXIT_INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    limit_threads()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)
    try:
        options = _parser().parse_args(arguments)
        options.command(options)
    except (ActuatedCharactersError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_ERROR
    except BaseException:  # a module that was being imported may have turned it into its own
        if not _interrupted:
            raise
        print("interrupted", file=sys.stderr)
        return _EXIT_INTERRUPTED
    return 0


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _interrupted
    del number, frame
    _interrupted = True
    raise _Interrupted


class _Interrupted(KeyboardInterrupt):
    """Not KeyboardInterrupt itself: where that goes through code that was made from a text, such
    as a dataclass's, Python remembers it, and in the end kills a module that was run by `-m`.
    """


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="actuated_characters",
        description="Simulated characters, actuated by torques over ROS 2 topics.",
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
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
    tracked = run.add_mutually_exclusive_group()
    tracked.add_argument("--clip", help="track this motion clip: a name or a file")
    tracked.add_argument("--reference", choices=["hold"], help="hold: the rest pose (the default)")
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
        "--in-process", action="store_true", help="one process without ROS: the same states, no bag"
    )
    run.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NODE.NAME:=VALUE",
        help="a parameter of sim_node or controller_node; may be repeated",
    )
    add_render(commands)
    add_study(commands)
    listing = commands.add_parser("list", help="list the characters and their clips")
    listing.set_defaults(command=_list)
    parameters = commands.add_parser(
        "parameters", help="list a node's parameters", description="List a node's parameters."
    )
    parameters.set_defaults(command=_parameters)
    parameters.add_argument("node", choices=(*_NODES, "recorder"))
    parameters.add_argument(
        "--character", default="humanoid", help="name, or path of a .yaml or .urdf file"
    )
    return parser


def _run(options: argparse.Namespace) -> None:
    from experiment.figures import plot_figures, prepare_directory
    from experiment.plan import make_plan
    from experiment.run import run_in_process, run_over_topics
    from sim_node.parameters import tick_period

    settings = _settings(options.set)
    reference = {"reference": "hold"}
    if options.clip is not None:
        reference = {"reference": "clip", "clip": options.clip}
    plan = make_plan(
        options.character,
        options.duration,
        reference,
        settings["sim_node"],
        settings["controller_node"],
    )
    motion = options.clip or "hold"
    if options.in_process and tick_period(plan.simulator):
        raise ConfigurationError(
            "--in-process runs in lockstep as fast as it can; it takes neither 'mode' realtime "
            "nor a 'real_time_factor'"
        )
    if options.contacts and (options.in_process or options.no_record):
        raise ConfigurationError(
            "--contacts is about the bag; with --in-process or --no-record there is none"
        )
    name = f"{plan.character.name}-{Path(motion).stem}"
    directory = (options.output or Path("runs") / name).absolute()
    prepare_directory(directory, overwrite=options.overwrite)
    for note in plan.notes:
        print(note)
    with _progress_bar(f"{plan.character.name}: {motion}", plan.ticks) as bar:

        def progress(ticks: int) -> None:
            bar.update(bar.task_ids[0], completed=min(ticks, plan.ticks))

        try:
            if options.in_process:
                run_in_process(plan, directory, progress=progress)
            else:
                run_over_topics(
                    plan,
                    directory,
                    write_bag=not options.no_record,
                    progress=progress,
                    contacts=options.contacts,
                )
        except KeyboardInterrupt:
            print(f"the results in {directory} are not complete", file=sys.stderr)
            raise
        progress(plan.ticks)
    plot_figures(directory)
    _report(directory)


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
        TextColumn("{task.description}"),
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


def _list(options: argparse.Namespace) -> None:
    del options
    from controller_node.references.clip_file import available_clips
    from msgs_config.character_file import shipped_characters
    from msgs_config.character_loading import load_character

    table = Table(title="characters", title_justify="left")
    for column in ("name", "degrees of freedom", "mass", "clips"):
        table.add_column(column)
    for name in shipped_characters():
        character = load_character(name)
        clips = ", ".join(available_clips(character)) or "-"
        base = "floating" if character.layout.has_floating_base else "fixed"
        freedom = f"{character.layout.size}, {base} base"
        table.add_row(name, freedom, f"{character.mass:.3g} kg", clips)
    Console().print(table)


def _parameters(options: argparse.Namespace) -> None:
    listed = _parameters_of(options.node, options.character)
    table = Table(title=f"parameters of {options.node}", title_justify="left")
    for column in ("name", "default", "unit", "description"):
        table.add_column(column, overflow="fold")
    for parameter in listed:
        choices = f": {' | '.join(parameter.choices)}" if parameter.choices else ""
        live = " (live)" if parameter.live else ""
        default = _shortened(parameter.default)
        table.add_row(
            parameter.name, escape(default), parameter.unit, parameter.description + choices + live
        )
    Console().print(table)


def _parameters_of(node: str, character_name: str) -> list[Parameter]:
    from controller_node import parameters as controller
    from experiment import recorder
    from msgs_config.character_loading import load_character
    from sim_node import parameters as simulator

    if node == "recorder":
        return recorder.PARAMETERS
    character = load_character(character_name)
    if node == "sim_node":
        own = simulator.character_parameters(character)
        return [simulator.CHARACTERS, *simulator.PARAMETERS, *own]
    return controller.PARAMETERS + controller.character_parameters(character)


def _shortened(value: object) -> str:
    """A default as a table shows it; a long list by its first entries."""
    if isinstance(value, list):
        shown = ", ".join(f"{item:g}" if isinstance(item, float) else item for item in value[:3])
        return f"[{shown}, ... {len(value)} in all]" if len(value) > 3 else f"[{shown}]"
    return f"{value:g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    sys.exit(main())
