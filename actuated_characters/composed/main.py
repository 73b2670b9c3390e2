"""The executable `composed`."""

from typing import NoReturn

from msgs_config.runtime.process import run_node

_ABOUT = """\
The nodes sim_node and controller_node in one process and one thread, which take turns. A simulator
of several `characters` has a controller_node in the namespace of each. The nodes' topics, services
and parameters are those that they have in processes of their own.

-p NAME:=VALUE sets a parameter of all nodes, -p sim_node:NAME:=VALUE one of a node outside of any
namespace; in a file, /**/sim_node, /**/controller_node or /left/controller_node say whose they are.

"""


def main() -> NoReturn:
    """Run simulator and controllers until one of them ends, or until a signal."""
    run_node("actuated_characters.composed.nodes:compose", _ABOUT)


if __name__ == "__main__":
    main()
