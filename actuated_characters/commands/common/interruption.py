"""SIGINT and SIGTERM end a command, also where a module that is being imported takes no notice."""

import signal
from types import FrameType

_is_interrupted = False


class Interrupted(KeyboardInterrupt):
    """Not KeyboardInterrupt itself: where that goes through code that was made from a text, such
    as a dataclass's, Python remembers it, and in the end kills a module that was run by `-m`.
    Its argument is the signal's number.
    """


def raise_at_signals() -> None:
    """Have SIGINT and SIGTERM raise `Interrupted` from now on."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)


def was_interrupted() -> bool:
    """Whether a signal has come, whatever became of the exception."""
    return _is_interrupted


def check_interruption() -> None:
    """Raise `Interrupted` if a signal has come: the import of an extension may have dropped it."""
    if _is_interrupted:
        raise Interrupted


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _is_interrupted
    del frame
    _is_interrupted = True
    raise Interrupted(number)
