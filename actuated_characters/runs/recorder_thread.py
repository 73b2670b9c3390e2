"""The recorder of a run without a bag: a thread of the run's own process, and no process more."""

import os
import signal
import threading
import traceback
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from actuated_characters.recorder.node import RecorderNode
from msgs_config.bus.dds import own_context
from msgs_config.errors import ActuatedCharactersError
from msgs_config.runtime.process import middleware_settings, use_batch_scheduling


class _Stop(threading.Event):
    """Becomes true when it is set."""

    def __bool__(self) -> bool:
        return self.is_set()


class RecorderThread:
    """The node `recorder` in a thread, with the ways of a process."""

    name = "recorder"
    log_size = 0
    """Bytes of a log of its own: what it logs is in the run's folder of logs, as ROS writes it."""

    def __init__(
        self, parameters: Path, environment: Mapping[str, str], arguments: Sequence[str]
    ) -> None:
        """Begin to record, with a file of parameters and further arguments for ROS.

        The environment is that of the run's other processes, by which they find each other.

        Raises:
            ActuatedCharactersError: a parameter is wrong, the directory cannot be written to, or
                ROS does not start.
        """
        self._arguments = ["--ros-args", "--params-file", str(parameters), *arguments]
        self._environment = {**environment, **middleware_settings(environment)}
        self._stop, self._has_begun = _Stop(), threading.Event()
        self._lines = deque[str]()
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._work, name=self.name, daemon=True)
        self._thread.start()
        self._has_begun.wait()
        if self._failure is not None:
            raise self._failure

    def _work(self) -> None:
        use_batch_scheduling()  # of this thread, and of the middleware's that it starts
        try:
            self._record()
        except ActuatedCharactersError as error:
            self._failure = error
        except BaseException as error:
            self._failure = error
            traceback.print_exc()
        finally:
            self._has_begun.set()

    def _record(self) -> None:
        with ExitStack() as at_end:
            with _variables(self._environment):  # which the middleware reads as it begins
                context = own_context("--disable-stdout-logs")
                at_end.callback(context.try_shutdown)
                given: dict[str, Any] = {"cli_args": self._arguments, "context": context}
                node = RecorderNode(self._lines.append, use_global_arguments=False, **given)
            at_end.callback(node.destroy_node)
            self._has_begun.set()
            node.run(self._stop)

    @property
    def exit_code(self) -> int | None:
        """As of a process: None while it records, then 0 if all was well."""
        return None if self._thread.is_alive() else int(self._failure is not None)

    def last_words(self) -> str:
        """Why it failed."""
        return str(self._failure)

    def last_warning(self, since: int, saying: str = "") -> str:
        """None: it waits for nothing."""
        del since, saying
        return ""

    def read_lines(self) -> list[str]:
        """The lines about its progress since the last call."""
        return [self._lines.popleft() for _ in range(len(self._lines))]

    def end(self, request: signal.Signals | None = None) -> int:
        """Take the last messages, write the figures and leave the graph; return the exit code."""
        del request
        self._stop.set()
        self._thread.join()
        return int(self._failure is not None)


@contextmanager
def _variables(values: Mapping[str, str]) -> Iterator[None]:
    """Set variables of this process' environment, and set them back."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
