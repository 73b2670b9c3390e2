"""Anybody's controller in the place of `controller_node`: a command, and the process that it is."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from actuated_characters.runs.processes import Child, end_with_parent
from msgs_config.errors import RunError

PLACES = ("python", "folder", "session", "parameters")
"""What braces in a command stand for: this Python, where the command is from, the session of the
run, and the YAML file of the parameters that `controller_node` would have."""
PLACE = re.compile(r"\{([a-z]+)\}")
"""A name in braces."""
_PATIENCE = 5.0  # s that a controller has to end after SIGINT


@dataclass(frozen=True)
class ForeignController:
    """How a controller is started that is no `controller_node`."""

    command: tuple[str, ...]  # the program and its arguments, which may have PLACES in braces
    folder: Path  # where it runs
    environment: Mapping[str, str] = field(default_factory=dict)  # beside this process' own
    subscriptions: int = 1  # to joint_states, that the simulator waits for

    def start(
        self, log: Path, environment: Mapping[str, str], session: str, parameters: Path
    ) -> "Program":
        """Start it; both of its outputs are kept.

        Raises:
            RunError: there is no such program.
        """
        values = {
            "python": sys.executable,
            "folder": str(self.folder),
            "session": session,
            "parameters": str(parameters),
        }
        own = {name: fill(text, values) for name, text in self.environment.items()}
        command = [fill(word, values) for word in self.command]
        try:
            return Program(command, log, environment={**environment, **own}, cwd=self.folder)
        except OSError as error:
            raise RunError(f"cannot start {command[0]}: {error.strerror or error}") from error


def fill(text: str, values: Mapping[str, str]) -> str:
    """A text with the values of its places; braces around anything else stay."""
    return PLACE.sub(lambda place: values.get(place[1], place[0]), text)


class Program(Child):
    """A program and all processes that it starts: they get its signals, and end with it."""

    def _start(
        self,
        arguments: Sequence[str],
        environment: dict[str, str],
        cwd: Path | None,
    ) -> "subprocess.Popen[bytes]":
        with self._log.open("wb") as log:
            return subprocess.Popen(
                arguments,
                cwd=cwd,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=log,
                start_new_session=True,  # a group of its own, which is ended as a whole
                preexec_fn=partial(end_with_parent, self.signal_at_parents_end),
            )

    def send(self, number: signal.Signals) -> None:
        """Send a signal to all of its processes, unless it has ended."""
        if self.exit_code is None:
            self._signal_all(number)

    def end(self, request: signal.Signals | None = None, patience: float = _PATIENCE) -> int:
        """End it as `Child.end` does, and whatever it has left behind."""
        try:
            return super().end(request, patience)
        finally:
            self._signal_all(signal.SIGKILL)

    def _signal_all(self, number: signal.Signals) -> None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, number)
