"""The executable `composed`."""

from collections.abc import Callable
from typing import NoReturn

from msgs_config.runtime.process import RunnableNode, limit_threads, run_node

_ABOUT = """\
The nodes sim_node and controller_node in one process and one thread, which take turns. A simulator
of several `characters` has a controller_node in the namespace of each. The nodes' topics, services
and parameters are those that they have in processes of their own.

-p NAME:=VALUE sets a parameter of all nodes, -p sim_node:NAME:=VALUE one of a node outside of any
namespace; in a file, /**/sim_node, /**/controller_node or /left/controller_node say whose they are.

"""


def main() -> NoReturn:
    """Run simulator and controllers until one of them ends, or until a signal."""
    limit_threads()
    run_node(_load, _ABOUT)


def _load() -> Callable[[], RunnableNode]:
    from actuated_characters.composed.nodes import compose

    return compose


if __name__ == "__main__":
    main()
