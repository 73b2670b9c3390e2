"""Child processes that are started together and always ended: in good order if they can be."""

import ctypes
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from actuated_characters.recorder.run_directory import LOGS, PARAMETERS, write_parameters
from actuated_characters.runs.held_signals import signals_held
from msgs_config.runtime.extras import require_extra

if TYPE_CHECKING:  # its process is one of these
    from actuated_characters.runs.foreign_controller import ForeignController

MODULES = {
    "sim_node": "sim_node.main",
    "controller_node": "controller_node.main",
    "composed": "actuated_characters.composed.main",
    "ros2_control_bridge": "actuated_characters.ros2_control.main",
    "recorder": "actuated_characters.recorder.main",
    "pusher": "actuated_characters.runs.perturbation_main",
    "fork": "actuated_characters.fork.main",
    "viewer": "actuated_characters.viewer.main",
    "player": "actuated_characters.replay.players.main",
}
"""The modules that are run by `python -m`, by the names of the nodes, or of several in one."""

FOREIGN = "controller"
"""The name of a controller that is no `controller_node`."""

_END_TIMEOUT = 10.0  # s that a child has to end after SIGINT, before it is killed
_LAST_LINES = 3  # are told of a process that failed without saying why
_PROGRESS = re.compile(r"(tick|flushed|state) [0-9]+$")  # lines for the parent, not for a reader
_WARNING_LINE = re.compile(r"\[(?:WARN|ERROR|FATAL)\] \[[0-9.]+\] \[[^]]*\]: (.+)")  # rcutils' form
_PR_SET_PDEATHSIG = 1  # prctl(2)
_LIBC = ctypes.CDLL(None)  # loaded before a fork, not after


class Member(Protocol):
    """One of those that a run is made of: a process, or a thread with the same ways."""

    name: str

    @property
    def exit_code(self) -> int | None:
        """The exit code, None while it works."""

    @property
    def log_size(self) -> int:
        """Bytes of its log so far."""

    def read_lines(self) -> list[str]:
        """What it has printed since the last call."""

    def last_words(self) -> str:
        """The reason for its end."""

    def last_warning(self, since: int, saying: str = "") -> str:
        """The text of its last warning, which says that, beyond so many bytes of its log."""

    def end(self, request: signal.Signals | None = None) -> int:
        """End it, in good order where a signal is given; return the exit code."""


class Child:
    """One process: its standard output can be read, its standard error goes to a log file."""

    signal_at_parents_end = signal.SIGTERM
    patience_with_signal = 2.0
    """s after which a signal is sent again: one that comes while Python begins can be lost.
    A node ends in good order at the first one, and takes no notice of others."""

    def __init__(
        self,
        arguments: Sequence[str],
        log: Path,
        *,
        output: Path | None = None,
        environment: Mapping[str, str] | None = None,
        cwd: Path | None = None,
    ) -> None:
        """Start `python arguments`; it ends with this process, however that ends.

        Without a file `output` the standard output is kept in one without a name.
        """
        self.name = log.stem
        self._log = log
        # open as long as the child is remembered
        self._output = output.open("w+b") if output else tempfile.TemporaryFile()  # noqa: SIM115
        self._read = 0  # bytes of the output
        own = dict(os.environ if environment is None else environment)
        self._process = self._start(arguments, own, cwd)
        self.pid = self._process.pid

    def _start(
        self, arguments: Sequence[str], environment: dict[str, str], cwd: Path | None
    ) -> "subprocess.Popen[bytes]":
        with self._log.open("wb") as log:
            return subprocess.Popen(
                [sys.executable, *arguments],
                cwd=cwd,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=log,
                start_new_session=True,  # Ctrl-C is this process's, which ends the others in order
                preexec_fn=partial(end_with_parent, self.signal_at_parents_end),
            )

    @property
    def exit_code(self) -> int | None:
        """The exit code, None while the process runs."""
        return self._process.poll()

    @property
    def stdout(self) -> str:
        """The standard output so far."""
        return self._output_from(0).decode(errors="replace")

    @property
    def stderr(self) -> str:
        """The log so far."""
        return self._log.read_text(errors="replace")

    def read_lines(self) -> list[str]:
        """The complete lines of the standard output since the last call."""
        whole, newline, _ = self._output_from(self._read).rpartition(b"\n")
        self._read += len(whole + newline)
        return whole.decode(errors="replace").splitlines()

    def _output_from(self, offset: int) -> bytes:
        descriptor = self._output.fileno()  # read without moving the offset, which the child shares
        return os.pread(descriptor, os.fstat(descriptor).st_size - offset, offset)

    def last_words(self) -> str:
        """The reason for the end: the error in the log, or else the last lines of all output.

        Libraries below ROS write to either stream what is no log: both are looked through.
        """
        lines = _filled_lines(self.stderr)
        errors = [line for line in lines if line.startswith("error: ")]
        if errors:
            return errors[-1].removeprefix("error: ")
        if self.exit_code is None:
            return lines[-1] if lines else "nothing so far"
        printed = [line for line in _filled_lines(self.stdout) if not _PROGRESS.match(line)]
        last = " | ".join((printed + lines)[-_LAST_LINES:])
        if self.exit_code is not None and self.exit_code < 0:
            how = f"killed by {signal.Signals(-self.exit_code).name}"
            return f"{how}; its last output: {last}" if last else how
        return last or f"exit code {self.exit_code}; it printed nothing"

    @property
    def log_size(self) -> int:
        """Bytes of the log so far."""
        return self._log.stat().st_size

    def last_warning(self, since: int, saying: str = "") -> str:
        """The text of the node's last warning beyond so many bytes of the log; empty: none.

        Of those alone that have the words `saying` in them.
        """
        later = self._log.read_bytes()[since:].decode(errors="replace")
        found = [match[1] for line in _filled_lines(later) if (match := _WARNING_LINE.match(line))]
        return next((text for text in reversed(found) if saying in text), "")

    def send(self, number: signal.Signals) -> None:
        """Send a signal, unless the process has ended."""
        if self.exit_code is None:
            self._process.send_signal(number)

    def end(self, request: signal.Signals | None = None, patience: float = _END_TIMEOUT) -> int:
        """Send a signal if one is given, again if need be, and kill it after `patience` s.

        Returns the exit code.
        """
        deadline = time.monotonic() + patience
        while (left := deadline - time.monotonic()) > 0.0:
            if request is not None:
                self.send(request)
            with suppress(subprocess.TimeoutExpired):
                return self._process.wait(min(left, self.patience_with_signal))
        self._process.kill()
        return self._process.wait()


