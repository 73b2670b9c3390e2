"""Warnings that are said once, though their cause may come again at every tick."""

from rclpy.node import Node

_MOST_SAID = 100  # different ones, lest a hostile sender fill the memory and the log
_LONGEST = 1000  # characters of a sentence, which may quote what was received


class Warnings:
    """A node's warnings, each sentence once."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._said: set[str] = set()

    def say_once(self, sentence: str, kind: str = "") -> None:
        """Log a sentence, unless it, or another one of its kind, was logged before."""
        if len(sentence) > _LONGEST:
            sentence = sentence[:_LONGEST] + " ..."
        if not self.has_said(kind or sentence):
            self._said.add(kind or sentence)
            self._node.get_logger().warning(sentence)

    def has_said(self, kind: str) -> bool:
        """Whether a sentence of a kind was logged, or so many that no more are."""
        return kind in self._said or len(self._said) >= _MOST_SAID
