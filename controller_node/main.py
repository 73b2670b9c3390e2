"""The executable `controller_node`."""

from collections.abc import Callable
from typing import NoReturn

from msgs_config.runtime.process import RunnableNode, limit_threads, run_node


def main() -> NoReturn:
    """Run the controller until a signal."""
    limit_threads()
    run_node(_load)


def _load() -> Callable[[], RunnableNode]:
    from controller_node.node import ControllerNode

    return ControllerNode


if __name__ == "__main__":
    main()
