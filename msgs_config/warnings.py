"""Warnings that are said once, though their cause may come again at every tick."""

from rclpy.node import Node

_MOST_SAID = 100  # different ones, lest a hostile sender fill the memory and the log


class Warnings:
    """A node's warnings, each sentence once."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._said: set[str] = set()

    def say_once(self, sentence: str) -> None:
        """Log a sentence, unless it was logged before."""
        if sentence not in self._said and len(self._said) < _MOST_SAID:
            self._said.add(sentence)
            self._node.get_logger().warning(sentence)
