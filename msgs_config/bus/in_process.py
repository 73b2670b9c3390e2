"""A bus of one process and one thread, without ROS: what is published is there at once, in order.

Nodes on it take turns (see `composition`). A service is handled, and parameters are set, within the
call: by a player's turn, or by whoever is handed a message while it is published.
"""

import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any

from msgs_config.bus.composition import errors_of
from msgs_config.bus.node import (
    NO_SERVICES,
    Answer,
    Change,
    Endpoint,
    GoalHandler,
    Handler,
    Refusal,
    TypedHandler,
)
from msgs_config.messages.topic import Topic
from msgs_config.parameters import Parameter, Values

_LONGEST_REST = 0.02  # s
_SLEEP_ERROR = 0.0002  # s by which a sleep may be late
_REST = 0.001  # s between looks at what wall time decides
_MOST_LATCHED = 100  # messages of one publisher

Deliver = Callable[[bytes], object]
Write = Callable[[str, str, str], object]
"""Is given a node's name, a severity (`info`, `warning` or `error`) and a sentence."""


def _print(name: str, severity: str, sentence: str) -> None:
    if severity != "info":
        print(f"{name}: {severity}: {sentence}", flush=True)


class Bus:
    """The nodes of one process, and the topics between them."""

    def __init__(self, write: Write = _print) -> None:
        """`write` is given what the nodes log."""
        self.write = write
        self._channels: dict[str, _Channel] = {}
        self._nodes: dict[str, InProcessNode] = {}

    def node(self, name: str, given: Mapping[str, object], namespace: str = "") -> "InProcessNode":
        """A place for a node, with the values of parameters that it is given."""
        node = InProcessNode(self, name, namespace, given)
        full_name = node.get_fully_qualified_name()
        assert full_name not in self._nodes, f"two nodes {full_name}"
        self._nodes[full_name] = node
        return node

    def find(self, name: str) -> "InProcessNode | None":
        """The node of a full name; None if there is none."""
        return self._nodes.get(name)

    def remove(self, node: "InProcessNode") -> None:
        """Forget a node."""
        self._nodes.pop(node.get_fully_qualified_name(), None)

    def channel(self, name: str) -> "_Channel":
        """The topic of an absolute name."""
        return self._channels.setdefault(name, _Channel())


class InProcessLog:
    """A node's log, which goes where its bus says."""

    def __init__(self, bus: Bus, name: str) -> None:
        self.info, self.warning, self.error = (
            partial(bus.write, name, severity) for severity in ("info", "warning", "error")
        )


class _Channel:
    """One topic: who publishes on it, and where messages go."""

    def __init__(self) -> None:
        self.publishers: list[InProcessPublisher] = []
        self.deliveries: list[Deliver] = []  # changed in place: publishers and subscribers share it

    def subscribe(self, deliver: Deliver) -> None:
        """Deliver what is latched, and from now on every message."""
        self.deliveries.append(deliver)
        for publisher in self.publishers:
            for raw in publisher.latched:
                deliver(raw)


class InProcessPublisher:
    """Publishes serialised messages on one topic of the process."""

    def __init__(self, channel: _Channel, topic: Topic, name: str, node: str) -> None:
        self.topic_name, self.node, self.type_name = name, node, topic.type_name
        depth = min(topic.quality.depth, _MOST_LATCHED) if topic.quality.is_latched else 0
        self.latched: deque[bytes] = deque(maxlen=depth)
        self._channel, self._deliveries = channel, channel.deliveries
        self.get_subscription_count = channel.deliveries.__len__
        channel.publishers.append(self)

    def publish(self, raw: bytes) -> None:
        """Hand a message to every subscriber."""
        for deliver in tuple(self._deliveries):  # who hears it may subscribe, or no longer
            deliver(raw)
        self.latched.append(raw)

    def close(self) -> None:
        """Offer the topic no more."""
        self._channel.publishers.remove(self)

    def is_acknowledged(self, seconds: float) -> bool:
        """Whether every subscriber has all that was published: always."""
        del seconds
        return True


