"""The executable `controller_node`."""

import sys
from collections.abc import Callable

from msgs_config.process import RunnableNode, limit_threads, run_node


def main() -> int:
    """Run the controller until a signal; returns the exit code."""
    limit_threads()
    return run_node(_load)


def _load() -> Callable[[], RunnableNode]:
    from controller_node.node import ControllerNode

    return ControllerNode


if __name__ == "__main__":
    sys.exit(main())
