"""Keys taken away one after the other, the least needed one first."""

from collections.abc import Callable

import numpy as np

from actuated_characters.keys.goal import Goal, Keys
from actuated_characters.keys.leading_back import ENOUGH, led_back
from actuated_characters.keys.relaxing import relax
from actuated_characters.keys.written import Led, WrittenPath

_NEAR, _NEAR_MOVING = 3, 4  # keys on each side that make up for one, without and with their times
_AFFECTED = 5  # keys on each side of one that is gone, whose own cost is another one then
_HOPELESS = 6.0  # tolerances, beyond which moving the neighbours' times is not tried
_MERGED_WITH = (-1, 1)  # the key that meets one that is gone half-way, in each round
_SWEPT, _SWEEP_STEP, _SWEEP_AIM = 8, 4, 0.3
_FEWEST_OPEN, _FEWEST_OF_LOOP = 2, 3

Progress = Callable[[float], None]
"""Takes the share of the work that is done."""


class Thinning:
    """Keys that get fewer, while the path stays within the tolerances."""

    def __init__(self, written: WrittenPath, goal: Goal, keys: Keys, progress: Progress) -> None:
        self._written, self.goal, self.keys = written, goal, keys
        self._report, self._done = progress, 0.0
        self._costs = np.zeros(0)  # (p,) largest error without a key, in tolerances
        self._stale = np.zeros(0, dtype=np.bool_)  # (p,) whether that was before others changed
        self._tried = np.zeros(0, dtype=np.bool_)  # (p,) whether moving times did not help
        self._begin = len(keys.times)

    def thin(self) -> None:
        """Take away all that can be done without, and move those that are left where this helps."""
        self._assess()
        self._take_away()
        for neighbour in _MERGED_WITH:
            self._assess()
            self._take_away_moving(neighbour)
            self._sweep()

    def _progress(self, share: float) -> None:
        """Report the share that is done, which never falls."""
        self._done = max(self._done, share)
        self._report(self._done)

    def _assess(self) -> None:
        count = len(self.keys.times)
        self._costs = np.array([self._cost(key) for key in range(count)])
        self._stale, self._tried = np.zeros((2, count), dtype=np.bool_)

    def _cost(self, key: int) -> float:
        if not self._is_removable(key):
            return np.inf
        return self._without(key)[0]

    def _is_removable(self, key: int) -> bool:
        """Whether a key may go: the first one stays, and the last one of what is no loop."""
        count, loops = len(self.keys.times), self.goal.loop is not None
        if count <= (_FEWEST_OF_LOOP if loops else _FEWEST_OPEN):
            return False
        return 0 < key < count - 1 or (loops and key > 0)

    def _without(self, key: int) -> tuple[float, Keys]:
        chosen = (key - _NEAR, key + _NEAR - 1)
        return relax(self.goal, self.keys.without(key), chosen, moves=False)

    def _merged(self, key: int, neighbour: int) -> tuple[float, Keys]:
        """The error without a key, and the keys near it moved; a neighbour begins half-way."""
        keys, chosen = self.keys, _moving(key)
        if 0 < key + neighbour < len(keys.times) - 1:
            times, states = keys.times.copy(), keys.states.copy()
            for each in (times, states):
                each[key + neighbour] = 0.5 * (each[key] + each[key + neighbour])
            keys = Keys(times, states)
        return relax(self.goal, keys.without(key), chosen)

    def _take_away(self) -> None:
        """Take away the cheapest key, and again, while others make up for it where they are."""
        while self._costs.min() <= 1.0:
            key = int(self._costs.argmin())
            if self._stale[key]:
                self._renew(key)
                continue
            part = (key - _NEAR, key + _NEAR - 1)
            _, keys = self._without(key)
            self._costs[key] = np.inf
            led = led_back(self._written, self.goal, keys, part, moves=False)
            if led.error <= ENOUGH:
                self._remove(key, led, _NEAR)
            self._progress(0.5 * (1.0 - len(self.keys.times) / self._begin))

    def _take_away_moving(self, neighbour: int) -> None:
        """Take away keys for which states and times of the neighbours make up."""
        while True:
            open_costs = np.where(self._tried, np.inf, self._costs)
            key = int(open_costs.argmin())
            if open_costs[key] > _HOPELESS:
                break
            if self._stale[key]:
                self._renew(key)
                continue
            error, keys = self._merged(key, neighbour)
            self._tried[key] = True
            if error > 1.0:
                continue
            led = led_back(self._written, self.goal, keys, _moving(key), moves=True)
            if led.error <= ENOUGH:
                self._remove(key, led, _NEAR_MOVING)
            self._progress(0.5 + 0.4 * float(self._tried.mean()))

    def _renew(self, key: int) -> None:
        self._costs[key] = self._cost(key)
        self._stale[key] = False

    def _remove(self, key: int, led: Led, near: int) -> None:
        """Have keys without one; those near to it have changed, which is mostly at their cost."""
        self.keys, self.goal = led.keys, led.goal
        self._costs = np.delete(self._costs, key)
        self._stale, self._tried = np.delete([self._stale, self._tried], key, axis=1)
        count = len(self.keys.times)
        others = np.arange(key - _AFFECTED - near, key + _AFFECTED + near)
        if self.goal.loop is None:
            others = others[(others >= 0) & (others < count)]
        self._stale[others % count], self._tried[others % count] = True, False

    def _sweep(self) -> None:
        """Lower the error everywhere, which leaves room for keys to go."""
        count = len(self.keys.times)
        for first in range(0, count, _SWEEP_STEP):
            chosen = (first, first + _SWEPT)
            error, keys = relax(self.goal, self.keys, chosen, aim=_SWEEP_AIM)
            if error > 1.0:
                continue
            led = led_back(self._written, self.goal, keys, chosen, moves=True)
            if led.error <= ENOUGH:
                self.keys, self.goal = led.keys, led.goal


def _moving(key: int) -> tuple[int, int]:
    """The first and the last of the keys that move where one is taken away, without that."""
    return key - _NEAR_MOVING, key + _NEAR_MOVING - 1
