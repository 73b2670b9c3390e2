"""A command in a process beside the viewer, which does not wait for its end."""

import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence

_MODULE = "actuated_characters.cli"
_PATIENCE = 10.0  # s in which a command can end in good order


class CommandProcess:
    """A command of `actuated_characters` that is being done."""

    def __init__(self, arguments: Sequence[str]) -> None:
        """Begin."""
        self._output = tempfile.TemporaryFile()  # noqa: SIM115  closed by `cancel`
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", _MODULE, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=self._output,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # Ctrl-C is for the viewer, which ends this in its own way
        )

    @property
    def has_ended(self) -> bool:
        """Whether the process has ended."""
        return self._process.poll() is not None

    @property
    def error(self) -> str:
        """What went wrong, in a line; empty if nothing did."""
        if not self._process.returncode:
            return ""
        errors = [line for line in self.lines() if line.startswith("error: ")]
        return (errors or self.lines() or ["error: it has failed"])[-1]

    def lines(self) -> list[str]:
        """What it has said so far."""
        self._output.seek(0)
        return self._output.read().decode(errors="replace").splitlines()

    def cancel(self) -> None:
        """End it in good order, if it goes on."""
        if not self.has_ended:
            self._process.send_signal(signal.SIGINT)
            try:
                self._process.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._output.close()
