"""The command `actuated_characters view`: running characters, or a recorded run, in a browser."""

import argparse
import os
import re
import sys
from pathlib import Path

from actuated_characters.commands.common.settings import (
    Commands,
    add_command,
    add_robot,
    print_remarks,
    robot_source,
)
from actuated_characters.commands.common.skin_options import add_skin, given_skin, skin_parameters
from actuated_characters.viewer.parameters import ViewerSettings
from msgs_config.errors import ConfigurationError
from msgs_config.runtime.extras import require_extra

_NAMESPACE = re.compile(r"/|(/[A-Za-z_][A-Za-z0-9_]*)+")
_MODULE = "actuated_characters.viewer.main"


def add_view(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    view = add_command(
        commands,
        _view,
        "view",
        "show running characters, or a recorded run, in a browser",
        "Without RUN, show all characters of the simulators in the present ROS_DOMAIN_ID: drag a "
        "body to push it, click on it with Shift to throw a ball at it. With RUN, play a recorded "
        "run with a time line, plots, export and forks. Ctrl-C ends it. Needs the extra 'view'.",
        [
            "view",
            "view runs/demo",
            "view runs/demo runs/demo-fork",
            "view runs/demo --skin body.glb",
            "view runs/demo --topic description_joint_states",
        ],
    )
    view.add_argument(
        "run", nargs="?", type=Path, metavar="RUN", help="a run's directory, or a bag"
    )
    view.add_argument(
        "others", nargs="*", type=Path, metavar="OTHER", help="others, shown as its ghosts"
    )
    view.add_argument(
        "--namespace", metavar="NAME", help="without RUN: of the simulators to show (all)"
    )
    add_robot(view, "with RUN: show this one alone of several")
    add_server(view)


def add_server(command: argparse._ActionsContainer) -> None:
    """Add the options that say where the viewer's page is, and how characters look on it."""
    command.add_argument(
        "--host",
        default=ViewerSettings.host,
        metavar="ADDRESS",
        help="listen on this address; others than %(default)s let others watch and push",
    )
    command.add_argument(
        "--port",
        type=int,
        default=ViewerSettings.port,
        metavar="N",
        help="listen on this port (8080, or the next)",
    )
    command.add_argument(
        "--fps",
        type=float,
        default=ViewerSettings.fps,
        metavar="HZ",
        help="most pictures a second (%(default)g)",
    )
    add_skin(command)


def server_parameters(options: argparse.Namespace) -> dict[str, object]:
    """The viewer's parameters of those options."""
    return {
        "host": options.host,
        "port": options.port,
        "fps": options.fps,
        **skin_parameters(options),
    }


def _view(options: argparse.Namespace) -> None:
    """Show a recorded run, or become the node, which has this process's signals and terminal."""
    require_extra("view", "view")
    if options.run is not None:
        _view_recorded(options)
        return
    for name in ("character", "topic", "base"):
        if getattr(options, name) is not None:
            raise ConfigurationError(f"--{name} is of a recorded RUN; name one")
    namespace = options.namespace or "/"
    if not _NAMESPACE.fullmatch(namespace):
        raise ConfigurationError(
            f"--namespace is {namespace!r}; it must be / or like /lab or /lab/left"
        )
    arguments = ["--ros-args", "-r", f"__ns:={namespace}"]
    for name, value in server_parameters(options).items():
        given = f"'{value}'" if isinstance(value, str) else value  # an address is no YAML number
        arguments += ["-p", f"{name}:={given}"]
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, "-P", "-m", _MODULE, *arguments])


def _view_recorded(options: argparse.Namespace) -> None:
    if options.namespace is not None:
        raise ConfigurationError("--namespace is of running simulators; a RUN has none")
    settings = ViewerSettings.given(server_parameters(options))
    skin = given_skin(options)
    from actuated_characters.viewer.recorded.main import show_recorded

    show_recorded(
        options.run,
        options.others,
        robot_source(options),
        print_remarks,
        host=settings.host,
        port=settings.port or None,
        fps=settings.fps,
        skin=skin,
    )
