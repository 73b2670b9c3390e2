"""Which stills of a strip show a push: those of the moments in which it acts.

Stills are seldom, and a push is short: most act between two stills. A later still shows a body that
nothing pushes any more, so an arrow there would be wrong.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from msgs_config.arrays import IntArray

Ticks = tuple[int, int]
"""The first of some ticks, and the one after the last; tick k leads to the state k + 1."""


@dataclass
class PushedStills:
    """The states of a strip, and of each the ticks whose pushes it shows."""

    rows: IntArray  # (p,) in order
    others: list[list[Ticks]] = field(init=False)
    """Of each still the pushes that it shows though they act before or after it."""

    def __post_init__(self) -> None:
        self.others = [[] for _ in self.rows]

    def ticks(self) -> list[list[Ticks]]:
        """Of each still the ticks whose pushes it shows: the one that led to it, and others."""
        led = [(max(row - 1, 0), row) for row in self.rows.tolist()]
        return [[own, *others] for own, others in zip(led, self.others, strict=True)]


def place_stills(rows: IntArray, pushes: Iterable[Ticks], *, moves: bool) -> PushedStills:
    """Have a strip show the pushes between its first and its last still.

    Where no still is in a push, the nearest one is moved to its middle: not the first or the last
    one, nor one that shows another push. Where there is none, or where stills may not move, the
    nearest one shows it nevertheless.

    Args:
        rows: The states of the stills (p,), in order.
        pushes: The ticks of each push.
        moves: Whether stills may be moved.
    """
    stills = PushedStills(rows.copy())
    within = sorted(each for each in pushes if rows[0] <= each[0] and each[1] <= rows[-1])
    taken = {number for push in within for number in _in_push(rows, push)}
    for push in within:
        if len(_in_push(stills.rows, push)):
            continue
        after = int(np.searchsorted(stills.rows, push[1]))
        near = [number for number in (after - 1, after) if 0 <= number < len(rows)]
        free = [each for each in near if 0 < each < len(rows) - 1 and each not in taken]
        if moves and free:
            number = _nearest(stills.rows, free, push)
            stills.rows[number] = _middle(push)
            taken.add(number)
        else:
            stills.others[_nearest(stills.rows, near, push)].append(push)
    return stills


def _in_push(rows: IntArray, push: Ticks) -> list[int]:
    """The numbers of the states to which a tick of a push led."""
    return np.flatnonzero((rows > push[0]) & (rows <= push[1])).tolist()


def _middle(push: Ticks) -> int:
    """The state in the middle of a push."""
    return (push[0] + 1 + push[1]) // 2


def _nearest(rows: IntArray, numbers: Sequence[int], push: Ticks) -> int:
    """Which of some stills is nearest to a push."""
    return min(numbers, key=lambda number: abs(int(rows[number]) - _middle(push)))
