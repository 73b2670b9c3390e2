"""A node's end of a bus, whatever the bus is: ROS' middleware, or a process of its own.

All that leaves a node over a topic is `(Topic, bytes)`; a bus carries it. Classes that speak over
topics take a `BusNode`, and so run without ROS as well. Methods that `rclpy.node.Node` has bear its
names.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeVar

from msgs_config.messages.topic import Topic
from msgs_config.parameters import Parameter, Values, resolve
from msgs_config.settings import Settings

_Settings = TypeVar("_Settings", bound=Settings)


class Received(NamedTuple):
    """A serialised message as it came."""

    raw: bytes
    published_ns: int  # wall time
    number: int | None  # its publisher's count, from 1 on; None where the bus has none


class Publisher(Protocol):
    """Publishes serialised messages on one topic."""

    @property
    def topic_name(self) -> str:
        """The topic's absolute name."""

    def publish(self, raw: bytes) -> None:
        """Hand a message to every subscriber."""

    def get_subscription_count(self) -> int:
        """How many subscribe."""

    def is_acknowledged(self, seconds: float) -> bool:
        """Whether every subscriber has all that was published, within so long, which it waits."""


class Subscription(Protocol):
    """The serialised messages on one topic, which a loop takes one by one, oldest first."""

    def take(self) -> bytes | None:
        """The next message; None if there is none now."""

    def discard(self) -> None:
        """Take the messages that have come so far, and do nothing with them."""

    def close(self) -> None:
        """End the subscription; what was not taken is lost."""


class Log(Protocol):
    """Where a node's sentences go."""

    def info(self, message: str) -> object:
        """What a user may want to know."""

    def warning(self, message: str) -> object:
        """What a user should know."""

    def error(self, message: str) -> object:
        """What stops the node from doing what it is there for."""


@dataclass(frozen=True)
class Endpoint:
    """A publisher of a topic, as all nodes of a bus see it."""

    node: str  # full name; empty if it is not known yet
    identity: str  # differs between any two publishers
    type_name: str
    misfit: str = ""  # why a subscriber of the topic does not hear it, if its QoS does not fit


class Answer:
    """The answer to a call of a service, which may be given later."""

    def __init__(self, success: bool | None = None, message: str = "") -> None:
        """Without `success` it is given by `give`."""
        self.success, self.message = bool(success), message
        self.is_given = success is not None
        self._when_given: list[Callable[[], object]] = []

    def give(self, success: bool, message: str = "") -> None:
        """Give the answer."""
        self.success, self.message, self.is_given = success, message, True
        for act in self._when_given:
            act()

    def when_given(self, act: Callable[[], object]) -> None:
        """Do something as soon as it is given."""
        self._when_given.append(act)
        if self.is_given:
            act()


Handler = Callable[[bool], Answer]
"""What a service does; it is handed the request's flag, true where the request is empty."""
TypedHandler = Callable[[Any, Any], Answer]
"""Fills a service's response from its request; the response is sent when the answer is given."""


class Goal(Protocol):
    """A goal of an action."""

    @property
    def request(self) -> Any:
        """The goal's message."""

    @property
    def feedback(self) -> Any:
        """A message to be filled and published as feedback."""

    @property
    def result(self) -> Any:
        """The message to be filled before the goal's answer is given."""

    @property
    def is_cancelled(self) -> bool:
        """Whether its client no longer wants it."""

    def publish(self, feedback: Any) -> None:
        """Publish how far it is."""


GoalHandler = Callable[[Goal], Answer]
"""Pursues a goal; its answer says whether it has succeeded, and comes when it is over."""
Refusal = Callable[[dict[str, Any]], str]
"""Why changes of parameters, by name, cannot be; empty if they can."""
Change = Callable[[dict[str, Any]], None]
"""Takes changes of parameters, which can be."""


NO_SERVICES: Mapping[str, bool] = {}


