"""The contacts that go with each state, as they come over a topic."""

import numpy as np
from rclpy.node import Node

from msgs_config import topics
from msgs_config.arrays import FloatArray
from msgs_config.character import Character
from msgs_config.errors import MessageError
from msgs_config.polling import DirectSubscription
from msgs_config.warnings import Warnings
from msgs_config.wrench_messages import decode_wrenches


class ContactInbox:
    """Takes `contacts`, and has those of each state ready."""

    def __init__(self, node: Node, character: Character, warnings: Warnings) -> None:
        self._inbox = DirectSubscription(node, topics.CONTACTS)
        self._rows = {link.name: row for row, link in enumerate(character.links)}
        self._warnings = warnings
        self._until_ns = -1  # of the last state that has had its contacts
        self._newest_ns = -1
        self._kept = dict[int, FloatArray]()  # by stamp

    def until(self, stamp_ns: int) -> FloatArray | None:
        """Net wrenches (links, 6), N and N m, of all ticks since the last call up to a state.

        None as long as those of the state's own tick are yet to come. In lockstep they are of one
        tick, in real time of those as well whose states were left without an answer.
        """
        while (raw := self._inbox.take()) is not None:
            self._keep(raw)
        if self._newest_ns < stamp_ns:
            return None
        wrenches = np.zeros((len(self._rows), 6))
        for stamp in sorted(stamp for stamp in self._kept if stamp <= stamp_ns):
            wrenches += self._kept.pop(stamp)
        self._until_ns = stamp_ns
        return wrenches

    def _keep(self, raw: bytes) -> None:
        try:
            message = decode_wrenches(raw)
        except MessageError as error:
            self._warnings.say_once(f"contacts ignored: {error}")
            return
        self._newest_ns = max(self._newest_ns, message.stamp_ns)
        if message.stamp_ns <= self._until_ns:
            return
        wrenches = np.zeros((len(self._rows), 6))
        if len(message.wrenches) == len(message.links) and np.isfinite(message.wrenches).all():
            for link, wrench in zip(message.links, message.wrenches, strict=True):
                if link in self._rows:
                    wrenches[self._rows[link]] += wrench
        else:
            self._warnings.say_once("contacts ignored: not one finite wrench a link")
        self._kept[message.stamp_ns] = wrenches
