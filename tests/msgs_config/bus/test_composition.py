"""Nodes that take turns in one thread: whose turn it is, how long they rest, and how they end."""

import math
from collections.abc import Callable, Iterator, Sequence

import pytest
from rclpy.context import Context

from msgs_config.bus import dds
from msgs_config.bus.composition import (
    AT_ONCE,
    UNTIL_A_MESSAGE,
    ComposableNode,
    Turns,
    ros_node,
    run_nodes,
)
from msgs_config.bus.polling import PollingExecutor
from msgs_config.errors import ConfigurationError, SimulationError
from msgs_config.messages.cdr import encode_string
from msgs_config.messages.topic import LATCHED, Topic

TOPIC = Topic("turn", "std_msgs/msg/String", LATCHED)


class Worker(ComposableNode):
    """Does in each turn what a test says, and notes when it has ended."""

    def __init__(self, context: Context, name: str, log: list[str]) -> None:
        super().__init__(ros_node(name, context=context))
        self._log = log
        self.steps: Callable[[PollingExecutor], Iterator[float]] = lambda executor: iter(())

    def turns(self, stop: object, executor: PollingExecutor) -> Turns:
        try:
            for seconds in self.steps(executor):
                self._log.append(self.node.get_name())
                yield seconds
        finally:
            executor.serve_pending()  # it is not closed before its nodes
            self._log.append(f"end of {self.node.get_name()}")


class RecordingExecutor(PollingExecutor):
    """Notes how long it is to rest, and does not."""

    rests: list[float]

    def rest(self) -> None:
        self.rests.append(math.inf)

    def rest_for(self, seconds: float) -> None:
        self.rests.append(seconds)


@pytest.fixture
def log() -> list[str]:
    return []


@pytest.fixture
def workers(context: Context, log: list[str]) -> Iterator[list[Worker]]:
    made = [Worker(context, name, log) for name in ("one", "other")]
    yield made
    for worker in made:
        worker.destroy_node()


@pytest.fixture
def rests(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    found: list[float] = []
    monkeypatch.setattr(RecordingExecutor, "rests", found, raising=False)
    monkeypatch.setattr(dds, "PollingExecutor", RecordingExecutor)
    return found


def with_rests(*seconds: float) -> Callable[[PollingExecutor], Iterator[float]]:
    return lambda executor: iter(seconds)


def raising(error: Exception) -> Callable[[PollingExecutor], Iterator[float]]:
    def steps(executor: PollingExecutor) -> Iterator[float]:
        yield AT_ONCE
        raise error

    return steps


def test_when_one_has_ended_the_others_are_closed(workers: list[Worker], log: list[str]) -> None:
    one, other = workers
    one.steps, other.steps = with_rests(*[AT_ONCE] * 2), with_rests(*[AT_ONCE] * 9)

    run_nodes(workers, False)

    assert log == ["one", "other", "one", "other", "end of one", "end of other"]


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ([AT_ONCE, UNTIL_A_MESSAGE], [UNTIL_A_MESSAGE, AT_ONCE], []),
        ([UNTIL_A_MESSAGE], [UNTIL_A_MESSAGE], [math.inf]),
        ([0.25, 3.0], [UNTIL_A_MESSAGE, 2.0], [0.25, 2.0]),
    ],
)
def test_they_rest_when_none_has_done_anything_and_no_longer_than_one_of_them_would(
    workers: list[Worker],
    rests: list[float],
    one: Sequence[float],
    other: Sequence[float],
    expected: Sequence[float],
) -> None:
    workers[0].steps, workers[1].steps = with_rests(*one), with_rests(*other)

    run_nodes(workers, False)

    assert rests == expected


def test_a_node_alone_rests_as_long_as_it_says(workers: list[Worker], rests: list[float]) -> None:
    alone = workers[0]
    alone.steps = with_rests(AT_ONCE, 0.5, UNTIL_A_MESSAGE, AT_ONCE)

    alone.run(False)

    assert rests == [0.5, math.inf]


def test_an_error_of_one_of_several_names_it_and_the_others_end_well(
    workers: list[Worker], log: list[str]
) -> None:
    workers[0].steps = with_rests(*[AT_ONCE] * 9)
    workers[1].steps = raising(SimulationError("it fell"))

    with pytest.raises(SimulationError, match=r"^other: it fell$"):
        run_nodes(workers, False)

    assert log == ["one", "other", "one", "end of other", "end of one"]


def test_an_error_of_a_node_alone_is_as_it_was(workers: list[Worker]) -> None:
    workers[0].steps = raising(ConfigurationError("too much"))

    with pytest.raises(ConfigurationError, match=r"^too much$"):
        workers[0].run(False)


def test_what_one_publishes_the_other_takes_in_its_next_turn(workers: list[Worker]) -> None:
    sender, receiver = workers
    publisher = sender.node.publisher(TOPIC)
    subscription, found = receiver.node.subscription(TOPIC), []

    def speaking(executor: PollingExecutor) -> Iterator[float]:
        while not publisher.get_subscription_count():
            yield UNTIL_A_MESSAGE
        for number in range(5):
            publisher.publish(encode_string(str(number)))
            yield AT_ONCE

    def listening(executor: PollingExecutor) -> Iterator[float]:
        while True:
            found.append(subscription.take() is not None)
            yield UNTIL_A_MESSAGE

    sender.steps, receiver.steps = speaking, listening
    run_nodes(workers, False)

    assert found[-5:] == [True] * 5


def test_while_one_works_long_the_services_of_the_others_are_answered(
    workers: list[Worker], log: list[str]
) -> None:
    worker, served = workers
    timer = served.node.create_timer(0.0, lambda: log.append("served"))

    def working(executor: PollingExecutor) -> Iterator[float]:
        while "served" not in log:
            executor.serve()
        timer.cancel()
        yield AT_ONCE

    worker.steps, served.steps = working, with_rests(AT_ONCE)
    run_nodes(workers, False)

    assert log[0] == "served"
