"""The bare round trip: the same bytes as a lockstep tick's, there and back between two processes.

Run as a module it is the far side, which answers every message.
"""

import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import rclpy
from rclpy.node import Node

from msgs_config import topics
from msgs_config.arrays import FloatArray
from msgs_config.joint_layout import JointLayout
from msgs_config.messages import JointStateEncoder
from msgs_config.polling import DirectSubscription, Spinner
from msgs_config.process import StopSignal, limit_threads, run_node

_PING = replace(topics.JOINT_STATES, name="ping")
_PONG = replace(topics.JOINT_TORQUES, name="pong")
_WARM_UP = 200


def round_trips(layout: JointLayout, count: int) -> FloatArray:
    """Durations (count,) in s of round trips of a state there and a torque back."""
    there = JointStateEncoder(layout.dof_names)
    back = JointStateEncoder(layout.dof_names)
    zeros = np.zeros(layout.size)
    size = len(back.encode(0, effort=zeros))
    message = there.encode(0, zeros, zeros, zeros)
    far = subprocess.Popen([sys.executable, "-m", "benchmarks.round_trip", str(size)])
    rclpy.init()
    node = Node("near_side")
    inbox = DirectSubscription(node, _PONG)
    spinner = Spinner(node)
    try:
        publisher = topics.create_publisher(node, _PING)
        while publisher.get_subscription_count() < 1 or node.count_publishers("pong") < 1:
            spinner.rest()
        durations = np.empty(_WARM_UP + count)
        for index in range(len(durations)):
            started = time.perf_counter()
            publisher.publish(message)
            while inbox.take() is None:
                spinner.rest()
            spinner.received()
            durations[index] = time.perf_counter() - started
        return durations[_WARM_UP:]
    finally:
        spinner.close()
        node.destroy_node()
        rclpy.try_shutdown()
        far.terminate()
        far.wait()


def _answer(stop: StopSignal) -> None:
    node = Node("far_side")
    inbox, publisher = DirectSubscription(node, _PING), topics.create_publisher(node, _PONG)
    spinner = Spinner(node)
    answer = bytes(int(sys.argv[1]))
    while not stop:
        if inbox.take() is None:
            spinner.rest()
        else:
            spinner.received()
            publisher.publish(answer)
    spinner.close()
    node.destroy_node()


if __name__ == "__main__":
    limit_threads()
    sys.exit(run_node(_answer))
