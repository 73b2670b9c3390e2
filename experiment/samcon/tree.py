"""The tree of what was kept: each node is a window's offset, and leads back to the first state."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from experiment.samcon.rollout import Branch
from msgs_config.arrays import FloatArray
from sim_node.simulation import Snapshot


@dataclass(eq=False)
class Node:
    """A kept state: the one at the end of a window with an offset, from its parent on."""

    parent: "Node | None"  # None of the first state
    offset: FloatArray  # (n,), zeros of the first state
    cost: float = 0.0  # of this window
    end: FloatArray = field(default_factory=lambda: np.zeros(0))  # (f,) features of the state
    snapshot: Snapshot | None = None  # of the state, once somebody has been there

    @property
    def path(self) -> "list[Node]":
        """The nodes from the first window's to this one."""
        nodes: list[Node] = []
        node = self
        while node.parent is not None:
            nodes.append(node)
            node = node.parent
        return nodes[::-1]

    @property
    def offsets(self) -> FloatArray:
        """The offsets (w, n) of all windows up to this node's."""
        return np.array([node.offset for node in self.path]).reshape(-1, len(self.offset))

    def branch(self, samples: FloatArray, lookahead: int = 0) -> Branch:
        """What a process needs to try samples (s, n) from this state, and to look ahead."""
        path = self.path
        known = max(
            (index + 1 for index, node in enumerate(path) if node.snapshot is not None), default=0
        )
        nothing = np.zeros_like(self.offset)
        return Branch(
            snapshot=path[known - 1].snapshot if known else None,
            start=known,
            path=self.offsets[known:],
            before=path[known - 1].offset if known else nothing,
            samples=samples,
            lookahead=lookahead,
        )


def chosen(costs: FloatArray, kept: int, good: float) -> list[int]:
    """Which samples (s,) to keep, the best one first: many good ones, and a few of the others.

    From the best share `good` of those that are not lost, at ranks that grow with a power: Liu et
    al. 2010, section 4.3. Equal costs rank by their index.
    """
    order = np.argsort(costs, kind="stable")
    sound = order[: int(np.isfinite(costs).sum())]
    count = min(max(int(np.ceil(good * len(sound))), min(kept, len(sound))), len(sound))
    shares = np.linspace(0.0, 1.0, min(kept, count))
    ranks = np.maximum(np.round((count - 1) * shares**_POWER).astype(int), np.arange(len(shares)))
    return [int(sound[rank]) for rank in ranks]


def prune(levels: Sequence[Sequence[Node]], reach: int) -> None:
    """Forget the snapshots of the levels that are more than `reach` windows back."""
    for level in levels[: max(len(levels) - reach, 0)]:
        for node in level:
            node.snapshot = None


_POWER = 3.0
