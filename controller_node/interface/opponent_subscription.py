"""Where another character of the world is at each state, as it comes over a topic."""

import time

import numpy as np

from controller_node.interface.simulators import Simulators
from msgs_config.arrays import FloatArray, all_finite
from msgs_config.bus.node import BusNode
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.character.layout import ROOT
from msgs_config.errors import ConfigurationError, MessageError
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateDecoder
from msgs_config.messages.topic import Topic

_AXES = tuple(f"{ROOT}_{axis}" for axis in "xyz")
_MOST_AT_ONCE = 1000  # messages; a flood of them must not keep the own states waiting
_EXPLAIN_AFTER = 2.0  # s of wall time
_MOST_KEPT = 5000  # ticks whose own states are yet to come, as many as the queue of states holds


def states_of(node: BusNode, opponent: str) -> Topic:
    """The topic of an opponent's states; raises ConfigurationError if there can be none."""
    world, _, own = node.get_namespace().rpartition("/")
    if not own or own == opponent:
        raise ConfigurationError(
            f"parameter 'opponent' is {opponent}: it must be another character of the world, "
            "and this node in the namespace of its own"
        )
    return topics.JOINT_STATES.under(f"{world}/{opponent}")


class OpponentSubscription:
    """Takes an opponent's `joint_states` of the bound simulator, and has its place at each state.

    The opponent's namespace lies beside the own one.
    """

    def __init__(
        self, node: BusNode, opponent: str, simulators: Simulators, logger: OnceLogger
    ) -> None:
        """Subscribe. Raises ConfigurationError if the node is in no character's namespace."""
        self.opponent, topic = opponent, states_of(node, opponent)
        self._inbox = node.subscription(topic)
        self._simulators, self._once_logger = simulators, logger
        self._name, self._decoder = topic.name, JointStateDecoder()
        self._places = dict[int, FloatArray]()  # by stamp
        self._waits_since: float | None = None

    def close(self) -> None:
        """End the subscription."""
        self._inbox.close()

    def restart(self) -> None:
        """Forget all: what comes from now on is another simulator's."""
        self._places.clear()

    def at(self, stamp_ns: int) -> FloatArray | None:
        """The place (3,) of the opponent's root at a stamp, m; None as long as it is yet to come.

        Stamps only increase; those before this one are discarded.
        """
        for _ in range(_MOST_AT_ONCE):
            raw = self._inbox.take()
            if raw is None:
                break
            self._keep(raw)
        for past in [stamp for stamp in self._places if stamp < stamp_ns]:
            del self._places[past]
        place = self._places.get(stamp_ns)
        if place is not None:
            self._waits_since = None
        elif self._waits_since is None:
            self._waits_since = time.monotonic()
        elif time.monotonic() > self._waits_since + _EXPLAIN_AFTER:
            self._once_logger.log_once(f"waiting for the opponent's states on '{self._name}'")
        return place

    def _keep(self, raw: bytes) -> None:
        try:
            state = self._decoder.decode(raw)
            if not self._simulators.is_own(self._name, state.frame_id):
                return
            entries = [state.names.index(axis) for axis in _AXES]
            place = np.array([state.position[entry] for entry in entries])
        except (MessageError, ValueError, IndexError) as error:
            self._once_logger.log_once(f"state on '{self._name}' ignored: {error}")
            return
        if not all_finite(place):
            self._once_logger.log_once(f"state on '{self._name}' ignored: it is not finite")
            return
        if state.stamp_ns < max(self._places, default=0):  # the simulator was started again
            self._places.clear()
        self._places[state.stamp_ns] = place
        if len(self._places) > _MOST_KEPT:
            del self._places[min(self._places)]
