"""What a search has found, as its page is told of it."""

from dataclasses import dataclass
from enum import Enum

from msgs_config.arrays import FloatArray


class Fate(Enum):
    """What becomes of a world after its window: the word over its head, and its colour."""

    BEST = "best", (38, 104, 190)
    KEPT = "kept", (112, 168, 226)
    DROPPED = "dropped", (158, 160, 164)
    LOST = "lost", (206, 62, 40)

    @property
    def word(self) -> str:
        """What stands over its head."""
        return self.value[0]

    @property
    def color(self) -> tuple[int, int, int]:
        """Red, green and blue, 0 to 255."""
        return self.value[1]


def as_cost(cost: float) -> str:
    """A cost as text of at least two digits, without an exponent."""
    return f"{cost:.0f}" if cost >= 10.0 else f"{cost:.1f}"


@dataclass(frozen=True, eq=False)
class WorldNews:
    """One world of a window."""

    positions: FloatArray  # (t, n) of each tick, from a while before the window to its end
    fate: Fate
    cost: float | None  # what decides who is kept; None of one that is lost


@dataclass(frozen=True, eq=False)
class WindowNews:
    """A window that was tried."""

    number: int  # from 1 on
    windows: int
    time: float  # s, of its end in the motion
    failures: int  # windows so far in which all worlds were lost
    worlds: tuple[WorldNews, ...]
    hidden: int  # worlds that are not among these
    best: FloatArray  # (t, n) positions of the best path so far, its last part
    desired: FloatArray  # (t, n) the motion's own


@dataclass(frozen=True, eq=False)
class MotionNews:
    """A motion that is seen alone: the one that is searched for, or the one that was found."""

    positions: FloatArray  # (t, n) of each tick
    desired: FloatArray | None  # (t, n) the captured motion's, beside it
    word: str  # over its head
    about: str  # in some sentences


News = WindowNews | MotionNews
