"""Sampling-based motion control whose samples plan ahead: window by window, the best worlds stay.

Some worlds go on from the states that were kept, each with different plans. After a window the
best of them are kept, by what the last windows cost and by what going on as planned will cost, and
the others go on from these.

Source: Liu, Yin, van de Panne, Shao and Xu 2010, "Sampling-based Contact-rich Motion Control"
(windows, samples, survivors). There a sample is an offset drawn at random; here it is a plan.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from actuated_characters.reconstruction.tree import Node
from actuated_characters.reconstruction.world import Branch, Grown, Lost
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError, SimulationError

_WINDOWS_IN_COST = 4  # windows whose costs count beside what is ahead
_MAX_WINDOWS_BACK = 16  # windows that a search goes back at the most
_WINDOWS_KEPT = _MAX_WINDOWS_BACK + 1  # windows of which places are kept
_MAX_WORLDS, _MAX_FAILURES = 2**10, 2**10  # bounds by which each world has seeds of its own
_MAX_SEED = 2**32


@dataclass(frozen=True)
class SearchSettings:
    """A search's settings: the same ones give the same result on any number of processes."""

    worlds: int = 8
    survivors: int = 2  # worlds that are kept after each window
    window: float = 0.1  # s
    seed: int = 1
    tries: int = 4  # failures without getting any further, going back further each time

    def check(self) -> None:
        """Raise ConfigurationError where a number cannot be used."""
        for name, value, least, most in (
            ("worlds", self.worlds, 1, _MAX_WORLDS),
            ("kept", self.survivors, 1, self.worlds),
            ("window", self.window, 0.01, 10.0),
            ("seed", self.seed, 0, _MAX_SEED),
        ):
            if not least <= value <= most:
                raise ConfigurationError(f"--{name} is {value:g}; it must be {least:g} to {most:g}")

    def content(self) -> dict[str, Any]:
        """The settings as JSON has them, by the names of their options."""
        return {
            "worlds": self.worlds,
            "kept": self.survivors,
            "window": self.window,
            "seed": self.seed,
            "tries": self.tries,
        }


@dataclass(frozen=True)
class Tried:
    """One of a window's worlds, and what has become of it."""

    parent: Node | None  # None: it began in the first state
    motion: FloatArray  # (k + 1, n) positions in the window, from the state that it began in on
    node: Node | None  # None: it is lost
    rank: int | None  # 0 is the best of those that are kept; None: it is not kept


@dataclass
class Progress:
    """Where a search is; all that it needs to go on, beside its problem and settings."""

    levels: list[list[Node]]  # the nodes that were kept of each window
    failures: int = 0  # windows in which all worlds were lost
    stuck: int = 0  # those failures since the furthest window was reached
    best: Node | None = None  # the best node of the furthest window that was reached
    tried: tuple[Tried, ...] = ()  # the worlds of the window before, to be looked at

    @property
    def window(self) -> int:
        """The window that comes next."""
        return len(self.levels)


class Worlds(Protocol):
    """Grow branches."""

    def grow(self, branches: Sequence[Branch]) -> Iterator[Grown | Lost]:
        """What becomes of branches, in their order."""


def search(
    worlds: Worlds,
    windows: int,
    settings: SearchSettings,
    progress: Progress,
    report: Callable[[Progress], None],
) -> int | None:
    """Go on to the last window; returns None, or the number of a window where it is stuck.

    Where all worlds are lost it goes back, twice as far each time (at most 16 windows) until it
    gets further than ever: a world that falls has long been beyond recovery by then.

    Raises:
        SimulationError: what was found before is not repeated.
        ActuatedCharactersError: a process failed.
    """
    while progress.window < windows:
        furthest = 0 if progress.best is None else len(progress.best.path)
        progress.tried = _next_window(worlds, settings, progress)
        nodes = kept_nodes(progress.tried)
        if nodes:
            progress.levels.append(nodes)
            if progress.window > furthest:
                progress.stuck = 0
            if progress.window >= furthest:
                progress.best = nodes[0]
            for node in [node for level in progress.levels[:-_WINDOWS_KEPT] for node in level]:
                node.place = None
        else:
            failed = progress.window
            progress.failures += 1
            progress.stuck += 1
            del progress.levels[max(failed - min(2**progress.stuck, _MAX_WINDOWS_BACK), 0) :]
            if progress.stuck >= settings.tries:
                progress.stuck = 0  # a resumed search tries again
                report(progress)
                return failed
        report(progress)
    return None


def kept_nodes(worlds: Sequence[Tried]) -> list[Node]:
    """The nodes that are kept of a window, the best first; none if all its worlds are lost."""
    ranked = {each.rank: each.node for each in worlds if each.node is not None}
    return [ranked[rank] for rank in sorted(rank for rank in ranked if rank is not None)]


def result(progress: Progress) -> Node | None:
    """The best path that was found, to the last level or to the furthest window that was reached.

    Of the last level it is that of the least mean cost; None where even the first window failed.
    """
    if progress.best is None or len(progress.best.path) > progress.window:
        return progress.best
    return min(progress.levels[-1], key=lambda node: float(np.mean([n.cost for n in node.path])))


def _next_window(worlds: Worlds, settings: SearchSettings, progress: Progress) -> tuple[Tried, ...]:
    """What becomes of the next window's worlds; the best of those that are not lost are kept."""
    parents: list[Node | None] = list(progress.levels[-1]) if progress.levels else [None]
    _come_again(worlds, [node for node in parents if node is not None and node.place is None])
    count = settings.worlds
    owners = [parents[index * len(parents) // count] for index in range(count)]
    seeds = [_seed(settings, progress, index) for index in range(count)]
    branches = [
        Branch(None if parent is None else parent.place, (seed,))
        for parent, seed in zip(owners, seeds, strict=True)
    ]
    all_grown = list(worlds.grow(branches))
    nodes = [
        None if isinstance(grown, Lost) else _node(parent, seed, grown)
        for parent, seed, grown in zip(owners, seeds, all_grown, strict=True)
    ]
    alive = [node for node in nodes if node is not None]
    kept = sorted(alive, key=value)[: settings.survivors]  # equal nodes stay in their order
    ranks = {id(node): rank for rank, node in enumerate(kept)}
    return tuple(
        Tried(parent, grown.motion, node, ranks.get(id(node)))
        for parent, grown, node in zip(owners, all_grown, nodes, strict=True)
    )


def _come_again(worlds: Worlds, nodes: Sequence[Node]) -> None:
    """Have places of nodes, after a search was resumed."""
    for node, grown in zip(nodes, worlds.grow([node.again() for node in nodes]), strict=True):
        if isinstance(grown, Lost) or grown.end.tobytes() != node.end.tobytes():
            raise SimulationError(
                "what the checkpoint says is not repeated; it is of another version or machine"
            )
        node.place = grown.place


def value(node: Node) -> float:
    """What decides who is kept: the costs of a node's last windows, and of what is ahead."""
    recent = [each.cost for each in node.path[-_WINDOWS_IN_COST:]]
    return float(np.mean(recent)) + node.ahead


def _seed(settings: SearchSettings, progress: Progress, world: int) -> int:
    return (settings.seed * _MAX_FAILURES + progress.failures) * _MAX_WORLDS + world


def _node(parent: Node | None, seed: int, grown: Grown) -> Node:
    place = grown.place
    numbers = grown.cost, grown.ahead
    return Node(parent, place.tick, seed, grown.plans, grown.end, *numbers, grown.motion, place)
