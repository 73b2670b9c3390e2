"""The processes of a replay through topics: nodes and a player, in a ROS domain of their own."""

import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from actuated_characters.replay.players.base import TICK, WAITING
from actuated_characters.runs.processes import Child, Children
from actuated_characters.runs.ros_domain import own_domain
from msgs_config.errors import RunError

_POLL_PERIOD = 0.05  # s

Progress = Callable[[int], None]
"""Is told the number of states so far."""

Tell = Callable[[str], None]
"""Is told a line, such as what is waited for."""


@contextmanager
def session(*, own: bool = True) -> Iterator[Children]:
    """Processes on a ROS domain of their own; or, unless `own`, on the present one."""
    with ExitStack() as stack:
        directory = stack.enter_context(tempfile.TemporaryDirectory())
        environment = {**os.environ, "ROS_LOG_DIR": directory}
        if own:
            environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
            environment["ROS_DOMAIN_ID"] = str(stack.enter_context(own_domain()))
        yield stack.enter_context(Children(Path(directory), environment))


def start_player(
    children: Children, kind: str, parameters: Mapping[str, object], namespace: str = ""
) -> Child:
    """Start a player of `COMMANDS` or `STATES`."""
    remap = ["-r", f"__ns:=/{namespace}"] if namespace else []
    return children.start_node("player", parameters, *remap, arguments=[kind], any_node=True)


def wait_for_player(player: Child, others: Sequence[Child], progress: Progress, tell: Tell) -> None:
    """Wait until a player has played.

    Raises:
        RunError: it, or one of the others, has failed; with its last words.
    """
    while True:
        ended = player.exit_code is not None  # asked before, so that nothing it says is missed
        for line in player.read_lines():
            if line.startswith(WAITING):
                tell(line)
            elif line.startswith(TICK):
                progress(int(line.removeprefix(TICK)))
        if ended:
            break
        for other in others:
            if other.exit_code:
                raise RunError(f"{other.name} failed: {other.last_words()}")
        time.sleep(_POLL_PERIOD)
    if player.exit_code:
        raise RunError(player.last_words())
