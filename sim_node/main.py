"""The executable `sim_node`."""

import sys

from msgs_config.process import StopSignal, limit_threads, run_node


def main() -> int:
    """Run the simulator until its end or a signal; returns the exit code."""
    limit_threads()
    return run_node(_work)


def _work(stop: StopSignal) -> None:
    from sim_node.node import SimNode

    node = SimNode()
    try:
        node.run(stop)
    finally:
        node.destroy_node()


if __name__ == "__main__":
    sys.exit(main())
