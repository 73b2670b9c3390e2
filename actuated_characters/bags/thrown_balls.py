"""Which throw is which ball's: balls have an episode's numbers, of which a bag may have the last.

A bag that begins in the middle of an episode, or with a keyframe, has balls whose throws were
before.
"""

from dataclasses import dataclass
from itertools import pairwise

from actuated_characters.bags.recording import Recording
from msgs_config.messages.projectiles import ball_names
from msgs_config.messages.throw import ProjectileThrow


@dataclass(frozen=True)
class ThrownBall:
    """A ball whose throw was recorded."""

    name: str  # as it is in `BallStates`
    tick: int  # the one that it began with
    throw: ProjectileThrow


def thrown_balls(recording: Recording) -> dict[int, tuple[ThrownBall, ...]]:
    """The balls in the order in which they were thrown, by the first row of their episode."""
    if not recording.throws:
        return {}
    ends = [*recording.episode_rows.tolist(), len(recording.stamps_ns)]
    return {begin: _of_episode(recording, begin, end) for begin, end in pairwise(ends)}


def _of_episode(recording: Recording, begin: int, end: int) -> tuple[ThrownBall, ...]:
    """The balls that were thrown from one state to the one before another."""
    thrown = [
        (tick, throw)
        for tick, throws in enumerate(recording.throws[begin : end - 1], start=begin)
        for throw in throws
    ]
    earlier = _count_earlier(recording, begin, end)
    names = ball_names([throw for _, throw in thrown], earlier + 1)
    return tuple(ThrownBall(name, *each) for name, each in zip(names, thrown, strict=True))


def _count_earlier(recording: Recording, begin: int, end: int) -> int:
    """How many balls there are without a throw, by the first state that tells of balls."""
    for row, balls in enumerate(recording.balls[begin:end], start=begin):
        if balls is not None:
            known = sum(map(len, recording.throws[begin:row]))
            return max(len(balls.names) - known, 0)
    return 0
