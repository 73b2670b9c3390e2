"""The process of a player: `python -m actuated_characters.replay.players.main PLACE`."""

import sys
from collections.abc import Callable
from typing import NoReturn

from msgs_config.runtime.process import RunnableNode, limit_threads, run_node

CONTROLLER, SIMULATOR = "controller", "simulator"
"""The places that a bag can take."""


def main() -> NoReturn:
    """Run a player until it has played."""
    limit_threads()
    run_node(_load_controller if sys.argv.pop(1) == CONTROLLER else _load_simulator)


def _load_controller() -> Callable[[], RunnableNode]:
    from actuated_characters.replay.players.recorded_controller import RecordedController

    return RecordedController


def _load_simulator() -> Callable[[], RunnableNode]:
    from actuated_characters.replay.players.recorded_simulator import RecordedSimulator

    return RecordedSimulator


if __name__ == "__main__":
    main()
