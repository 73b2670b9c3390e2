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
    place = sys.argv.pop(1)
    run_node(lambda: _load(place))


def _load(place: str) -> Callable[[], RunnableNode]:
    if place == CONTROLLER:
        from actuated_characters.replay.players.recorded_controller import RecordedController

        return RecordedController
    from actuated_characters.replay.players.recorded_simulator import RecordedSimulator

    return RecordedSimulator


if __name__ == "__main__":
    main()
