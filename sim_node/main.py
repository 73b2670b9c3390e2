"""The executable `sim_node`."""

from collections.abc import Callable
from typing import NoReturn

from msgs_config.runtime.process import RunnableNode, limit_threads, run_node


def main() -> NoReturn:
    """Run the simulator until its end or a signal."""
    limit_threads()
    run_node(_load)


def _load() -> Callable[[], RunnableNode]:
    from sim_node.node import SimNode

    return SimNode


if __name__ == "__main__":
    main()
