"""The process that sends a run's planned pushes."""

import sys
from collections.abc import Callable

from msgs_config.process import RunnableNode, limit_threads, run_node


def main() -> int:
    """Run the pusher until a signal; returns the exit code."""
    limit_threads()
    return run_node(_load)


def _load() -> Callable[[], RunnableNode]:
    from experiment.pusher import PusherNode

    return PusherNode


if __name__ == "__main__":
    sys.exit(main())
