"""Signals that wait until something is done that must not be left in the middle."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class HeldSignals:
    """SIGINT and SIGTERM that have come; true from the first one on, so that a loop can end."""

    def __init__(self, most: int) -> None:
        """Keep so many; one more acts at once, as do those before it."""
        self._most, self._has_come = most, False
        self._received: list[int] = []
        # a mask would hold them back from one thread alone
        self._handlers = {
            number: signal.signal(number, self._receive)
            for number in (signal.SIGINT, signal.SIGTERM)
            if signal.getsignal(number) is not None  # a handler that is not Python's would be lost
        }

    def __bool__(self) -> bool:
        return self._has_come

    def _receive(self, number: int, frame: FrameType | None) -> None:
        del frame
        self._has_come = True
        self._received.append(number)
        if len(self._received) > self._most:
            self.release()

    def release(self) -> None:
        """Let them act, and all that come from now on."""
        handlers, self._handlers = self._handlers, {}
        for number, handler in handlers.items():
            signal.signal(number, handler)
        received, self._received = self._received, []
        for caught in received:
            signal.raise_signal(caught)


@contextmanager
def signals_held(most: int = 100) -> Iterator[HeldSignals | bool]:
    """Keep signals for afterwards; one more than `most` acts at once, as do those before it.

    Yields what becomes true with the first: False in another thread than the main one, to which all
    signals come.
    """
    if threading.current_thread() is not threading.main_thread():
        yield False
        return
    held = HeldSignals(most)
    try:
        yield held
    finally:
        held.release()
