"""An end for a process whose middleware does not let it end."""

import ctypes

_CLOCK_MONOTONIC = 1
_SIGEV_THREAD = 2
_LIBC = ctypes.CDLL(None, use_errno=True)


class _Event(ctypes.Structure):  # struct sigevent, sigevent(7)
    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signal", ctypes.c_int),
        ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("rest", ctypes.c_byte * 40),
    )


class _Times(ctypes.Structure):  # struct itimerspec, timer_settime(2)
    _fields_ = (
        ("interval_s", ctypes.c_long),
        ("interval_ns", ctypes.c_long),
        ("s", ctypes.c_long),
        ("ns", ctypes.c_long),
    )


def exit_after(seconds: int, code: int) -> None:
    """End the process in some seconds with an exit code, whatever it is doing then.

    Fast DDS 2.14 can wait forever when a node leaves in the very moment in which another one
    comes or goes (its issue 6513), in compiled code that lets no Python run. So it is the C
    library that calls its own `_exit`, in another thread.
    """
    event = _Event(
        value=code,
        notify=_SIGEV_THREAD,
        function=ctypes.cast(_LIBC._exit, ctypes.c_void_p).value,
    )
    timer = ctypes.c_void_p()
    times = _Times(s=seconds)
    if _LIBC.timer_create(_CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) == 0:
        _LIBC.timer_settime(timer, 0, ctypes.byref(times), None)
