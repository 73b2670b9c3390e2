"""Keys taken away one after the other, the least needed one first."""

from collections.abc import Callable

import numpy as np

from actuated_characters.keys.goal import Goal, Keys
from actuated_characters.keys.relaxing import relax

_NEAR, _NEAR_MOVING = 3, 4  # keys on each side that make up for one, without and with their times
_AFFECTED = 5  # keys on each side of one that is gone, whose own cost is another one then
_HOPELESS = 6.0  # tolerances, beyond which moving the neighbours' times is not tried
_SWEEPS, _SWEPT, _SWEEP_STEP, _SWEEP_AIM = 2, 8, 4, 0.3
_FEWEST_OPEN, _FEWEST_OF_LOOP = 2, 3

Progress = Callable[[float], None]
"""Takes the share of the work that is done."""


class Thinning:
    """Keys that get fewer, while the path stays within the tolerances."""

    def __init__(self, goal: Goal, keys: Keys, progress: Progress) -> None:
        self.keys = keys
        self._goal, self._report, self._done = goal, progress, 0.0
        self._costs = np.zeros(0)  # (p,) largest error without a key, in tolerances
        self._tried = np.zeros(0, dtype=np.bool_)  # (p,) whether moving times did not help
        self._begin = len(keys.times)

    def thin(self) -> Keys:
        """Take away all that can be done without, and move those that are left where this helps."""
        self._assess()
        self._take_away()
        for _ in range(_SWEEPS):
            self._take_away_moving()
            self._sweep()
            self._assess()
        self._take_away_moving()
        return self.keys

    def _progress(self, share: float) -> None:
        """Report the share that is done, which never falls."""
        self._done = max(self._done, share)
        self._report(self._done)

    def _assess(self) -> None:
        count = len(self.keys.times)
        self._costs = np.array([self._cost(key) for key in range(count)])
        self._tried = np.zeros(count, dtype=np.bool_)

    def _cost(self, key: int) -> float:
        if not self._is_removable(key):
            return np.inf
        return self._without(key, _NEAR, moves=False)[0]

    def _is_removable(self, key: int) -> bool:
        """Whether a key may go: the first one stays, and the last one of what is no loop."""
        count, loops = len(self.keys.times), self._goal.loop is not None
        if count <= (_FEWEST_OF_LOOP if loops else _FEWEST_OPEN):
            return False
        return 0 < key < count - 1 or (loops and key > 0)

    def _without(self, key: int, near: int, *, moves: bool) -> tuple[float, Keys]:
        chosen = (key - near, key + near)
        return relax(self._goal, self.keys, chosen, left_out=key, moves=moves)

    def _take_away(self) -> None:
        """Take away the cheapest key, and again, while values alone make up for it."""
        while self._costs.min() <= 1.0:
            key = int(self._costs.argmin())
            error, keys = self._without(key, _NEAR, moves=False)
            if error > 1.0:  # its cost was that before a neighbour changed
                self._costs[key] = error
                continue
            self._remove(key, keys)
            self._progress(0.5 * (1.0 - len(self.keys.times) / self._begin))

    def _take_away_moving(self) -> None:
        """Take away keys for which values and times of the neighbours make up."""
        while True:
            open_costs = np.where(self._tried, np.inf, self._costs)
            key = int(open_costs.argmin())
            if open_costs[key] > _HOPELESS:
                break
            error, keys = self._without(key, _NEAR_MOVING, moves=True)
            self._tried[key] = True
            if error <= 1.0:
                self._remove(key, keys)
            self._progress(0.5 + 0.4 * float(self._tried.mean()))

    def _remove(self, key: int, keys: Keys) -> None:
        self.keys = keys.without(key)
        self._costs = np.delete(self._costs, key)
        self._tried = np.delete(self._tried, key)
        count = len(self.keys.times)
        for near in range(key - _AFFECTED - _NEAR_MOVING, key + _AFFECTED + _NEAR_MOVING):
            if self._goal.loop is not None or 0 <= near < count:
                self._costs[near % count] = self._cost(near % count)
                self._tried[near % count] = False

    def _sweep(self) -> None:
        """Lower the error everywhere, which leaves room for keys to go."""
        count = len(self.keys.times)
        for first in range(0, count, _SWEEP_STEP):
            chosen = (first, first + _SWEPT)
            error, keys = relax(self._goal, self.keys, chosen, aim=_SWEEP_AIM)
            if error <= 1.0:
                self.keys = keys