class InProcessSubscription:
    """The serialised messages on one topic of the process, oldest first."""

    def __init__(self, channel: _Channel, topic: Topic, log: InProcessLog) -> None:
        self._pending: deque[bytes] = deque()
        self._name, self._log = topic.name, log
        self._most, self._has_dropped = topic.quality.depth, False
        self._deliveries = channel.deliveries
        channel.subscribe(self._deliver)

    def _deliver(self, raw: bytes) -> None:
        self._pending.append(raw)
        if len(self._pending) > self._most:
            self._pending.popleft()
            if self._most > 1 and not self._has_dropped:  # a depth of 1 keeps the newest alone
                self._has_dropped = True
                self._log.warning(
                    f"'{self._name}': more than {self._most} messages wait to be taken; the "
                    "oldest are dropped, which is logged once"
                )

    def take(self) -> bytes | None:
        """The next message; None if there is none now."""
        return self._pending.popleft() if self._pending else None

    def discard(self) -> None:
        """Take the messages that have come so far, and do nothing with them."""
        self._pending.clear()

    def close(self) -> None:
        """End the subscription; what was not taken is lost."""
        if self._deliver in self._deliveries:
            self._deliveries.remove(self._deliver)
        self._pending.clear()


class InProcessClient:
    """Calls services of another node of the process, and sets its parameters."""

    def __init__(self, bus: Bus, name: str) -> None:
        self._bus, self._name = bus, name

    @property
    def is_ready(self) -> bool:
        """Whether the other node is there."""
        return self._bus.find(self._name) is not None

    def call(self, service: str, flag: bool = True) -> Answer:
        """Call `~/SERVICE` of the node, with the flag where it takes one."""
        node = self._bus.find(self._name)
        handler = None if node is None else node.handlers.get(service)
        if handler is None:
            return Answer(False, f"{self._name} has no service {service}")
        with errors_of(self._name.lstrip("/")):
            return handler(flag)

    def set_parameters(self, values: Mapping[str, Any]) -> Answer:
        """Set parameters of the node, all or none."""
        node = self._bus.find(self._name)
        if node is None:
            return Answer(False, f"there is no node {self._name}")
        with errors_of(self._name.lstrip("/")):
            reason = node.try_parameters(values)
        return Answer(not reason, reason)


class InProcessExecutor:
    """Has nothing to serve: calls are handled at once."""

    def received(self) -> None:
        """Nothing is waited for."""

    serve = serve_pending = close = received

    def rest(self) -> None:
        """Let wall time pass: no message comes by itself, but a node may give up waiting."""
        time.sleep(_REST)

    def rest_for(self, seconds: float) -> None:
        """Let wall time pass; ends early rather than late."""
        time.sleep(max(min(seconds, _LONGEST_REST) - _SLEEP_ERROR, 0.0))


