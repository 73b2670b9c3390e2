"""A student's file for the grader: its functions, called in another process, in limited time."""

import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from lecture.labs import served
from msgs_config.arrays import FloatArray
from msgs_config.errors import ActuatedCharactersError, ConfigurationError

_CALL_LIMIT = 2.0  # s of processor time, of one call or of the import
_TOTAL_LIMIT = 40.0  # s, of all calls together
_STALL_LIMIT = 10.0  # s that pass without an answer, where no processor time does
_GRID = 2.0**-12


class StudentError(ActuatedCharactersError):
    """A mistake in the student's file: one line, with its name and the line number."""


class Student:
    """A process that has imported the file. Where that failed, each call raises the same error."""

    def __init__(self, path: Path) -> None:
        """Start the process.

        Raises:
            ConfigurationError: there is no such file.
        """
        if not path.is_file():
            raise ConfigurationError(f"{path}: no such file; --stub {path} makes one to begin with")
        self._path = path
        self._time = 0.0  # s of processor time that all calls have taken
        self._broken: dict[str, str] = {}  # what is wrong with functions that never return
        self._dead = ""  # why nothing can be called any more
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
        # -P: a file beside the student's must not take the place of a module of Python
        program = [sys.executable, "-P", served.__file__, str(path), str(_CALL_LIMIT)]
        self._process = subprocess.Popen(
            program,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            bufsize=0,
            start_new_session=True,  # Ctrl-C is the grader's
        )
        self._lines: dict[str, int] = {}
        try:
            header, _ = self._answer("the file", 1)
            self._lines = header["functions"]
        except StudentError as error:
            self._dead = str(error)

    def __enter__(self) -> "Student":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()

    def call(
        self,
        function: str,
        *given: FloatArray | float,
        shape: tuple[int, ...] = (),
        grid: float = _GRID,
    ) -> FloatArray:
        """What a function returns, of a shape; rounded to multiples of a power of two.

        So the last bits of a sine or a matrix product, which differ between processors, do not
        reach the simulation.

        Raises:
            StudentError: there is no such function, it raised an error, took too long, or
                returned something else.
        """
        if self._dead or function in self._broken:
            raise StudentError(self._dead or self._broken[function])
        if function not in self._lines:
            raise StudentError(f"{self._path}: has no function {function}(); the stub says of what")
        line = self._lines[function]
        if self._time > _TOTAL_LIMIT:
            text = f"all calls together take longer than {_TOTAL_LIMIT:g} s of a processor"
            raise StudentError(self._at(line, text))
        header = {"function": function, "shape": shape, "limit": _CALL_LIMIT}
        self._send(served.pack(header, [np.asarray(each, dtype=float) for each in given]))
        _, arrays = self._answer(f"{function}()", line)
        if len(arrays) != 1 or arrays[0].shape != shape or not np.isfinite(arrays[0]).all():
            self._end(self._at(line, f"{function}() meddled with the grader's pipe"))
        rounded: FloatArray = np.round(arrays[0] / grid) * grid
        return rounded

    def number(self, function: str, *given: FloatArray | float, grid: float = _GRID) -> float:
        """As `call`, of a function that returns one number."""
        return float(self.call(function, *given, grid=grid))

    def _send(self, message: bytes) -> None:
        assert self._process.stdin is not None
        try:
            rest = memoryview(message)
            while rest:
                rest = rest[self._process.stdin.write(rest) or 0 :]
        except BrokenPipeError:
            pass  # the answer that does not come says why

    def _answer(self, what: str, line: int) -> tuple[dict[str, Any], list[FloatArray]]:
        """The next message. Raises StudentError if it tells of one, or none comes."""
        deadline = time.monotonic() + _CALL_LIMIT + _STALL_LIMIT

        def read(size: int) -> bytes:
            found = b""
            while len(found) < size:
                found += self._read_some(size - len(found), deadline, what, line)
            return found

        try:
            header, arrays = served.unpack(read)
            self._time += float(header.get("seconds", 0.0))
        except (ValueError, KeyError, TypeError, AttributeError):
            self._end(self._at(line, f"{what} meddled with the grader's pipe"))
        if "error" in header:
            text = self._at(header["line"], header["error"])
            if header.get("endless"):
                self._broken[what.removesuffix("()")] = text
            raise StudentError(text)
        return header, arrays

    def _read_some(self, size: int, deadline: float, what: str, line: int) -> bytes:
        assert self._process.stdout is not None
        ready, _, _ = select.select(
            [self._process.stdout], [], [], max(deadline - time.monotonic(), 0.0)
        )
        if not ready:
            limit = _CALL_LIMIT + _STALL_LIMIT
            self._end(self._at(line, f"{what} has not returned after {limit:g} s"))
        found = os.read(self._process.stdout.fileno(), min(size, 2**20))
        if not found:
            code = self._process.wait()
            end = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            self._end(self._at(line, f"{what} ended its process: {end}"))
        return found

    def _end(self, text: str) -> None:
        """Give up: nothing can be called any more."""
        self._dead = text
        self._process.kill()
        raise StudentError(text)

    def _at(self, line: object, text: object) -> str:
        return f"{self._path}:{line}: {text}"
