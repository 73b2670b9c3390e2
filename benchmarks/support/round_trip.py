"""The bare round trip: the same bytes as a lockstep tick's, there and back between two processes.

Measured twice: with messages taken directly, as the nodes of this package do, and through rclpy's
executor, as most nodes do. Run as a module it is the far side, which answers every message.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from benchmarks.support.nodes import processor_time
from benchmarks.support.timing import TickTimes
from msgs_config.arrays import FloatArray
from msgs_config.bus.dds import create_publisher
from msgs_config.bus.polling import DirectSubscription, PollingExecutor
from msgs_config.character.layout import JointLayout
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateEncoder
from msgs_config.messages.topic import Topic
from msgs_config.runtime.process import StopSignal, run_node

_PING = replace(topics.JOINT_STATES, name="ping")
_PONG = replace(topics.JOINT_TORQUES, name="pong")
_WARM_UP = 200
_REST = 0.001  # s between looks for the near side
_PATIENCE = 60.0  # s for the other side to appear, and for each answer
_SIZE, _WAY = "BENCHMARK_ANSWER_BYTES", "BENCHMARK_WAY"
_DIRECT, _EXECUTOR = "direct", "executor"


def round_trips(layout: JointLayout, count: int, *, direct: bool) -> TickTimes:
    """What a round trip takes of a state there and a torque back; so many are measured."""
    encoder, zeros = JointStateEncoder(layout.dof_names), np.zeros(layout.size)
    answer_bytes = len(encoder.encode(0, effort=zeros))
    way = _DIRECT if direct else _EXECUTOR
    far = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.support.round_trip"],
        env={**os.environ, _SIZE: str(answer_bytes), _WAY: way},
    )
    rclpy.init()
    node = Node("near_side")
    with ExitStack() as at_end:
        at_end.callback(far.wait)
        at_end.callback(far.terminate)
        at_end.callback(rclpy.try_shutdown)
        at_end.callback(node.destroy_node)
        take = _taker(node, _PONG, way, at_end)
        publisher = create_publisher(node, _PING)
        _wait(lambda: publisher.get_subscription_count() and node.count_publishers("pong"))
        message = encoder.encode(0, zeros, zeros, zeros)

        def time_trips(count: int) -> FloatArray:
            durations = np.empty(count)
            for index in range(count):
                started = time.perf_counter()
                publisher.publish(message)
                _wait(take)
                durations[index] = time.perf_counter() - started
            return durations

        time_trips(_WARM_UP)
        worked_before = time.process_time() + processor_time(far.pid)
        durations = time_trips(count)
        worked = time.process_time() + processor_time(far.pid) - worked_before
        return TickTimes.of(durations, worked)


def _taker(node: Node, topic: Topic, way: str, at_end: ExitStack) -> Callable[[], bool]:
    """What looks for a message once, and says whether there was one."""
    if way == _DIRECT:
        inbox, spinner = DirectSubscription(node, topic), PollingExecutor(node)
        at_end.callback(spinner.close)

        def take_directly() -> bool:
            if inbox.take() is not None:
                spinner.received()
                return True
            spinner.rest()
            return False

        return take_directly

    arrived: list[bytes] = []

    def keep(raw: bytes) -> None:
        arrived.append(raw)

    node.create_subscription(topic.message_type, topic.name, keep, topic.qos, raw=True)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    at_end.callback(executor.shutdown)

    def take_by_executor() -> bool:
        executor.spin_once(timeout_sec=0.1)
        return bool(arrived and arrived.pop())

    return take_by_executor


def _wait(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + _PATIENCE
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError("the other side of the round trip does not answer")


class FarSide(Node):
    """Answers every message with one of the size that its environment says."""

    def __init__(self) -> None:
        super().__init__("far_side")
        self._at_end = ExitStack()
        self._take = _taker(self, _PING, os.environ[_WAY], self._at_end)
        self._publisher = create_publisher(self, _PONG)
        self._reply = bytes(int(os.environ[_SIZE]))

    def run(self, stop: StopSignal) -> None:
        """Answer until a signal."""
        with self._at_end:
            while not stop and not self._publisher.get_subscription_count():
                time.sleep(_REST)  # an answer that nobody hears yet would be waited for
            while not stop:
                if self._take():
                    self._publisher.publish(self._reply)


if __name__ == "__main__":
    run_node("benchmarks.support.round_trip:FarSide")
