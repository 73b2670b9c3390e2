"""Waiting for messages with the least delay, while services and parameters stay alive.

An executor's way from a message to its callback costs more than the rest of a lockstep tick. So a
loop takes the one message that it waits for directly from the subscription, and lets the executor
have a turn every now and then. Between tries it gives the processor away; after some it blocks
until the middleware has a message. When nothing comes for a while the loop blocks in the executor,
and an idle node costs nothing.
"""

import math
import os
import time
from collections import deque

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ShutdownException, SingleThreadedExecutor, TimeoutException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

from msgs_config.bus.endpoint_types import EndpointTypes
from msgs_config.bus.node import Received
from msgs_config.messages.topic import Topic

_SERVICE_PERIOD = 0.02  # s between turns of the executor in a busy loop
_SHORT_REST = 0.002  # s; waking up from the executor takes up to that
_SLEEP_ERROR = 0.0002  # s by which a sleep may be late
_MOST_TURNS = 50  # turns of the executor in a row, with one callback each
_MOST_DISCARDED = 20_000  # messages, more than can wait
_BUSY_PERIOD = 0.1  # s without a message before the loop blocks in the executor
_LONGEST_SPIN = 0.0005  # s of tries before a wait blocks: longer than most ticks take
_LEAST_SHARE = 0.5  # of the processor, below which others need it more than the tries do
_MOST_WITHOUT = 63  # waits in a row without tries, after which they may pay again
_NS_PER_S = 10**9
_MATCHED = rclpy_implementation.rcl_subscription_event_type_t.RCL_SUBSCRIPTION_MATCHED


