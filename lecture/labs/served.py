"""A student's file in a process of its own, which calls its functions for the grader.

The grader starts this file by its path: it knows the standard library and numpy alone. A message,
either way, is the length of a JSON text (4 bytes), that text, and the doubles of its arrays.
"""

import contextlib
import json
import math
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

_LARGEST_HEADER = 2**20  # bytes
_LARGEST_ARRAYS = 2**27  # doubles of one message
_MEMORY = 2**33  # bytes of address space, so that a list that grows for ever ends in a MemoryError
_LENGTH_BYTES = 4
_AGAIN = 0.5  # s of processor time, after which an exception that was caught is raised once more

Arrays = Sequence[NDArray[np.float64]]


def pack(header: dict[str, Any], arrays: Arrays = ()) -> bytes:
    """The bytes of a message."""
    text = json.dumps({**header, "shapes": [array.shape for array in arrays]}).encode()
    parts = [array.astype(np.float64).tobytes() for array in arrays]
    return b"".join((len(text).to_bytes(_LENGTH_BYTES, "little"), text, *parts))


def unpack(read: Callable[[int], bytes]) -> tuple[dict[str, Any], list[NDArray[np.float64]]]:
    """A message's header and arrays; `read` gives so many bytes.

    Raises:
        ValueError: it is no such message.
    """
    length = int.from_bytes(read(_LENGTH_BYTES), "little")
    if not 0 < length <= _LARGEST_HEADER:
        raise ValueError(f"a header of {length} bytes")
    header = json.loads(read(length))
    shapes = [tuple(int(size) for size in shape) for shape in header.pop("shapes")]
    if sum(math.prod(shape) for shape in shapes) > _LARGEST_ARRAYS:
        raise ValueError("arrays that are too large")
    arrays = [
        np.frombuffer(read(8 * math.prod(shape)), dtype=np.float64).reshape(shape).copy()
        for shape in shapes
    ]
    return header, arrays


class _TooLongError(BaseException):
    """Raised in the student's code when its time is over; `except Exception` leaves it alone."""


class _WrongAnswerError(Exception):
    """What a function returned cannot be used."""


class _StudentFile:
    """The module, and what is said of its mistakes: one line each, with the line number."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._module = ModuleType("student")

    def load(self, limit: float) -> dict[str, Any]:
        """Run the file as a module; says what functions it has, and where, or what is wrong."""

        def run() -> None:
            self._module.__file__ = self._path
            code = compile(Path(self._path).read_bytes(), self._path, "exec")
            exec(code, self._module.__dict__)

        error = self._attempt("the file", run, limit)[1]
        if error:
            return error
        names = [name for name, value in vars(self._module).items() if callable(value)]
        return {"functions": {name: _first_line(getattr(self._module, name)) for name in names}}

    def call(self, header: dict[str, Any], arrays: Arrays) -> tuple[dict[str, Any], Arrays]:
        """The answer to a request: what a function returns, or what is wrong."""
        name, shape = header["function"], tuple(header["shape"])
        function = getattr(self._module, name)
        given = [float(array) if array.ndim == 0 else array for array in arrays]

        def run() -> NDArray[np.float64]:
            return _checked(function(*given), shape)

        begun = time.process_time()
        answer, error = self._attempt(f"{name}()", run, header["limit"], _first_line(function))
        seconds = {"seconds": time.process_time() - begun}
        return ({**error, **seconds}, ()) if answer is None else (seconds, (answer,))

    def _attempt(
        self, what: str, run: Callable[[], Any], limit: float, own: int = 1
    ) -> tuple[Any, dict[str, Any]]:
        """What `run` returns, or None and what went wrong, and in which line, else in `own`."""
        try:
            signal.setitimer(signal.ITIMER_PROF, limit, _AGAIN)
            try:
                return run(), {}
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0.0)
        except _TooLongError as error:
            line = self._line(error) or own
            said = f"{what} takes longer than {limit:g} s; it was ended here"
            return None, {"error": said, "line": line, "endless": True}
        except _WrongAnswerError as error:
            return None, {"error": f"{what} returned {error}", "line": own}
        except SyntaxError as error:
            place = error.lineno if error.filename == self._path else self._line(error)
            return None, {"error": f"SyntaxError: {error.msg}", "line": place or own}
        except BaseException as error:
            text = " ".join(str(error).split())[:200]
            said = f"{what} raised {type(error).__name__}" + f": {text}" * bool(text)
            return None, {"error": said, "line": self._line(error) or own}

    def _line(self, error: BaseException) -> int:
        """The last line of the student's file that led to an error; 0 if none did."""
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno or 0 for frame in frames if frame.filename == self._path]
        return lines[-1] if lines else 0


def _first_line(function: object) -> int:
    code: CodeType | None = getattr(function, "__code__", None)
    return 1 if code is None else code.co_firstlineno


def _checked(value: object, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """An answer as an array of a shape; raises _WrongAnswerError."""
    wanted = "one number" if shape == () else f"an array of shape {shape}"
    if value is None:
        raise _WrongAnswerError(f"nothing, not {wanted}")
    if hasattr(value, "dtype") and value.dtype.kind not in "biuf":
        raise _WrongAnswerError(f"an array of {value.dtype}, not {wanted}")
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise _WrongAnswerError(f"{type(value).__name__}, not {wanted}") from error
    if array.shape != shape:
        given = "one number" if array.shape == () else f"an array of shape {array.shape}"
        raise _WrongAnswerError(f"{given}, not {wanted}")
    if not np.isfinite(array).all():
        bad = array[~np.isfinite(array)].flat[0]
        raise _WrongAnswerError(f"{bad}; numbers must be finite")
    return array


def _end_in_time(number: int, frame: FrameType | None) -> None:
    raise _TooLongError


def _read_from(stream: IO[bytes]) -> Callable[[int], bytes]:
    def read(size: int) -> bytes:
        found = stream.read(size)
        if len(found) < size:  # the grader is gone
            os._exit(0)
        return found

    return read


def main() -> None:
    """Serve until the grader closes its end; what the student prints goes to standard error."""
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)
    requests = os.fdopen(os.dup(0), "rb")
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    with contextlib.suppress(ValueError, OSError):  # a lower limit may be in force
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    signal.signal(signal.SIGPROF, _end_in_time)
    file = _StudentFile(sys.argv[1])
    answers.write(pack(file.load(float(sys.argv[2]))))
    read = _read_from(requests)
    while True:
        answers.write(pack(*file.call(*unpack(read))))


if __name__ == "__main__":
    main()
