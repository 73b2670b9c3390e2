"""A node on ROS' own bus, the middleware: a node of rclpy with the ways of a `BusNode`."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import rclpy
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.client import Client as RosClient
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.validate_topic_name import validate_topic_name
from std_srvs.srv import SetBool, Trigger

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
from msgs_config.bus.polling import DirectSubscription, PollingExecutor
from msgs_config.bus.ros_parameters import declare, given_parameters, plain_value, set_request
from msgs_config.errors import ConfigurationError
from msgs_config.messages.topic import Topic, find_message_class
from msgs_config.parameters import Parameter, Values

_UNKNOWN_NODE = "_UNKNOWN_"  # ROS says this of a node whose name has not come yet


def own_context(*arguments: str) -> Context:
    """A context of ROS beside any other of this process, started with arguments for ROS.

    Raises:
        ConfigurationError: ROS does not start.
    """
    context, options = Context(), SignalHandlerOptions.NO
    try:
        rclpy.init(args=["--ros-args", *arguments], context=context, signal_handler_options=options)
    except RuntimeError as error:
        raise ConfigurationError(f"ROS does not start: {' '.join(str(error).split())}") from error
    return context


def create_publisher(node: Node, topic: Topic) -> "DdsPublisher":
    """A publisher of any node of rclpy on a topic of the contract."""
    return DdsPublisher(node, topic)


class DdsPublisher:
    """A publisher of the middleware, of serialised messages."""

    def __init__(self, node: Node, topic: Topic) -> None:
        """Offer a topic of the contract."""
        self._publisher = node.create_publisher(
            topic.message_type,
            topic.name,
            topic.qos,
            # Each default callback is one thing more that the executor looks at in each turn.
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
        )
        # Called at every tick, so without rclpy's guard of the handle, which none else destroys.
        self.publish = self._publisher.handle.publish_raw
        self.get_subscription_count = self._publisher.handle.get_subscription_count

    @property
    def topic_name(self) -> str:
        """The topic's absolute name."""
        return str(self._publisher.topic_name)

    def is_acknowledged(self, seconds: float) -> bool:
        """Wait until every subscriber has all that was published, at most so long; whether so."""
        return bool(self._publisher.wait_for_all_acked(Duration(seconds=seconds)))


class DdsClient:
    """Calls services of another node, and sets its parameters."""

    def __init__(self, node: Node, name: str, services: Mapping[str, bool]) -> None:
        self._setter = node.create_client(
            SetParametersAtomically, f"{name}/set_parameters_atomically"
        )
        self._takes_flag = services
        self._services: dict[str, RosClient] = {
            service: node.create_client(SetBool if takes_flag else Trigger, f"{name}/{service}")
            for service, takes_flag in services.items()
        }

    @property
    def is_ready(self) -> bool:
        """Whether the other node answers."""
        return all(each.service_is_ready() for each in (self._setter, *self._services.values()))

    def call(self, service: str, flag: bool = True) -> Answer:
        """Call `~/SERVICE` of the node, with the flag where it takes one."""
        takes_flag, answer = self._takes_flag[service], Answer()
        request = SetBool.Request(data=flag) if takes_flag else Trigger.Request()
        future = self._services[service].call_async(request)
        future.add_done_callback(
            lambda done: answer.give(done.result().success, done.result().message)
        )
        return answer

    def set_parameters(self, values: Mapping[str, Any]) -> Answer:
        """Set parameters of the node, all or none."""
        answer = Answer()

        def give(done: Future) -> None:
            result = done.result().result
            answer.give(result.successful, result.reason)

        self._setter.call_async(set_request(values)).add_done_callback(give)
        return answer


class DdsGoal:
    """A goal of an action, as rclpy hands it over."""

    def __init__(self, handle: Any, kind: Any) -> None:
        self.request, self.result = handle.request, kind.Result()
        self._handle, self._kind = handle, kind

    @property
    def feedback(self) -> Any:
        """A message to be filled and published as feedback."""
        return self._kind.Feedback()

    @property
    def is_cancelled(self) -> bool:
        """Whether its client no longer wants it."""
        return bool(self._handle.is_cancel_requested)

    def publish(self, feedback: Any) -> None:
        """Publish how far it is."""
        self._handle.publish_feedback(feedback)


async def _given(answer: Answer) -> None:
    """Wait until an answer is given."""
    if not answer.is_given:
        given = Future()
        answer.when_given(lambda: given.set_result(None))
        await given


