"""Walks that are pushed, each at random moments and from random sides."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

CYCLE = 1.27  # s, of the walk


@dataclass(frozen=True)
class Kind:
    """How walks are pushed."""

    forwards: float = 0.0  # N s
    sideways: float | None = None  # N s; None: as hard from any side
    hardest: float | None = None  # N s, up to which pushes differ; None: all are as hard
    pushes: int = 1
    every: float = 2.0  # s
    lasts: float = 0.2  # s that each push lasts
    balls: bool = False  # balls at the chest; the clip's heading is forwards
    stands: bool = False  # instead of walking
    duration: float = 8.5  # s
    behaviour: str = "tracking"


KINDS = {
    "none": Kind(pushes=0, duration=20.0),
    "10 N s every 2 s": Kind(10.0, pushes=9, lasts=0.1, duration=20.0),
    "20 N s every 2 s": Kind(20.0, pushes=9, lasts=0.1, duration=20.0),
    "48 or 60 N s": Kind(48.0, 60.0),
    "77 or 96 N s": Kind(77.0, 96.0),
    "balls": Kind(20.0, pushes=5, every=4.0, duration=20.0, balls=True),
    "standing": Kind(12.0, pushes=11, every=5.0, lasts=0.1, duration=60.0, stands=True),
    "any": Kind(40.0, hardest=240.0, duration=5.5),
    "fall": Kind(300.0, duration=16.0, behaviour="active_ragdoll"),
}


@dataclass(frozen=True)
class Impulse:
    """A push at the root's centre of mass."""

    time: float  # s
    impulse: tuple[float, float]  # N s, forwards and to the left


@dataclass(frozen=True)
class Walk:
    """A walk, and what comes to it."""

    kind: str
    seed: int
    pushes: tuple[Impulse, ...]
    settings: tuple[str, ...]


def walks(name: str, count: int, settings: tuple[str, ...]) -> list[Walk]:
    """The walks of a kind, each with other pushes and another seed."""
    return [
        Walk(name, 1 + number, tuple(_pushes(name, number)), settings) for number in range(count)
    ]


def _pushes(name: str, number: int) -> Iterator[Impulse]:
    kind, draws = KINDS[name], np.random.default_rng((number, len(name)))
    for push in range(kind.pushes):
        time = kind.every * push + 1.0 + draws.uniform(0.0, CYCLE)
        side = draws.uniform(-math.pi, math.pi)
        if kind.sideways is None:
            size = draws.uniform(kind.forwards, kind.hardest) if kind.hardest else kind.forwards
            impulse = size * math.cos(side), size * math.sin(side)
        else:
            sideways = math.copysign(kind.sideways, side)
            impulse = (kind.forwards, 0.0) if number % 2 else (0.0, sideways)
        yield Impulse(float(time), impulse)
