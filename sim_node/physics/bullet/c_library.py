"""The C library as an engine finds it that reads text and prints: its locale and its streams.

Both are altered around a single call of the engine. The locale is the calling thread's alone. Of
the streams, the C library's variables `stdout` and `stderr` are altered, never the descriptors 1
and 2: what Python prints, in any thread or process, passes by, whether there is an output or not.
"""

import ctypes
import locale
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from msgs_config.runtime.fork_safe import fork_safe_lock

_LIBRARY = ctypes.PyDLL(None)  # it keeps Python's own lock: no other thread comes in between


def _function(name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
    function = getattr(_LIBRARY, name)
    function.restype, function.argtypes = result, arguments
    return function  # type: ignore[no-any-return]


_uselocale = _function("uselocale", ctypes.c_void_p, ctypes.c_void_p)
_newlocale = _function("newlocale", ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p)
_C_NUMBERS = _newlocale(1 << locale.LC_NUMERIC, b"C", None)


@contextmanager
def c_numbers() -> Iterator[None]:
    """Have this thread's C code read numbers with a decimal point, whatever the locale."""
    before = _uselocale(_C_NUMBERS)
    try:
        yield
    finally:
        _uselocale(before)


class _MemoryStream:
    """A stream of the C library that keeps what is printed to it.

    It is never closed: when it is out of use again, a thread without Python's lock may still be
    about to print to it. Where its text is told is the C library's memory, never given back: as the
    process ends, the C library flushes the stream once more, and Python's memory is gone by then.
    """

    def __init__(self) -> None:
        places = _function("calloc", ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t)(2, 8)
        self._text = ctypes.c_void_p.from_address(places)
        self._size = ctypes.c_size_t.from_address(places + 8)
        self._flush = _function("fflush", ctypes.c_int, ctypes.c_void_p)
        self._rewind = _function("rewind", None, ctypes.c_void_p)
        create = _function("open_memstream", ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
        self.address = create(ctypes.byref(self._text), ctypes.byref(self._size))

    def clear(self) -> None:
        """Forget what was printed."""
        self._rewind(self.address)

    def text(self) -> str:
        """What was printed since it was cleared."""
        self._flush(self.address)
        return ctypes.string_at(self._text.value or 0, self._size.value).decode(errors="replace")


_printed = _MemoryStream()
_lock = fork_safe_lock()  # all threads have the same streams


@contextmanager
def captured_output(*streams: str) -> Iterator[Callable[[], str]]:
    """Keep what C code prints to `stdout`, or to the streams named; yields what gives the text.

    Threads wait for each other.
    """
    with _lock:
        variables = [ctypes.c_void_p.in_dll(_LIBRARY, name) for name in streams or ("stdout",)]
        before = [variable.value for variable in variables]
        _printed.clear()
        try:
            for variable in variables:
                variable.value = _printed.address
            yield _printed.text
        finally:
            for variable, value in zip(variables, before, strict=True):
                variable.value = value