def _filled_lines(text: str) -> list[str]:
    return [line.strip() for line in text.splitlines() if line.strip()]


class Children:
    """The package's nodes in a `with` block; leaving it ends them, the last one started first."""

    def __init__(self, directory: Path, environment: Mapping[str, str] | None = None) -> None:
        """Parameter files and logs go below `directory`, as those of a run do.

        Raises:
            ConfigurationError: there is no ROS.
        """
        require_extra("wheels", "a node that is a process of its own")
        self.directory = directory
        self._environment = environment
        self._members: list[Member] = []
        for folder in (PARAMETERS, LOGS):
            (directory / folder).mkdir(parents=True, exist_ok=True)

    def __enter__(self) -> "Children":
        return self

    def __exit__(self, *error: object) -> None:
        for member in reversed(self._members):
            member.end(signal.SIGINT)

    def start_node(
        self,
        name: str,
        parameters: Mapping[str, object],
        *ros_arguments: str,
        arguments: Sequence[str] = (),
        any_node: bool = False,
    ) -> Child:
        """Start a node; a signal waits until the child is one that will be ended.

        The parameters are for the node of that name in the root namespace, or for `any_node`.
        """
        file = write_parameters(self.directory, name, parameters, "/**" if any_node else name)
        return self._start(name, [file], ros_arguments, arguments)

    def start_thread(self, make: Callable[[], Member]) -> Member:
        """Start one that is no process, to be ended last; a signal waits until it will be.

        To be called after all processes were started: to fork one beside threads is not safe.
        """
        with signals_held():
            self._members.insert(0, make())
        return self._members[0]

    def start_foreign(
        self, foreign: "ForeignController", session: str, parameters: Mapping[str, object]
    ) -> Child:
        """Start anybody's controller; the parameters are those that `controller_node` would have.

        Raises:
            RunError: there is no such program.
        """
        file = write_parameters(self.directory, FOREIGN, parameters, "/**")
        log = self.directory / LOGS / f"{FOREIGN}.log"
        environment = os.environ if self._environment is None else self._environment
        with signals_held():
            child = foreign.start(log, environment, session, file)
            self._members.append(child)
        return child

    def start_composed(
        self, name: str, parameters: Mapping[str, Mapping[str, object]], *ros_arguments: str
    ) -> Child:
        """Start one process of several nodes, with the parameters of each by its name.

        The name of one in a namespace contains that: `left/controller_node`.
        """
        files = [
            write_parameters(self.directory, node.replace("/", "."), values, node)
            for node, values in parameters.items()
        ]
        return self._start(name, files, ros_arguments)

    def _start(
        self,
        name: str,
        files: Sequence[Path],
        ros_arguments: Sequence[str],
        arguments: Sequence[str] = (),
    ) -> Child:
        # -P: no module of the same name from the directory where the user stands
        command = ["-P", "-m", MODULES[name], *arguments, "--ros-args"]
        for file in files:
            command += ["--params-file", str(file)]
        command += ros_arguments
        log = self.directory / LOGS / f"{name}.log"
        with signals_held():
            child = Child(command, log, environment=self._environment)
            self._members.append(child)
        return child


def end_with_parent(number: signal.Signals) -> None:
    """Let the kernel send a signal to this process when its parent is gone, even killed."""
    _LIBC.prctl(_PR_SET_PDEATHSIG, number)