class DdsNode(Node):
    """A node of rclpy that is a `BusNode`."""

    def publisher(self, topic: Topic) -> DdsPublisher:
        """A publisher on a topic of the contract."""
        return DdsPublisher(self, topic)

    def subscription(self, topic: Topic) -> DirectSubscription:
        """A subscription of a topic of the contract."""
        return DirectSubscription(self, topic)

    def name_fault(self, topic: str) -> str:
        """Why a topic cannot have this name; empty if it can."""
        try:
            validate_topic_name(topic)
        except InvalidTopicNameException as error:
            return str(error).removeprefix("Invalid topic name: ").partition(":\n")[0]
        return ""

    def endpoints(self, topic: Topic) -> list[Endpoint]:
        """All that publish on a topic."""
        found = []
        for info in self.get_publishers_info_by_topic(topic.name):
            name = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            # Written as by `ros2 topic info -v`.
            gid = ".".join(f"{byte:02x}" for byte in info.endpoint_gid)
            compatibility, reason = qos_check_compatible(info.qos_profile, topic.qos)
            misfit = reason.strip() if compatibility == QoSCompatibility.ERROR else ""
            name = "" if _UNKNOWN_NODE in name else name
            found.append(Endpoint(name, gid, info.topic_type, misfit))
        return found

    def offer(self, service: str, handler: Handler, *, takes_flag: bool = False) -> None:
        """Offer `~/SERVICE`: a `SetBool` where it takes a flag, else a `Trigger`.

        Calls are handled between the turns of the node.
        """

        def fill(request: Any, response: Any) -> Answer:
            answer = handler(request.data if takes_flag else True)

            def write() -> None:
                response.success, response.message = answer.success, answer.message

            answer.when_given(write)
            return answer

        self._serve(service, SetBool if takes_flag else Trigger, fill)

    def offer_typed(self, service: str, type_name: str, handler: TypedHandler) -> None:
        """Offer `~/SERVICE` of a type, `PACKAGE/srv/TYPE`, whose package is installed."""
        self._serve(service, find_message_class(type_name), handler)

    def _serve(self, service: str, kind: Any, handler: TypedHandler) -> None:
        async def respond(request: Any, response: Any) -> Any:
            await _given(handler(request, response))
            return response

        # In a group of its own: in the node's an awaited answer would keep all others waiting.
        group = ReentrantCallbackGroup()
        self.create_service(kind, f"~/{service}", respond, callback_group=group)

    def offer_action(self, action: str, type_name: str, handler: GoalHandler) -> None:
        """Offer the action `~/ACTION` of a type, `PACKAGE/action/TYPE`, likewise."""
        from rclpy.action import ActionServer, CancelResponse

        kind = find_message_class(type_name)

        async def pursue(handle: Any) -> Any:
            goal = DdsGoal(handle, kind)
            answer = handler(goal)
            await _given(answer)
            if goal.is_cancelled:
                handle.canceled()
            elif answer.success:
                handle.succeed()
            else:
                handle.abort()
            return goal.result

        ActionServer(
            self,
            kind,
            f"~/{action}",
            pursue,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )

    def client(self, node: str, services: Mapping[str, bool] = NO_SERVICES) -> DdsClient:
        """A client of another node, by its name in this namespace."""
        return DdsClient(self, node, services)

    def given_parameters(self) -> dict[str, object]:
        """The values that command line and parameter files set for this node."""
        return given_parameters(self)

    def declare(self, parameters: Iterable[Parameter], values: Values) -> None:
        """Declare parameters with their values."""
        declare(self, parameters, values)

    def watch_parameters(self, refusal: Refusal, change: Change) -> None:
        """Let changes of parameters be refused before any is taken, and taken together."""

        def check(changes: list[RosParameter]) -> SetParametersResult:
            reason = refusal(_by_name(changes))
            return SetParametersResult(successful=not reason, reason=reason)

        self.add_on_set_parameters_callback(check)
        self.add_post_set_parameters_callback(lambda changes: change(_by_name(changes)))

    def set_own_parameters(self, values: Mapping[str, Any]) -> None:
        """Change this node's own parameters, as if another node did."""
        self.set_parameters_atomically([RosParameter(n, value=v) for n, v in values.items()])

    def make_executor(self, nodes: Sequence[Node]) -> PollingExecutor:
        """An executor for nodes of rclpy, which share a thread."""
        return PollingExecutor(*nodes)

    def now_ns(self) -> int:
        """The time of the node's clock, ns."""
        return int(self.get_clock().now().nanoseconds)


def _by_name(changes: Iterable[RosParameter]) -> dict[str, Any]:
    return {change.name: plain_value(change) for change in changes}