class InProcessNode:
    """A `BusNode` of a process' own bus."""

    def __init__(self, bus: Bus, name: str, namespace: str, given: Mapping[str, object]) -> None:
        self.handlers: dict[str, Handler] = {}  # by service
        self.typed_handlers: dict[str, TypedHandler] = {}
        self.goal_handlers: dict[str, GoalHandler] = {}
        self._bus, self._name = bus, name
        self._namespace = "/" + namespace.strip("/")
        self._log = InProcessLog(bus, self.get_fully_qualified_name().lstrip("/"))
        self._given = dict(given)
        self._declared: dict[str, Parameter] = {}
        self._refusal: Refusal = lambda changes: ""
        self._change: Change = lambda changes: None
        self._at_end = ExitStack()  # what the node has open on the bus

    def get_name(self) -> str:
        """Its name in its namespace."""
        return self._name

    def get_namespace(self) -> str:
        """Its namespace, which begins with `/`."""
        return self._namespace

    def get_fully_qualified_name(self) -> str:
        """Its namespace and name."""
        return f"{self._namespace.rstrip('/')}/{self._name}"

    def get_logger(self) -> InProcessLog:
        """Its log."""
        return self._log

    def resolve_topic_name(self, topic: str) -> str:
        """The absolute name of a topic as this node names it."""
        if topic.startswith("/"):
            return topic
        if topic.startswith("~"):
            return self.get_fully_qualified_name() + topic[1:]
        return f"{self._namespace.rstrip('/')}/{topic}"

    def name_fault(self, topic: str) -> str:
        """Why a topic cannot have this name: here any will do."""
        del topic
        return ""

    def count_publishers(self, topic_name: str) -> int:
        """How many publish on a topic."""
        return len(self._channel(topic_name).publishers)

    def endpoints(self, topic: Topic) -> list[Endpoint]:
        """All that publish on a topic."""
        found = self._channel(topic.name).publishers
        return [Endpoint(each.node, str(id(each)), each.type_name) for each in found]

    def publisher(self, topic: Topic) -> InProcessPublisher:
        """A publisher on a topic of the contract."""
        name = self.resolve_topic_name(topic.name)
        channel = self._bus.channel(name)
        publisher = InProcessPublisher(channel, topic, name, self.get_fully_qualified_name())
        self._at_end.callback(publisher.close)
        return publisher

    def subscription(self, topic: Topic) -> InProcessSubscription:
        """A subscription of a topic of the contract."""
        subscription = InProcessSubscription(self._channel(topic.name), topic, self._log)
        self._at_end.callback(subscription.close)
        return subscription

    def listen(self, topic: Topic, deliver: Deliver) -> None:
        """Have each message handed over while it is published, so in order over all topics."""
        channel = self._channel(topic.name)
        channel.subscribe(deliver)
        self._at_end.callback(channel.deliveries.remove, deliver)

    def offer(self, service: str, handler: Handler, *, takes_flag: bool = False) -> None:
        """Offer `~/SERVICE`."""
        del takes_flag  # a call without a flag hands over true
        self.handlers[service] = handler

    def offer_typed(self, service: str, type_name: str, handler: TypedHandler) -> None:
        """Offer `~/SERVICE`, which is called with any objects that have the type's fields."""
        del type_name
        self.typed_handlers[service] = handler

    def offer_action(self, action: str, type_name: str, handler: GoalHandler) -> None:
        """Offer the action `~/ACTION` likewise."""
        del type_name
        self.goal_handlers[action] = handler

    def client(self, node: str, services: Mapping[str, bool] = NO_SERVICES) -> InProcessClient:
        """A client of another node, by its name in this namespace."""
        del services  # the node itself knows its services
        return InProcessClient(self._bus, self.resolve_topic_name(node))

    def given_parameters(self) -> dict[str, object]:
        """The values that this node was given."""
        return dict(self._given)

    def declare(self, parameters: Iterable[Parameter], values: Values) -> None:
        """Declare parameters; their values are those of who declares them."""
        del values
        self._declared |= {each.name: each for each in parameters}

    def watch_parameters(self, refusal: Refusal, change: Change) -> None:
        """Let changes of parameters be refused before any is taken, and taken together."""
        self._refusal, self._change = refusal, change

    def try_parameters(self, values: Mapping[str, Any]) -> str:
        """Set parameters, all or none; why not, empty if they are set."""
        for name in values:
            if name not in self._declared:
                return f"parameter '{name}' is not declared"
            if not self._declared[name].when_changed:
                return f"parameter '{name}' cannot be changed"
            expected, found = type(self._declared[name].default), type(values[name])
            if found is not expected:  # DDS refuses it where one could stand for the other, too
                return f"parameter '{name}' is of type {found.__name__}, not {expected.__name__}"
        reason = self._refusal(dict(values))
        if not reason:
            self._change(dict(values))
        return reason

    def set_own_parameters(self, values: Mapping[str, Any]) -> None:
        """Change this node's own parameters, as if another node did."""
        self.try_parameters(values)

    def now_ns(self) -> int:
        """The wall time, ns."""
        return time.time_ns()

    def make_executor(self, nodes: Sequence[Any]) -> InProcessExecutor:
        """An executor for nodes of this bus."""
        del nodes
        return InProcessExecutor()

    def destroy_node(self) -> None:
        """Leave the bus: it hears and says nothing any more."""
        self._bus.remove(self)
        self._at_end.close()

    def _channel(self, name: str) -> _Channel:
        return self._bus.channel(self.resolve_topic_name(name))
