"""The contacts that go with each state, as they come over a topic."""

import numpy as np

from controller_node.interface.simulators import Simulators
from msgs_config.arrays import FloatArray
from msgs_config.bus.node import BusNode
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.character.model import Character
from msgs_config.errors import MessageError
from msgs_config.messages import topics
from msgs_config.messages.cdr import read_frame_id
from msgs_config.messages.wrenches import decode_wrenches

_MAX_WRENCH = 1e9  # N and N m
_MOST_AT_ONCE = 1000  # messages; a flood of them must not keep the states waiting
_MOST_KEPT = 5000  # ticks whose states are yet to come, as many as the queue of states holds


class ContactSubscription:
    """Takes `contacts` of the bound simulator, and has those of each state ready."""

    def __init__(
        self, node: BusNode, character: Character, simulators: Simulators, logger: OnceLogger
    ) -> None:
        self._simulators = simulators
        self._inbox = node.subscription(topics.CONTACTS)
        self._rows = {link.name: row for row, link in enumerate(character.links)}
        self._once_logger = logger
        self._until_ns = -1  # stamp of the episode's last state whose contacts were handed out
        self._newest_ns = -1
        self._wrenches = dict[int, FloatArray]()  # by stamp

    def close(self) -> None:
        """End the subscription."""
        self._inbox.close()

    def begin(self) -> None:
        """An episode begins, whose stamps may be those of another simulator's episode before."""
        self._until_ns = -1

    def restart(self) -> None:
        """Forget all: what comes from now on is another simulator's."""
        self._wrenches.clear()
        self._until_ns = self._newest_ns = -1

    def until(self, stamp_ns: int, episode_ns: int) -> FloatArray | None:
        """Net wrenches (links, 6), N and N m, of all ticks since the last call up to a state.

        None as long as those of the state's own tick are yet to come. In lockstep they are of one
        tick, in real time of those as well whose states were left without an answer. What lies
        before the episode's first state does not count.
        """
        for _ in range(_MOST_AT_ONCE):
            raw = self._inbox.take()
            if raw is None:
                break
            self._keep(raw)
        if stamp_ns not in self._wrenches:
            return None
        wrenches = np.zeros((len(self._rows), 6))
        for stamp in sorted(stamp for stamp in self._wrenches if stamp <= stamp_ns):
            contacts = self._wrenches.pop(stamp)
            if stamp >= episode_ns:
                wrenches += contacts
        self._until_ns = stamp_ns
        return wrenches

    def _keep(self, raw: bytes) -> None:
        try:
            if not self._simulators.is_own(topics.CONTACTS.name, read_frame_id(raw)):
                return
            message = decode_wrenches(raw)
        except MessageError as error:
            self._once_logger.log_once(f"contacts ignored: {error}")
            return
        if message.stamp_ns < self._newest_ns:  # the simulator was started again
            self._wrenches.clear()
            self._until_ns = -1
        self._newest_ns = message.stamp_ns
        if message.stamp_ns <= self._until_ns:
            return
        wrenches = np.zeros((len(self._rows), 6))
        fits = len(message.wrenches) == len(message.links)
        if fits and (np.abs(message.wrenches) <= _MAX_WRENCH).all():  # NaN is not within
            for link, wrench in zip(message.links, message.wrenches, strict=True):
                if link in self._rows:
                    wrenches[self._rows[link]] += wrench
        else:
            self._once_logger.log_once(
                f"contacts ignored: not one wrench a link, of {_MAX_WRENCH:g} N and N m at most"
            )
        self._wrenches[message.stamp_ns] = wrenches
        if len(self._wrenches) > _MOST_KEPT:
            oldest = next(iter(self._wrenches))  # the first: stamps that go back clear all
            del self._wrenches[oldest]
            self._once_logger.log_once(
                f"contacts of more than {_MOST_KEPT} ticks wait for their states; the oldest are "
                "dropped",
                kind="contacts that wait",
            )
