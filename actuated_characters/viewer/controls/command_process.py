"""A command in a process beside the viewer, which does not wait for its end."""

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress

_MODULE, _PREPARED = "actuated_characters.cli", "actuated_characters.prepared_main"
_LONGEST_LINE = 512  # bytes of a last line
_PATIENCE = 10.0  # s in which a command can end in good order


class CommandProcess:
    """A command of `actuated_characters` that is being done."""

    def __init__(self, arguments: Sequence[str] | None = None) -> None:
        """Begin; without arguments, be ready to do what `begin` says."""
        self._output = tempfile.TemporaryFile()  # noqa: SIM115  closed by `cancel`
        module = [_PREPARED] if arguments is None else [_MODULE, *arguments]
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", *module],
            stdin=subprocess.PIPE if arguments is None else subprocess.DEVNULL,
            stdout=self._output,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # Ctrl-C is for the viewer, which ends this in its own way
        )

    def begin(self, arguments: Sequence[str]) -> None:
        """Begin a command in a process that was made without."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # it has ended, and will say why
            self._process.stdin.write(json.dumps(list(arguments)).encode() + b"\n")
            self._process.stdin.flush()

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

    @property
    def last_line(self) -> str:
        """What it has said last; it may go on to say more."""
        # reading at a position leaves that at which the process writes, which is shared with it
        place = self._output.fileno()
        begin = max(os.fstat(place).st_size - _LONGEST_LINE, 0)
        words = os.pread(place, _LONGEST_LINE, begin).decode(errors="replace").splitlines()
        return words[-1] if words else ""

    def lines(self) -> list[str]:
        """What it has said; only once it has ended."""
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
        if self._process.stdin is not None:
            self._process.stdin.close()
        self._output.close()
