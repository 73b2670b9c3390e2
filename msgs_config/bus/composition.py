"""Composition, as ROS 2 means it: several nodes in one process, here in one thread as well.

Each node works in turns, which it yields between. One loop gives the turns, to one node as to
several, so a node cannot tell whether it has its process to itself.
"""

import math
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

from msgs_config.bus.node import BusNode, Executor, StopFlag
from msgs_config.errors import ActuatedCharactersError

AT_ONCE = 0.0
"""Yielded by a node that has done something, and may have more to do."""
UNTIL_A_MESSAGE = math.inf
"""Yielded by a node that has nothing to do before something comes."""

Turns = Generator[float, None, None]


class ComposableNode:
    """What works at a node's place on a bus, and can share its thread with others."""

    def __init__(self, node: BusNode) -> None:
        """Work at this place on a bus."""
        self.node = node

    def destroy_node(self) -> None:
        """Leave the bus."""
        self.node.destroy_node()

    def turns(self, stop: StopFlag, executor: Executor) -> Turns:
        """Work until the end or until `stop`; each turn yields for how many s it needs no other.

        A node that is closed before its end leaves in good order, too. It gives the executor turns
        where it must, but leaves resting to the loop, which knows whether others have work.
        """
        raise NotImplementedError

    def run(self, stop: StopFlag) -> None:
        """Work until the end or until `stop`, alone in this thread; raises what `turns` raises."""
        run_nodes([self], stop)


def ros_node(name: str, **options: Any) -> BusNode:
    """A place on ROS' bus; `options` are rclpy's own of every node."""
    from msgs_config.bus.dds import DdsNode

    return DdsNode(name, **options)


class Composition:
    """Nodes that run as one: what ends one of them ends all, and an error names its node."""

    def __init__(self, nodes: Sequence[ComposableNode]) -> None:
        self._nodes = nodes

    def run(self, stop: StopFlag) -> None:
        """Let the nodes work until one ends or until `stop`; raises what one of them raises."""
        run_nodes(self._nodes, stop)

    def destroy_node(self) -> None:
        """Leave the graph."""
        destroy_nodes(self._nodes)


def destroy_nodes(nodes: Sequence[ComposableNode]) -> None:
    """Let nodes leave the graph, the last one first."""
    for node in reversed(nodes):
        node.destroy_node()


def run_nodes(nodes: Sequence[ComposableNode], stop: StopFlag) -> None:
    """Give each node its turn, one after the other, until one ends; then close the others.

    The thread rests only when no node has done anything in its last turn, and no longer than the
    most impatient one allows.
    """
    executor = nodes[0].node.make_executor([each.node for each in nodes])
    with ExitStack() as at_end:
        at_end.callback(executor.close)
        turns = [node.turns(stop, executor) for node in nodes]
        if len(nodes) > 1:
            turns = [_named(node, each) for node, each in zip(nodes, turns, strict=True)]
        for each in turns:
            at_end.callback(each.close)
        while (seconds := _take_turns(turns)) is not None:
            if seconds == UNTIL_A_MESSAGE:
                executor.rest()
            elif seconds > AT_ONCE:
                executor.rest_for(seconds)


@contextmanager
def errors_of(name: str) -> Iterator[None]:
    """Put a node's name before its errors, which may be those of any node of the process."""
    try:
        yield
    except ActuatedCharactersError as error:
        raise type(error)(f"{name}: {error}") from error


def _named(node: ComposableNode, turns: Turns) -> Turns:
    with errors_of(node.node.get_fully_qualified_name().lstrip("/")):
        yield from turns


def _take_turns(turns: Iterable[Turns]) -> float | None:
    """One turn of each; for how long none needs another, None when one has ended."""
    least = UNTIL_A_MESSAGE
    for each in turns:
        seconds = next(each, None)
        if seconds is None:
            return None
        least = min(least, seconds)
    return least
