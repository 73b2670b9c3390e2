"""The tree of what was kept: each node is a window of a world, from the one before it on."""

from dataclasses import dataclass

from controller_node.planner.offsets import Offsets
from experiment.reconstruction.world import Branch, Place
from msgs_config.arrays import FloatArray


@dataclass(eq=False)
class Node:
    """A world at the end of a window, from its parent on."""

    parent: "Node | None"  # None: it began in the first state
    tick: int  # at its end, since the first state
    seed: int  # of the samples of its plans
    plans: tuple[tuple[int, Offsets], ...]  # that were made in it, by the tick at which they begin
    end: FloatArray  # (2 n,) position and velocity
    cost: float  # of the window
    ahead: float  # of going on as planned
    place: Place | None = None  # as long as it is kept

    @property
    def path(self) -> "list[Node]":
        """The nodes from the first window's to this one."""
        nodes = [self]
        while nodes[-1].parent is not None:
            nodes.append(nodes[-1].parent)
        return nodes[::-1]

    def branch(self, seed: int) -> Branch:
        """What a world needs to go on from here; where no place is kept, from one before."""
        seeds, node = [seed], self
        while node.place is None:
            seeds.append(node.seed)
            if node.parent is None:
                return Branch(None, tuple(seeds[::-1]))
            node = node.parent
        return Branch(node.place, tuple(seeds[::-1]))
