"""The process that sends a run's planned pushes and throws."""

from collections.abc import Callable
from typing import NoReturn

from msgs_config.runtime.process import RunnableNode, limit_threads, run_node


def main() -> NoReturn:
    """Run the node until a signal."""
    limit_threads()
    run_node(_load)


def _load() -> Callable[[], RunnableNode]:
    from actuated_characters.runs.perturbation_node import PerturbationNode

    return PerturbationNode


if __name__ == "__main__":
    main()
