"""The command `actuated_characters play`: a scene in the browser, to be watched and touched."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.interruption import check_interruption
from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import (
    NODES,
    Commands,
    add_command,
    add_repeated,
    node_settings,
)
from actuated_characters.commands.common.skin_options import given_skin
from actuated_characters.commands.common.tables import make_table
from actuated_characters.commands.view import add_server, server_parameters
from msgs_config.errors import ConfigurationError
from msgs_config.runtime.extras import require_extra

if TYPE_CHECKING:  # it takes a while to import
    from actuated_characters.scenes.scene import Scene

_SCENE = "walker"
_DURATION = 600.0  # s
_MOST_COLUMNS = 4  # characters whose figures are shown beside each other
_FIGURES_OF_MANY = ("sim_time_s", "real_time_factor", "fell", "joint_error_mean_rad")
_LAST_MEGABYTES = 150.0  # MB, the least that is kept of a scene without --output


def add_play(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    play = add_command(
        commands,
        _play,
        "play",
        "play a scene in a browser: push its characters, throw balls at them",
        "Play a scene in real time in a browser: drag a body to push it, click on it with Shift to "
        "throw a ball at it. Ctrl-C ends it. The last minutes are recorded, or with --output all. "
        "Needs the extra 'view'.",
        ["play", "play --scene brawl", "play --lecture"],
    )
    play.add_argument(
        "--scene",
        default=_SCENE,
        metavar="NAME",
        help="which (%(default)s; --list says what there is), or a .yaml file of parameters",
    )
    play.add_argument("--list", action="store_true", help="list the scenes, a line each, and end")
    play.add_argument(
        "--lecture",
        action="store_true",
        help="list the lecture's slides with the scenes and studies of each, and end",
    )
    play.add_argument(
        "--duration",
        type=float,
        default=_DURATION,
        metavar="S",
        help="simulated time in s, unless it is ended before (%(default)g)",
    )
    play.add_argument(
        "--output",
        type=Path,
        metavar="DIR",
        help="where the results go, with a recording of all (runs/play-SCENE, which is replaced, "
        f"with one of the last {_LAST_MEGABYTES:g} to {2.0 * _LAST_MEGABYTES:g} MB)",
    )
    play.add_argument("--overwrite", action="store_true", help="replace the results in DIR")
    play.add_argument("--no-view", action="store_true", help="without a browser")
    add_repeated(
        play,
        "--set",
        "NODE.NAME:=VALUE",
        "a parameter of sim_node, or of the controller_node of every character",
    )
    add_server(play)


def _play(options: argparse.Namespace) -> None:
    from actuated_characters.scenes.scene import load_scene, scene_names

    if options.list:
        for name in scene_names():
            print(f"{name}: {load_scene(name).title}")
        return
    if options.lecture:
        _print_lecture()
        return
    if not options.no_view:
        require_extra("view", "play (without --no-view)")
    elif options.skin or options.skin_map:
        raise ConfigurationError("--skin and --skin-map are of a browser; leave out --no-view")
    given_skin(options)  # its errors come before all the work
    scene = load_scene(options.scene, node_settings(options.set, NODES))
    if scene.search:
        from actuated_characters.commands.motion.search_scene import play_search

        play_search(options, scene)
        return
    _run_scene(options, scene)


def _print_lecture() -> None:
    from actuated_characters.scenes.slides import lecture_slides

    rows = [
        (each.numbers, each.content, "\n".join(each.commands) or each.why)
        for each in lecture_slides()
    ]
    title = "Actuating Simulated Characters; each command after: actuated_characters"
    Console().print(make_table(title, ("slides", "content", "to run"), rows, right=False))


def _run_scene(options: argparse.Namespace, scene: "Scene") -> None:
    from actuated_characters.recorder.run_directory import (
        prepare_directory,
        prepare_free_directory,
    )
    from actuated_characters.runs.plan import count_ticks
    from actuated_characters.scenes.execution import play_scene
    from actuated_characters.viewer.controls.shown_parameters import check_settings
    from actuated_characters.viewer.parameters import ViewerSettings

    rate = scene.simulator.get("rate")
    if not isinstance(rate, int) or rate < 1:
        raise ConfigurationError(f"scene '{scene.name}': sim_node's 'rate' is {rate}, not in Hz")
    ticks = count_ticks(options.duration, rate)
    check_settings(ViewerSettings.given(scene.viewer))
    directory = (options.output or Path("runs") / f"play-{scene.name}").absolute()
    if options.output is None:
        directory = prepare_free_directory(directory, replace=True)
    else:
        prepare_directory(directory, overwrite=options.overwrite)
    viewer = None if options.no_view else {**scene.viewer, **server_parameters(options)}
    check_interruption()  # all modules are imported by now
    last_megabytes = 0.0 if options.output else _LAST_MEGABYTES
    for line in (*_described(scene), _recorded_part(last_megabytes)):
        print(line, flush=True)
    with progress_bar(f"{scene.name} (Ctrl-C ends it)", ticks, "ticks") as bar:
        done = play_scene(
            scene,
            directory,
            ticks,
            viewer=viewer,
            last_megabytes=last_megabytes,
            progress=lambda count: bar.update(bar.task_ids[0], completed=min(count, ticks)),
        )
    if done:
        _print_figures(directory, scene.characters)
    else:
        print("ended before its first tick")


def _recorded_part(last_megabytes: float) -> str:
    """What the recording will be of, of 1.4 MB/s for each character of a few dozen joints."""
    if not last_megabytes:
        return "all is recorded"
    return (
        f"the last minutes are recorded, {last_megabytes:g} to {2.0 * last_megabytes:g} MB of "
        "messages; --output DIR records all"
    )


def _described(scene: "Scene") -> list[str]:
    """What there is to see, and the bounds of what draws its characters."""
    lines = [scene.title] if scene.title else []
    for name, values in scene.nodes.items():
        if opponent := values.get("opponent"):
            force, torque = (values.get(key) for key in ("effort_limit.root", "upright.torque"))
            lines.append(
                f"{name.partition('/')[0]} goes for {opponent}: root force at most {force} N, root "
                f"torque at most {torque} N m"
            )
    return lines


def _print_figures(directory: Path, characters: list[str]) -> None:
    from actuated_characters.recorder.run_directory import metrics_directory, read_metrics
    from actuated_characters.report.metrics_plot import describe_metrics, plot_metrics

    shown: dict[str, dict[str, str]] = {}
    for name in characters or [""]:
        folder = metrics_directory(directory, name, is_alone=not name)
        plot_metrics(folder)
        shown[name] = dict(describe_metrics(read_metrics(folder)[0]))
    figures = dict.fromkeys(figure for each in shown.values() for figure in each)
    columns = ["figure", *(characters or ["value"])]
    rows = [[figure, *(each.get(figure, "-") for each in shown.values())] for figure in figures]
    if len(characters) > _MOST_COLUMNS:  # a row each, and the rest is in the directory
        columns = ["character", *_FIGURES_OF_MANY]
        rows = [
            [name, *(each.get(figure, "-") for figure in _FIGURES_OF_MANY)]
            for name, each in shown.items()
        ]
    Console().print(make_table(f"results in {directory}", columns, rows))
