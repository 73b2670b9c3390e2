"""How fast simulated time goes by."""

from collections import deque

_LONG, _SHORT = 2.0, 0.5  # s of wall time over which it is measured at most, and at least


class Pace:
    """Measures the simulated time of one character after another."""

    def __init__(self) -> None:
        self._of = ""
        self._seen: deque[tuple[float, float]] = deque()  # wall time, simulated time, s

    def measure(self, below: str, time: float, now: float) -> str:
        """What the page says of it, empty as long as too little is known.

        Args:
            below: The character's namespace.
            time: Of its newest state, s.
            now: Wall time, s.
        """
        seen = self._seen
        if below != self._of or (seen and time < seen[-1][1]):
            seen.clear()
        self._of = below
        seen.append((now, time))
        while now - seen[0][0] > _LONG:
            seen.popleft()
        wall, simulated = now - seen[0][0], time - seen[0][1]
        if wall < _SHORT:
            return ""
        return f"{simulated / wall:.1f} × real time, " if simulated > 0.0 else "time rests, "