class DirectSubscription:
    """A subscription whose serialised messages a loop takes one by one, oldest first."""

    def __init__(
        self, node: Node, topic: Topic, events: SubscriptionEventCallbacks | None = None
    ) -> None:
        """Subscribe; with `events` also to the middleware's events of the subscription."""
        # As many messages as the middleware keeps, and like there the newest ones: a flood must not
        # fill the memory.
        self._pending: deque[Received] = deque(maxlen=topic.quality.depth)
        self.dropped = 0  # messages, as more came than were taken
        self._node = node
        self._message_type = topic.message_type
        # When the loop blocks in the executor, it is the executor that takes the message. It
        # hands a callback of two arguments the message's info too, which rclpy's types leave out.
        self._subscription = node.create_subscription(
            topic.message_type,
            topic.name,
            self._keep,  # type: ignore[arg-type]
            topic.qos,
            raw=True,
            # Without default callbacks, for each of which the executor would look in each turn.
            event_callbacks=events or SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        # Without rclpy's guard against another thread that destroys the handle: there is none.
        self._take_message = self._subscription.handle.take_message

    def _keep(self, raw: bytes, info: dict[str, int]) -> None:
        most = self._pending.maxlen
        if most == len(self._pending) and most > 1:  # with a depth of 1 only the newest is wanted
            if not self.dropped:
                self._node.get_logger().warning(
                    f"'{self._subscription.topic_name}': more than {most} messages wait to be "
                    "taken; the oldest are dropped, which is logged once"
                )
            self.dropped += 1
        self._pending.append(_received(raw, info))

    def close(self) -> None:
        """End the subscription; what it has not handed out is lost."""
        self._pending.clear()
        self._node.destroy_subscription(self._subscription)

    def take(self) -> bytes | None:
        """The next serialised message; None if there is none now."""
        if self._pending:
            return self._pending.popleft().raw
        taken = self._take_message(self._message_type, True)
        return None if taken is None else taken[0]

    def discard(self) -> None:
        """Take the messages that have come so far, and do nothing with them."""
        for _ in range(_MOST_DISCARDED):
            if self.take() is None:
                return

    def take_received(self) -> Received | None:
        """The next message with when it was published, and its number; None if there is none."""
        if self._pending:
            return self._pending.popleft()
        taken = self._take_message(self._message_type, True)
        return None if taken is None else _received(*taken)

    def count_publishers_ever(self) -> int:
        """How many publishers it has heard of, those that are gone among them."""
        # Asked of the middleware itself: a callback would come after the publisher's messages.
        with self._subscription.handle:
            matched = rclpy_implementation.EventHandle(self._subscription.handle, _MATCHED)
        with matched:
            return int(matched.take_event().total_count)


def _received(raw: bytes, info: dict[str, int]) -> Received:
    return Received(raw, info["source_timestamp"], info.get("publication_sequence_number"))


class Spin:
    """The tries at the beginning of each wait, before the loop blocks.

    They pay where the sender works on another core: a loop that blocks must be woken up first. On
    a busy machine they take the core from those that the loop waits for. So after tries that did
    not pay some waits go without any, twice as many each time.
    """

    def __init__(self) -> None:
        self._until: float | None = None  # s; None: no wait has begun, -inf: it is without tries
        self._began = (0.0, 0.0)  # s of wall time, and of this thread's processor time
        self._waits_without = self._waits_left = 0  # after the last tries in vain; still to come

    def goes_on(self, now: float) -> bool:
        """Whether a wait that has not been met should try again at once, rather than block."""
        if self._until is None:
            self._until = self._begin(now)
        if now < self._until:
            return True
        if self._until > -math.inf:
            self._note(paid=False)
        return False

    def end(self, now: float) -> None:
        """Note that what was waited for has come, during the tries or after them."""
        if self._until is not None and self._until > -math.inf:
            began, worked_before = self._began
            worked = time.thread_time() - worked_before
            # A message that came while others had the core would have come to a sleeper, too.
            self._note(paid=worked > _LEAST_SHARE * (now - began))
        self._until = None

    def _begin(self, now: float) -> float:
        """Until when a new wait tries."""
        if self._waits_left:
            self._waits_left -= 1
            return -math.inf
        self._began = (now, time.thread_time())
        return now + _LONGEST_SPIN

    def _note(self, *, paid: bool) -> None:
        self._waits_without = 0 if paid else min(2 * self._waits_without + 1, _MOST_WITHOUT)
        self._waits_left = self._waits_without
        self._until = -math.inf


class PollingExecutor:
    """Gives a loop's idle moments to other processes and to the executor of the loop's nodes."""

    def __init__(self, *nodes: Node, service_period: float = _SERVICE_PERIOD) -> None:
        """`service_period` is the time in s between turns of the executor in a busy loop."""
        self._executor = SingleThreadedExecutor(context=nodes[0].context)
        for node in nodes:
            self._executor.add_node(node)
        self._nodes = nodes
        self._types = [EndpointTypes(node) for node in nodes]
        self._service_period = service_period
        self._spin = Spin()
        self._was_woken = False  # by a message that the loop has not taken yet
        self._busy_until = 0.0
        self._next_service = 0.0

    def received(self) -> None:
        """Note that a message came: the next one is worth waiting for without the executor."""
        now = time.monotonic()
        self._busy_until = now + _BUSY_PERIOD
        self._was_woken = False
        self._spin.end(now)

    def rest(self) -> None:
        """Let others work; at most about 20 ms."""
        now = time.monotonic()
        if now > self._busy_until:
            self._look_at_types()
            self._turn(_SERVICE_PERIOD)
        elif self._was_woken:  # by what the loop does not take: it would wake it again and again
            self._was_woken = False
            self.serve_pending()
        elif now > self._next_service:
            self.serve()  # which may take what the loop waits for
        elif self._spin.goes_on(now):
            os.sched_yield()
        else:
            self._was_woken = self._wait_for_message(self._next_service - now)

    def _wait_for_message(self, seconds: float) -> bool:
        """Block until any subscription has a message; whether one has."""
        # A turn of the executor would wait for services, too, and cost several times as much.
        subscriptions = [each.handle for node in self._nodes for each in node.subscriptions]
        if not subscriptions:
            return self._turn(seconds)
        context = self._executor.context
        try:
            waiting = rclpy_implementation.WaitSet(
                len(subscriptions), 0, 0, 0, 0, 0, context.handle
            )
            waiting.clear_entities()
            for each in subscriptions:
                waiting.add_subscription(each)
            waiting.wait(round(seconds * _NS_PER_S))
        except rclpy_implementation.RCLError:
            if context.ok():
                raise
            return False  # another thread has ended ROS, of which an executor says as little
        return bool(waiting.get_ready_entities("subscription"))

    def rest_for(self, seconds: float) -> None:
        """Let others work for a time that is known; ends early rather than late."""
        until = time.monotonic() + seconds
        self.serve()
        seconds = until - time.monotonic()
        if seconds > _SHORT_REST:
            self._turn(min(seconds - _SHORT_REST, _SERVICE_PERIOD))
        elif seconds > _SLEEP_ERROR:
            time.sleep(seconds - _SLEEP_ERROR)
        else:
            os.sched_yield()

    def serve(self) -> None:
        """Give the executor its turn if it is due, without waiting for anything."""
        now = time.monotonic()
        if now > self._next_service:
            self._next_service = now + self._service_period
            self._look_at_types()
            self.serve_pending()

    def _look_at_types(self) -> None:
        for each in self._types:
            each.look_at_graph()

    def serve_pending(self) -> None:
        """Do all that is ready: a flood of messages must not keep services waiting."""
        for _ in range(_MOST_TURNS):
            if not self._turn(0.0):
                return

    def _turn(self, seconds: float) -> bool:
        """Do one thing that is ready, or becomes so within a time; whether there was one.

        A callback that awaits something is not over when it returns, and the executor offers it
        first at each turn, whereas `spin_once` would take it for the one thing to do.
        """
        for _ in range(_MOST_TURNS):
            try:
                callback, *_ = self._executor.wait_for_ready_callbacks(seconds)
            except (TimeoutException, ShutdownException):
                return False
            callback()
            if callback.done():
                callback.result()  # raises what it has raised
                return True
        return False

    def close(self) -> None:
        """End the executor."""
        self._executor.shutdown()
