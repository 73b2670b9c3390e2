"""The bus of one process: who hears what, in which order, and how nodes are called."""

import pytest

from msgs_config.bus.in_process import Bus, InProcessNode
from msgs_config.bus.node import Answer
from msgs_config.messages.topic import LATCHED, STREAM, Quality, Topic
from msgs_config.parameters import Parameter, Values

STATES = Topic("states", "std_msgs/msg/String", STREAM)
DESCRIPTION = Topic("~/description", "std_msgs/msg/String", LATCHED)


@pytest.fixture
def bus() -> Bus:
    return Bus()


def test_messages_are_taken_in_order_and_once(bus: Bus) -> None:
    speaker, listener = bus.node("speaker", {}), bus.node("listener", {})
    publisher, subscription = speaker.publisher(STATES), listener.subscription(STATES)

    for raw in (b"1", b"2"):
        publisher.publish(raw)

    assert list(iter(subscription.take, None)) == [b"1", b"2"]


def test_of_more_than_its_depth_a_subscription_keeps_the_newest(bus: Bus) -> None:
    shallow = Topic("states", "std_msgs/msg/String", Quality(2))
    publisher = bus.node("speaker", {}).publisher(STATES)
    subscription = bus.node("listener", {}).subscription(shallow)

    for raw in (b"1", b"2", b"3"):
        publisher.publish(raw)

    assert list(iter(subscription.take, None)) == [b"2", b"3"]


def test_who_comes_late_has_what_is_latched_and_nothing_else(bus: Bus) -> None:
    speaker = bus.node("speaker", {}, "left")
    speaker.publisher(STATES).publish(b"state")
    description = speaker.publisher(DESCRIPTION)
    for raw in (b"before", b"now"):
        description.publish(raw)

    late = bus.node("listener", {}, "left")
    states, described = late.subscription(STATES), late.subscription(DESCRIPTION.of("speaker"))

    assert states.take() is None
    assert list(iter(described.take, None)) == [b"now"]
    assert description.topic_name == "/left/speaker/description"


def test_who_listens_hears_all_topics_in_the_order_of_publishing(bus: Bus) -> None:
    speaker, listener, heard = bus.node("speaker", {}), bus.node("listener", {}), list[bytes]()
    states, description = speaker.publisher(STATES), speaker.publisher(DESCRIPTION)
    for topic in (STATES, DESCRIPTION.of("speaker")):
        listener.listen(topic, heard.append)

    states.publish(b"1")
    description.publish(b"2")
    states.publish(b"3")

    assert heard == [b"1", b"2", b"3"]


def test_only_those_that_are_there_count(bus: Bus) -> None:
    speaker, listener = bus.node("speaker", {}), bus.node("listener", {})
    publisher = speaker.publisher(STATES)
    subscription = listener.subscription(STATES)
    assert (publisher.get_subscription_count(), listener.count_publishers("states")) == (1, 1)
    assert [each.node for each in listener.endpoints(STATES)] == ["/speaker"]

    subscription.close()
    speaker.destroy_node()

    assert (publisher.get_subscription_count(), listener.count_publishers("states")) == (0, 0)


def test_a_call_has_its_answer_at_once_or_when_it_is_given(bus: Bus) -> None:
    server, client = bus.node("server", {}), bus.node("client", {}).client("server")
    later = Answer()
    server.offer("now", lambda flag: Answer(flag, "done"), takes_flag=True)
    server.offer("later", lambda _: later)

    now, waits = client.call("now", flag=False), client.call("later")

    assert (now.is_given, now.success, now.message) == (True, False, "done")
    assert not waits.is_given
    later.give(True)
    assert waits.success
    assert client.call("never").message == "/server has no service never"
    assert not bus.node("other", {}).client("nobody").is_ready


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"gain": 2.0}, ""),
        ({"gain": -1.0}, "it must not be negative"),
        ({"size": 2.0}, "parameter 'size' cannot be changed"),
        ({"gain": 2.0, "gian": 2.0}, "parameter 'gian' is not declared"),
    ],
)
def test_parameters_are_set_all_or_none(bus: Bus, values: dict[str, float], reason: str) -> None:
    changes: list[dict[str, float]] = []
    server: InProcessNode = bus.node("server", {})
    declared = [Parameter("gain", 1.0, "", live=True), Parameter("size", 1.0, "")]
    server.declare(declared, Values(gain=1.0, size=1.0))
    server.watch_parameters(
        lambda given: "it must not be negative" if given["gain"] < 0 else "", changes.append
    )

    answer = bus.node("client", {}).client("server").set_parameters(values)

    assert (answer.is_given, answer.success, answer.message) == (True, not reason, reason)
    assert changes == ([] if reason else [values])
