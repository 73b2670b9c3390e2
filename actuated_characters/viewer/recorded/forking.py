"""The command `fork` in a process beside the viewer, which does not wait for its end."""

import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from actuated_characters.bags.format.metadata import BAG
from actuated_characters.viewer.recorded.export import free_path

_MODULE = "actuated_characters.cli"
_PATIENCE = 10.0  # s in which a fork can end in good order


class Fork:
    """A fork of a recorded run that is being made."""

    def __init__(self, run: Path, time: float, push: str, settings: Sequence[str]) -> None:
        """Begin: from a time, s, with a push `LINK:FX,FY,FZ` there, and parameters."""
        self.time = time
        run = run.absolute()
        run = run.parent if run.name == BAG else run
        self.directory = free_path(run.parent, f"{run.name}-fork", "")
        arguments = ["fork", str(run), "--at", f"{time:.9g}", "--output", str(self.directory)]
        if push:
            arguments += ["--push", f"{push}@{time:.9g}"]
        for each in settings:
            arguments += ["--set", each]
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
        self._output.seek(0)
        lines = self._output.read().decode(errors="replace").splitlines()
        errors = [line for line in lines if line.startswith("error: ")]
        return (errors or lines or ["error: it has failed"])[-1]

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
