"""Keys led back to where their written path is within the tolerances, not that of plain numbers."""

from dataclasses import replace

import numpy as np

from actuated_characters.keys.goal import Goal, Keys
from actuated_characters.keys.relaxing import relax
from actuated_characters.keys.written import DIGITS_OF_END, SHORTEST_GAP, Led, WrittenPath

ENOUGH = 0.99  # tolerances, where keys are not rounded yet
_DIGITS_OF_TIME = 4
_AIM = 0.95  # tolerances, where the path is corrected; the rest is for rounding
_CORRECTIONS, _MAX_ADDED = 4, 30  # of the path before a key is added, and how many are
_SWEPT, _SWEEP_STEP = 10, 5  # keys that are corrected at once, and by how many the next ones begin


def led_back(
    written: WrittenPath, goal: Goal, keys: Keys, part: tuple[int, int], *, moves: bool
) -> Led:
    """The best of some corrections of keys, from the first to the last of a part; none included.

    Where rotations between two keys are large, plain numbers tell little of the written path, and
    what is corrected may be worse.
    """
    best = led = written.led(goal, keys, part)
    for _ in range(_CORRECTIONS):
        if best.error <= ENOUGH:
            break
        _, keys = relax(led.goal, led.keys, part, moves=moves, aim=_AIM)
        led = written.led(led.goal, keys, part)
        best = min(best, led, key=lambda each: each.error)
    return best


def all_led_back(written: WrittenPath, goal: Goal, keys: Keys) -> Led:
    """All keys corrected where they are, and more of them where this is not enough."""
    best = led = written.led(goal, keys)
    for correction in range(_CORRECTIONS + _MAX_ADDED):
        if best.error <= 1.0:
            break
        keys = led.keys if correction < _CORRECTIONS else _with_one_more(led)
        for first in range(0, len(keys.times), _SWEEP_STEP):
            _, keys = relax(led.goal, keys, (first, first + _SWEPT - 1), moves=False, aim=_AIM)
        led = written.led(led.goal, keys)
        best = min(best, led, key=lambda each: each.error)
    return best


def rounded(goal: Goal, keys: Keys) -> Keys:
    """Keys at times in tenths of ms; the end of what is no loop stays where it is."""
    times = np.round(keys.times, _DIGITS_OF_TIME)
    if goal.loop is None:
        times[-1] = round(float(keys.times[-1]), DIGITS_OF_END)
    return replace(keys, times=times)


def _with_one_more(led: Led) -> Keys:
    """The keys with one more, in the middle of the two about the sample that is farthest off."""
    keys, goal = led.keys, led.goal
    ends = keys.times if goal.loop is None else np.append(keys.times, goal.loop.period)
    worst = goal.times[len(goal.times) // 3 if goal.loop else 0 :][int(led.errors.argmax())]
    segment = int(np.searchsorted(ends, worst, side="right").clip(1, len(ends) - 1)) - 1
    time = float(np.round(0.5 * (ends[segment] + ends[segment + 1]), 3))
    if min(time - ends[segment], ends[segment + 1] - time) < SHORTEST_GAP:
        return keys
    return keys.inserted(time, goal.states(np.array([time]))[0])
