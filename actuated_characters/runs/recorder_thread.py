"""The recorder of a run without a bag: a thread of the run's own process, and no process more."""

import os
import signal
import threading
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

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
        self._stop = _Stop()
        self._lines = deque[str]()
        self._failure: BaseException | None = None
        with _variables({**environment, **middleware_settings(environment)}):
            self._context = own_context("--disable-stdout-logs")
            ros_arguments = ["--ros-args", "--params-file", str(parameters), *arguments]
            self._node = RecorderNode(
                self._lines.append,
                context=self._context,
                cli_args=ros_arguments,
                use_global_arguments=False,
            )
        self._thread = threading.Thread(target=self._record, name=self.name, daemon=True)
        self._thread.start()

    def _record(self) -> None:
        use_batch_scheduling()  # of this thread alone: on Linux each has a policy of its own
        try:
            self._node.run(self._stop)
        except BaseException as error:
            self._failure = error

    @property
    def exit_code(self) -> int | None:
        """As of a process: None while it records, then 0 if all was well."""
        return None if self._thread.is_alive() else int(self._failure is not None)

    def last_words(self) -> str:
        """Why it failed."""
        return str(self._failure)

    def last_warning(self, since: int) -> str:
        """None: it waits for nothing."""
        del since
        return ""

    def read_lines(self) -> list[str]:
        """The lines about its progress since the last call."""
        return [self._lines.popleft() for _ in range(len(self._lines))]

    def end(self, request: signal.Signals | None = None) -> int:
        """Take the last messages, write the figures and leave the graph; return the exit code."""
        del request
        self._stop.set()
        self._thread.join()
        self._node.destroy_node()
        self._context.try_shutdown()
        if not isinstance(self._failure, ActuatedCharactersError | None):
            raise self._failure
        return int(self._failure is not None)


@contextmanager
def _variables(values: Mapping[str, str]) -> Iterator[None]:
    """Set the variables of this process' environment, and set them back."""
    before = dict(os.environ)
    os.environ.update(values)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
