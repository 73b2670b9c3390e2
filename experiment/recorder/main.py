"""The executable `recorder`."""

import sys
from collections.abc import Callable

from msgs_config.process import RunnableNode, limit_threads, run_node, stand_back


def main() -> int:
    """Run the recorder until a signal; returns the exit code."""
    limit_threads()
    stand_back()
    return run_node(_load)


def _load() -> Callable[[], RunnableNode]:
    from experiment.recorder.node import RecorderNode

    return RecorderNode


if __name__ == "__main__":
    sys.exit(main())
