"""The tree of what was kept: each node is a window of a world, from the one before it on."""

from dataclasses import dataclass

from actuated_characters.reconstruction.world import Branch, Place
from controller_node.references.offsets import Offsets
from msgs_config.arrays import FloatArray


@dataclass(eq=False)
class Node:
    """A world at the end of a window, from its parent on."""

    parent: "Node | None"  # None: it began in the first state
    tick: int  # the tick at its end, counted from the first state
    seed: int  # seed of the samples of its plans
    plans: tuple[tuple[int, Offsets], ...]  # plans made in it, each with the tick when it begins
    end: FloatArray  # (2 n,) position and velocity
    cost: float  # mean cost of the states of its window
    ahead: float  # cost of going on as planned
    motion: FloatArray  # (k + 1, n) positions, from its parent's end on; resumed, its end alone
    place: Place | None = None  # other worlds can go on from it as long as it is kept

    @property
    def path(self) -> "list[Node]":
        """The nodes from the first window's to this one."""
        nodes = [self]
        while nodes[-1].parent is not None:
            nodes.append(nodes[-1].parent)
        return nodes[::-1]

    def again(self) -> Branch:
        """What a world needs to come here once more, from the last place before that is kept."""
        seeds, node = [self.seed], self.parent
        while node is not None and node.place is None:
            seeds.append(node.seed)
            node = node.parent
        return Branch(None if node is None else node.place, tuple(seeds[::-1]))
