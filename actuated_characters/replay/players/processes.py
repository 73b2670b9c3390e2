"""The processes of a replay through topics, and the lines by which a player reports to it."""

import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from actuated_characters.replay.players.player import STATE, WAITING
from actuated_characters.runs.processes import Child, Children
from actuated_characters.runs.ros_domain import own_domain
from msgs_config.errors import RunError

Progress = Callable[[int], None]
"""Is called with the number of states so far."""

Tell = Callable[[str], None]
"""Is called with a line for the user, such as what is waited for."""

_POLL_PERIOD = 0.05  # s


@contextmanager
def child_processes(*, own: bool = True) -> Iterator[Children]:
    """Processes in a ROS domain that no other node is in; or, unless `own`, in the present one."""
    with ExitStack() as stack:
        directory = stack.enter_context(tempfile.TemporaryDirectory())
        environment = {**os.environ, "ROS_LOG_DIR": directory}
        if own:
            environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
            environment["ROS_DOMAIN_ID"] = str(stack.enter_context(own_domain()))
        yield stack.enter_context(Children(Path(directory), environment))


def start_player(
    children: Children,
    place: str,
    bag: Path,
    parameters: Mapping[str, object],
    namespace: str = "",
) -> Child:
    """Start a player of a bag in the place of the `CONTROLLER` or the `SIMULATOR`."""
    playing = {"recording": str(bag.absolute()), **parameters}
    remap = ["-r", f"__ns:=/{namespace}"] if namespace else []
    return children.start_node("player", playing, *remap, arguments=[place], any_node=True)


def wait_for_player(player: Child, others: Sequence[Child], progress: Progress, tell: Tell) -> None:
    """Wait until a player has played.

    Raises:
        RunError: it, or one of the others, has failed; with the last error that it logged.
    """
    while True:
        has_ended = player.exit_code is not None  # before its last lines are read
        for line in player.read_lines():
            if line.startswith(WAITING):
                tell(line)
            elif line.startswith(STATE):
                progress(int(line.removeprefix(STATE)))
        if has_ended:
            break
        for other in others:
            if other.exit_code:
                raise RunError(f"{other.name} failed: {other.last_words()}")
        time.sleep(_POLL_PERIOD)
    if player.exit_code:
        raise RunError(player.last_words())
