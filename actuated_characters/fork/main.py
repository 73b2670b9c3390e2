"""The process that repeats what a recorded run was sent."""

from collections.abc import Callable
from typing import NoReturn

from msgs_config.runtime.process import RunnableNode, limit_threads, run_node, use_batch_scheduling


def main() -> NoReturn:
    """Run the node until a signal."""
    limit_threads()
    use_batch_scheduling()
    run_node(_load)


def _load() -> Callable[[], RunnableNode]:
    from actuated_characters.fork.node import ForkNode

    return ForkNode


if __name__ == "__main__":
    main()
