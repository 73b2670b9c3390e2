"""What both players have in common: waiting with an end, and telling how far they are."""

import time
from collections.abc import Callable

from msgs_config.errors import RunError

PATIENCE = 60.0
"""s that an answer may take, on a machine that may be busy with other things."""

WAITING = "waiting for "
TICK = "tick "

_EXPLAIN_PERIOD = 2.0  # s
_TICK_PERIOD = 0.1  # s


class Watch:
    """Looks how long something has been waited for: says it now and then, and gives up at last."""

    def __init__(self, patience: float = PATIENCE) -> None:
        """`patience` in s; infinite for who waits forever."""
        self._patience = patience
        self.restart()

    def restart(self) -> None:
        """Begin to wait for the next thing."""
        self._since = time.monotonic()
        self._next_word = self._since + _EXPLAIN_PERIOD

    def look(self, what: Callable[[], str]) -> None:
        """Say what is waited for, if it is time.

        Raises:
            RunError: it has taken too long.
        """
        now = time.monotonic()
        if now > self._since + self._patience:
            raise RunError(f"waited {self._patience:g} s for {what()}")
        if now > self._next_word:
            self._next_word = now + _EXPLAIN_PERIOD
            print(f"{WAITING}{what()}", flush=True)


class Ticks:
    """Prints how far it is, for who started this process."""

    def __init__(self) -> None:
        self._next = 0.0

    def tell(self, tick: int) -> None:
        """Print a tick, if the last one is a while ago."""
        now = time.monotonic()
        if now > self._next:
            self._next = now + _TICK_PERIOD
            print(f"{TICK}{tick}", flush=True)
