"""The executable `sim_node`."""

import sys
from collections.abc import Callable

from msgs_config.process import RunnableNode, limit_threads, run_node


def main() -> int:
    """Run the simulator until its end or a signal; returns the exit code."""
    limit_threads()
    return run_node(_load)


def _load() -> Callable[[], RunnableNode]:
    from sim_node.node import SimNode

    return SimNode


if __name__ == "__main__":
    sys.exit(main())
