"""The processes of a replay through topics: nodes and a player, in a ROS domain of their own."""

import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import yaml

from actuated_characters.replay.players.base import TICK, WAITING
from actuated_characters.runs.processes import Child, Children
from actuated_characters.runs.ros_domain import own_domain
from msgs_config.errors import RunError

_POLL_PERIOD = 0.05  # s
_PLAYER = "actuated_characters.replay.players.main"

Progress = Callable[[int], None]
"""Is told the number of states so far."""

Tell = Callable[[str], None]
"""Is told a line, such as what is waited for."""


class Session:
    """Child processes with a directory for their files, which goes when they have ended."""

    def __init__(self, children: Children, directory: Path, environment: Mapping[str, str]) -> None:
        self.directory = directory
        self._children = children
        self._environment = environment

    def start(self, name: str, parameters: Mapping[str, object]) -> Child:
        """Start one of the package's nodes, by its name."""
        return self._start(name, f"{name}.main", [], parameters)

    def start_player(
        self, kind: str, parameters: Mapping[str, object], namespace: str = ""
    ) -> Child:
        """Start a player of `COMMANDS` or `STATES`."""
        remap = ["-r", f"__ns:=/{namespace}"] if namespace else []
        return self._start("player", _PLAYER, [kind], parameters, remap)

    def _start(
        self,
        name: str,
        module: str,
        first: Sequence[str],
        parameters: Mapping[str, object],
        remap: Sequence[str] = (),
    ) -> Child:
        file, log = self.directory / f"{name}.yaml", self.directory / f"{name}.log"
        file.write_text(yaml.safe_dump({"/**": {"ros__parameters": dict(parameters)}}))
        arguments = [*first, "--ros-args", "--params-file", str(file), *remap]
        return self._children.start(lambda: Child(name, module, arguments, log, self._environment))


@contextmanager
def session(*, own: bool = True) -> Iterator[Session]:
    """Processes that hear nobody else; or, unless `own`, all who are on the present domain."""
    with ExitStack() as stack:
        name = stack.enter_context(tempfile.TemporaryDirectory())
        environment = {**os.environ, "ROS_LOG_DIR": name}
        if own:
            environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
            environment["ROS_DOMAIN_ID"] = str(stack.enter_context(own_domain()))
        children = stack.enter_context(Children())
        yield Session(children, Path(name), environment)


def wait_for_player(player: Child, others: Sequence[Child], progress: Progress, tell: Tell) -> None:
    """Wait until a player has played.

    Raises:
        RunError: it, or one of the others, has failed; with its last words.
    """
    rest = ""
    while True:
        ended = player.exit_code is not None  # asked before, so that nothing it says is missed
        *lines, rest = (rest + player.read_output()).split("\n")
        for line in lines:
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
