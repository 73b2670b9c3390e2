"""Nodes that begin as forks of a process which has imported what they need.

Most of what the start of a node costs is Python's own and the imports'. A fork runs the same
module as `python -m` does, in a process, a session and an environment of its own; it lacks the
start up to there, which is for the tests of just that (`Processes.python`).
"""

import os
import runpy
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from multiprocessing import forkserver, get_context
from multiprocessing.context import ForkServerContext
from pathlib import Path

from actuated_characters.runs.processes import end_with_parent
from msgs_config.runtime.process import limit_threads

_IMPORTED = ["sim_node.node", "controller_node.node", "actuated_characters.recorder.node"]


@cache
def _server() -> ForkServerContext:
    """The process that forks; it ends with this one."""
    context = get_context("forkserver")
    context.set_forkserver_preload(_IMPORTED)
    own = dict(os.environ)
    limit_threads()  # as each node does before its imports
    try:
        forkserver.ensure_running()
    finally:
        os.environ.clear()
        os.environ.update(own)
    return context


class Fork:
    """A forked `python -m module arguments`, with the part of `subprocess.Popen` that is used."""

    def __init__(
        self,
        module: str,
        arguments: Sequence[str],
        output: Path,
        errors: Path,
        cwd: Path,
        environment: Mapping[str, str],
    ) -> None:
        """Start it, to be killed should the test's own process be."""
        for file in (output, errors):
            file.touch()  # it may be read before the fork has come to open it
        given = (module, list(arguments), output, errors, cwd, dict(environment))
        self._process = _server().Process(target=_run, args=given, daemon=True)
        self._process.start()
        assert self._process.pid is not None
        self.pid = self._process.pid

    def poll(self) -> int | None:
        """The exit code, None while it runs."""
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        """The exit code, once it has ended. Raises TimeoutExpired."""
        self._process.join(timeout)
        code = self._process.exitcode
        if code is None:
            raise subprocess.TimeoutExpired(self._process.name, timeout or 0.0)
        return code

    def send_signal(self, sig: int) -> None:
        """Send it a signal, if it has not ended."""
        if self.poll() is None:
            os.kill(self.pid, sig)

    def kill(self) -> None:
        """Send it SIGKILL."""
        self.send_signal(signal.SIGKILL)


def _run(
    module: str,
    arguments: list[str],
    output: Path,
    errors: Path,
    cwd: Path,
    environment: dict[str, str],
) -> None:
    """Become what `python -m module arguments` is."""
    os.setsid()
    end_with_parent(signal.SIGKILL)
    os.chdir(cwd)
    os.environ.clear()
    os.environ.update(environment)
    for file, stream in ((output, sys.stdout), (errors, sys.stderr)):
        with file.open("wb") as opened:
            os.dup2(opened.fileno(), stream.fileno())
        stream.reconfigure(write_through=True)
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)
