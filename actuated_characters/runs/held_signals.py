"""Signals that wait until something is done that must not be left in the middle."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class HeldSignals:
    """SIGINT and SIGTERM that have come and are kept; true if there are any."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._received: list[int] = []
        # a mask would hold them back from one thread alone
        self._handlers = {
            number: signal.signal(number, self._receive)
            for number in (signal.SIGINT, signal.SIGTERM)
        }

    def __bool__(self) -> bool:
        return bool(self._received)

    def _receive(self, number: int, frame: FrameType | None) -> None:
        del frame
        self._received.append(number)
        if len(self._received) > self._most:
            self.release()

    def release(self) -> None:
        """Let them act, and all that come from now on."""
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        received, self._received = self._received, []
        for caught in received:
            signal.raise_signal(caught)


@contextmanager
def signals_held(most: int = 100) -> Iterator[HeldSignals | bool]:
    """Keep signals for afterwards; one more than `most` acts at once, as do those before it.

    Yields what becomes true with the first, so that a loop can end: False in another thread than
    the main one, to which all signals come.
    """
    if threading.current_thread() is not threading.main_thread():
        yield False
        return
    held = HeldSignals(most)
    try:
        yield held
    finally:
        held.release()
