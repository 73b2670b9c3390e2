"""Child processes that are started together and always ended: in good order if they can be."""

import ctypes
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

_END_PATIENCE = 10.0  # s that a child has to end after SIGINT, before it is killed
_PR_SET_PDEATHSIG = 1  # prctl(2)
_LIBC = ctypes.CDLL(None)  # loaded before a fork, not after


class Child:
    """One process: its standard output can be read, its standard error goes to a log file."""

    def __init__(
        self,
        name: str,
        module: str,
        arguments: Sequence[str],
        log: Path,
        environment: Mapping[str, str],
    ) -> None:
        """Start `python -m module arguments`; it ends with this process, however that ends."""
        self.name = name
        self._log = log
        with log.open("wb") as sink:
            self._process = subprocess.Popen(
                # -P: no module of the same name from the directory where the user stands
                [sys.executable, "-P", "-m", module, *arguments],
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=sink,
                start_new_session=True,  # Ctrl-C is this process's, which ends the others in order
                preexec_fn=_end_with_parent,
            )
        assert self._process.stdout is not None
        self._output = self._process.stdout
        os.set_blocking(self._output.fileno(), False)
        self.pid = self._process.pid

    @property
    def exit_code(self) -> int | None:
        """The exit code, None while the process runs."""
        return self._process.poll()

    def read_output(self) -> str:
        """What it has printed since the last call."""
        return (self._output.read() or b"").decode(errors="replace")

    def last_words(self) -> str:
        """What it said of its end: its error, or else the last line that it logged."""
        lines = [
            line for line in self._log.read_text(errors="replace").splitlines() if line.strip()
        ]
        errors = [line for line in lines if line.startswith("error: ")]
        if errors:
            return errors[-1].removeprefix("error: ")
        if self.exit_code is not None and self.exit_code < 0:
            return f"killed by {signal.Signals(-self.exit_code).name}"
        return lines[-1] if lines else f"exit code {self.exit_code}; it logged nothing"

    def interrupt(self) -> None:
        """Ask it to end in good order."""
        if self.exit_code is None:
            self._process.send_signal(signal.SIGINT)

    def end(self) -> int:
        """Wait for its end, and kill it if that does not come; returns the exit code."""
        try:
            code = self._process.wait(_END_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        self._output.close()
        return code


class Children:
    """Children in a `with` block; on leaving it they are ended, the last one started first."""

    def __init__(self) -> None:
        self._children: list[Child] = []

    def __enter__(self) -> "Children":
        return self

    def __exit__(self, *error: object) -> None:
        for child in reversed(self._children):
            child.interrupt()
            child.end()

    def start(self, make_child: Callable[[], Child]) -> Child:
        """Start a child; a signal waits until the child is one that will be ended."""
        with _signals_held():
            child = make_child()
            self._children.append(child)
        return child


@contextmanager
def _signals_held() -> Iterator[None]:
    """Keep what comes for afterwards; a mask would hold it back from one thread alone."""
    received: list[int] = []
    handlers = {
        number: signal.signal(number, lambda number, frame: received.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for caught in received:
            signal.raise_signal(caught)


def _end_with_parent() -> None:
    """Let the kernel send SIGTERM to this child when its parent is gone, even killed."""
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
