"""The command `actuated_characters view`: running characters in a browser."""

import argparse
import os
import re
import sys

from actuated_characters.commands.common.settings import Commands, add_command
from msgs_config.errors import ConfigurationError

_FPS = 30.0
_NAMESPACE = re.compile(r"/|(/[A-Za-z_][A-Za-z0-9_]*)+")
_MODULE = "actuated_characters.viewer.main"


def add_view(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    view = add_command(
        commands,
        _view,
        "view",
        "show running characters in a browser",
        "Show all characters of the simulators in the present ROS_DOMAIN_ID in a browser: drag a "
        "body to push it, click on it with Shift to throw a ball at it. Ctrl-C ends it. Needs the "
        "extra 'view'.",
        ["view", "view --port 8090 --namespace /lab"],
    )
    view.add_argument(
        "--namespace", default="/", metavar="NAME", help="of the simulators to show (all)"
    )
    add_server(view)


def add_server(command: argparse._ActionsContainer) -> None:
    """Add the options that say where the viewer's page is."""
    command.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="listen on this address; others than %(default)s let others watch and push",
    )
    command.add_argument(
        "--port", type=int, default=0, metavar="N", help="listen on this port (8080, or the next)"
    )
    command.add_argument(
        "--fps",
        type=float,
        default=_FPS,
        metavar="HZ",
        help="most pictures a second (%(default)g)",
    )


def server_parameters(options: argparse.Namespace) -> dict[str, object]:
    """The viewer's parameters of those options."""
    return {"host": options.host, "port": options.port, "fps": options.fps}


def _view(options: argparse.Namespace) -> None:
    """Become the node, which has this process's signals and terminal."""
    if not _NAMESPACE.fullmatch(options.namespace):
        raise ConfigurationError(
            f"--namespace is {options.namespace!r}; it must be / or like /lab or /lab/left"
        )
    arguments = ["--ros-args", "-r", f"__ns:={options.namespace}"]
    for name, value in server_parameters(options).items():
        given = f"'{value}'" if isinstance(value, str) else value  # an address is no YAML number
        arguments += ["-p", f"{name}:={given}"]
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, "-P", "-m", _MODULE, *arguments])
