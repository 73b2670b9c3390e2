"""The process of a player: `python -m actuated_characters.replay.players.main commands|states`."""

import sys
from collections.abc import Callable
from typing import NoReturn

from msgs_config.runtime.process import RunnableNode, limit_threads, run_node

COMMANDS, STATES = "commands", "states"


def main() -> NoReturn:
    """Run a player until it has played."""
    limit_threads()
    run_node(_load_commands if sys.argv.pop(1) == COMMANDS else _load_states)


def _load_commands() -> Callable[[], RunnableNode]:
    from actuated_characters.replay.players.recorded_controller import CommandPlayer

    return CommandPlayer


def _load_states() -> Callable[[], RunnableNode]:
    from actuated_characters.replay.players.recorded_simulator import StatePlayer

    return StatePlayer


if __name__ == "__main__":
    main()