class Client(Protocol):
    """Calls services of another node, and sets its parameters."""

    @property
    def is_ready(self) -> bool:
        """Whether the other node is there to be called."""

    def call(self, service: str, flag: bool = True) -> Answer:
        """Call `~/SERVICE` of the node, with the flag where it takes one."""

    def set_parameters(self, values: Mapping[str, Any]) -> Answer:
        """Set parameters of the node, all or none."""


class StopFlag(Protocol):
    """Becomes true when a loop is to end in good order."""

    def __bool__(self) -> bool:
        """Whether it is to end."""


class Executor(Protocol):
    """Gives what else the process has to do its turns."""

    def received(self) -> None:
        """Note that a message came: the next one is worth waiting for without resting."""

    def serve(self) -> None:
        """Answer calls of services if that is due, without waiting for anything."""

    def serve_pending(self) -> None:
        """Answer all calls of services that there are."""

    def rest(self) -> None:
        """Let others work for a moment, which may end when something comes."""

    def rest_for(self, seconds: float) -> None:
        """Let others work for a time that is known; ends early rather than late."""

    def close(self) -> None:
        """End it."""


class BusNode(Protocol):
    """A node's name, topics, services, parameters and log."""

    def get_name(self) -> str:
        """Its name in its namespace."""

    def get_namespace(self) -> str:
        """Its namespace, which begins with `/`."""

    def get_fully_qualified_name(self) -> str:
        """Its namespace and name."""

    def get_logger(self) -> Log:
        """Its log."""

    def resolve_topic_name(self, topic: str) -> str:
        """The absolute name of a topic as this node names it."""

    def name_fault(self, topic: str) -> str:
        """Why a topic cannot have this name; empty if it can."""

    def count_publishers(self, topic_name: str) -> int:
        """How many publish on a topic."""

    def endpoints(self, topic: Topic) -> list[Endpoint]:
        """All that publish on a topic."""

    def publisher(self, topic: Topic) -> Publisher:
        """A publisher on a topic of the contract."""

    def subscription(self, topic: Topic) -> Subscription:
        """A subscription of a topic of the contract."""

    def offer(self, service: str, handler: Handler, *, takes_flag: bool = False) -> None:
        """Offer `~/SERVICE`: a `SetBool` where it takes a flag, else a `Trigger`.

        Calls are handled between the turns of the node.
        """

    def offer_typed(self, service: str, type_name: str, handler: TypedHandler) -> None:
        """Offer `~/SERVICE` of a type, `PACKAGE/srv/TYPE`, whose package is installed."""

    def offer_action(self, action: str, type_name: str, handler: GoalHandler) -> None:
        """Offer the action `~/ACTION` of a type, `PACKAGE/action/TYPE`, likewise."""

    def client(self, node: str, services: Mapping[str, bool] = NO_SERVICES) -> Client:
        """A client of another node, by its name in this namespace.

        `services` says of each that will be called whether it takes a flag.
        """

    def given_parameters(self) -> dict[str, object]:
        """The values that a user has set for this node."""

    def declare(self, parameters: Iterable[Parameter], values: Values) -> None:
        """Declare parameters with their values, which who watches them may be told as a change."""

    def watch_parameters(self, refusal: Refusal, change: Change) -> None:
        """Let changes of parameters be refused before any is taken, and taken together."""

    def set_own_parameters(self, values: Mapping[str, Any]) -> None:
        """Change this node's own parameters, as if another node did."""

    def now_ns(self) -> int:
        """The time of the node's clock, ns: that of the wall, but for `use_sim_time`."""

    def make_executor(self, nodes: Sequence[Any]) -> Executor:
        """An executor for nodes of this node's bus, which share a thread."""

    def destroy_node(self) -> object:
        """Leave the bus."""


def declared_settings(node: BusNode, kind: type[_Settings]) -> _Settings:
    """A node's settings as a user has set them; declares their parameters, which are all it has.

    Raises:
        ConfigurationError: a value is wrong, or a name is none of the parameters'.
    """
    parameters = kind.declared()
    values = resolve(parameters, node.given_parameters())
    node.declare(parameters, values)
    return kind.of(values)
