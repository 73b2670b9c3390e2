"""Messages taken one by one: what is kept, what is said to be dropped, and what waiting costs."""

import threading
import time
from collections.abc import Iterator
from itertools import pairwise

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from msgs_config.bus import polling
from msgs_config.bus.polling import DirectSubscription, PollingExecutor, Spin
from msgs_config.messages.cdr import decode_string
from msgs_config.messages.topic import Quality, Topic
from tests.support.ros import PATIENCE, wait_until

DEPTH = 5
PERIOD = 0.004  # s between messages, much longer than a wait is spent in tries
LONG = 10.0  # s, longer than any tries last


@pytest.mark.parametrize(("depth", "is_logged"), [(DEPTH, True), (1, False)])
def test_of_more_than_it_keeps_the_oldest_go_and_that_is_said_once(
    context: Context, capfd: pytest.CaptureFixture[str], depth: int, is_logged: bool
) -> None:
    # Arrange
    topic = Topic("flood", "std_msgs/msg/String", Quality(depth))
    sender, receiver = (Node(name, context=context) for name in ("speaker", "listener"))
    publisher = sender.create_publisher(String, "flood", QoSProfile(depth=100))
    subscription, spinner = DirectSubscription(receiver, topic), PollingExecutor(receiver)
    try:
        wait_until(publisher.get_subscription_count, "a listener", step=spinner.serve_pending)

        # Act: the executor takes what nobody takes from it
        for number in range(4 * DEPTH):
            publisher.publish(String(data=str(number)))
            wait_until(
                lambda number=number: newest(subscription) == number,
                f"message {number}",
                step=spinner.serve_pending,
            )

        # Assert
        texts = [int(decode_string(raw)) for raw in iter(subscription.take, None)]
    finally:
        spinner.close()
        for node in (sender, receiver):
            node.destroy_node()
    assert texts == list(range(4 * DEPTH))[-depth:]
    assert subscription.dropped == (3 * DEPTH if is_logged else 0)
    assert capfd.readouterr().err.count("the oldest are dropped") == is_logged


def newest(subscription: DirectSubscription) -> int | None:
    """The number in the newest message that waits; None if none does."""
    pending = subscription._pending
    return int(decode_string(pending[-1].raw)) if pending else None


@pytest.fixture
def nodes(context: Context) -> Iterator[tuple[Node, Node]]:
    speaker, listener = (Node(name, context=context) for name in ("speaker", "listener"))
    yield speaker, listener
    for node in (speaker, listener):
        node.destroy_node()


def test_waiting_for_messages_that_take_their_time_leaves_the_processor_to_others(
    nodes: tuple[Node, Node],
) -> None:
    # Arrange
    speaker, listener = nodes
    publisher = speaker.create_publisher(String, "beat", QoSProfile(depth=100))
    subscription = DirectSubscription(listener, Topic("beat", "std_msgs/msg/String", Quality(100)))
    spinner = PollingExecutor(listener)
    wait_until(publisher.get_subscription_count, "a listener", step=spinner.serve_pending)
    over = threading.Event()

    def speak() -> None:
        while not over.wait(PERIOD):
            publisher.publish(String(data="beat"))

    speaking = threading.Thread(target=speak)

    # Act
    count, worked = 0, time.thread_time()
    speaking.start()
    began = time.monotonic()
    while count < 250 and time.monotonic() < began + PATIENCE:
        if subscription.take() is None:
            spinner.rest()
        else:
            spinner.received()
            count += 1
    worked = time.thread_time() - worked
    took = time.monotonic() - began
    over.set()
    speaking.join()
    spinner.close()

    # Assert
    assert count == 250
    assert worked < 0.1 * took


def test_a_message_that_the_loop_does_not_take_is_the_executors_and_wakes_the_loop_once(
    nodes: tuple[Node, Node], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Arrange: a loop that waits for one topic, without tries, and has messages of others
    monkeypatch.setattr(polling, "_LONGEST_SPIN", 0.0)
    speaker, listener = nodes
    publisher = speaker.create_publisher(String, "aside", QoSProfile(depth=100))
    heard: list[str] = []
    listener.create_subscription(String, "aside", lambda message: heard.append(message.data), 10)
    spinner = PollingExecutor(listener, service_period=LONG)
    wait_until(publisher.get_subscription_count, "a listener", step=spinner.serve_pending)
    spinner.received()
    spinner.serve()

    # Act
    publisher.publish(String(data="by the way"))
    rests = 0
    while not heard and rests < 10:
        rests += 1
        spinner.received()  # the busy period of a loop whose messages come
        spinner.rest()
        spinner.rest()
    spinner.close()

    # Assert
    assert heard == ["by the way"]
    assert rests < 4


def test_a_wait_of_a_context_that_another_thread_has_ended_is_over(domain: int) -> None:
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    listener = Node("listener", context=context)
    spinner = PollingExecutor(listener)
    subscription = DirectSubscription(listener, Topic("beat", "std_msgs/msg/String", Quality(1)))
    try:
        context.shutdown()

        assert not spinner._wait_for_message(0.01)
    finally:
        subscription.close()
        spinner.close()
        listener.destroy_node()


def test_tries_that_do_not_pay_are_left_out_ever_longer_and_come_back_when_they_do() -> None:
    spin = Spin()

    # each wait goes on until long after the tries have ended
    tried = [number for number in range(200) if spend(spin, LONG)]
    gaps = [later - earlier - 1 for earlier, later in pairwise(tried)]
    assert gaps == [1, 3, 7, 15, 31, 63, 63]

    while not spend(spin, 0.0):  # now the message is there at once
        pass
    assert all(spend(spin, 0.0) for _ in range(10))


def test_tries_do_not_pay_where_others_had_the_processor_meanwhile() -> None:
    spin = Spin()

    assert spin.goes_on(0.0)
    spin.end(LONG)  # s of wall time, of which this thread has hardly worked any

    assert not spin.goes_on(LONG)


def spend(spin: Spin, seconds: float) -> bool:
    """One wait, which is over after some time; whether it began with tries."""
    has_tried = spin.goes_on(0.0)
    if seconds:
        assert not spin.goes_on(seconds)
    spin.end(seconds)
    return has_tried
