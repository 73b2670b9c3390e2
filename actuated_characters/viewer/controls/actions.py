"""What pages have done, from the server's thread to the one that acts."""

from collections import deque
from collections.abc import Callable

_MAX_WAITING = 1000  # actions that wait: more come only from a sender that means to flood

Action = Callable[[], None]


class ActionQueue:
    """Actions in their order; the oldest are dropped where more come than are run."""

    def __init__(self) -> None:
        self._actions: deque[Action] = deque(maxlen=_MAX_WAITING)
        self.put = self._actions.append
        """Adds an action; for any thread."""

    def run(self) -> None:
        """Run those that are there now."""
        for _ in range(len(self._actions)):
            self._actions.popleft()()
