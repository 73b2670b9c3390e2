"""The process of a player: `python -m actuated_characters.replay.players.main PLACE`."""

import sys
from typing import NoReturn

from msgs_config.runtime.process import run_node

CONTROLLER, SIMULATOR = "controller", "simulator"
"""The places that a bag can take."""
_PLAYERS = {
    CONTROLLER: "actuated_characters.replay.players.recorded_controller:RecordedController",
    SIMULATOR: "actuated_characters.replay.players.recorded_simulator:RecordedSimulator",
}


def main() -> NoReturn:
    """Run a player until it has played."""
    run_node(_PLAYERS[sys.argv.pop(1)])


if __name__ == "__main__":
    main()
