"""The executable `recorder`."""

import sys

from msgs_config.process import StopSignal, limit_threads, run_node


def main() -> int:
    """Run the recorder until a signal; returns the exit code."""
    limit_threads()
    return run_node(_work)


def _work(stop: StopSignal) -> None:
    from experiment.recorder import RecorderNode

    node = RecorderNode()
    try:
        node.run(stop)
    finally:
        node.destroy_node()


if __name__ == "__main__":
    sys.exit(main())
