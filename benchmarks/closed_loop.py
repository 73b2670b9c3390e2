"""The closed loop of simulator and controller: in one process, and over topics."""

import os
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from experiment.figures import PARAMETERS, write_parameters
from experiment.loop import ticks_in_process
from experiment.plan import Plan
from experiment.processes import Child, Children
from msgs_config import topics
from msgs_config.arrays import FloatArray

_PATIENCE = 120.0  # s for a whole run


def in_process(plan: Plan) -> FloatArray:
    """Durations (ticks,) in s of the ticks of a plan, without ROS."""
    times = [time.perf_counter()]
    for _ in ticks_in_process(plan):
        times.append(time.perf_counter())
    return np.diff(times)[1:]  # the first one builds the world, too


def over_topics(plan: Plan) -> dict[str, float]:
    """What the simulator says of its tick times, in a run of two processes without a recorder."""
    figures: dict[str, float] = {}

    def listen(message: DiagnosticArray) -> None:
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            figures.update(
                {name: float(values[name]) for name in values if name.startswith("tick")}
            )

    rclpy.init()
    node = rclpy.create_node("benchmark")
    node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS.name, listen, topics.STREAM_QOS)
    try:
        with tempfile.TemporaryDirectory() as directory, Children() as children:
            (Path(directory) / PARAMETERS).mkdir()
            simulator = _start(children, Path(directory), "sim_node", plan.simulator)
            _spin(node, lambda: bool(figures), simulator)  # its reports are heard from now on
            _start(children, Path(directory), "controller_node", plan.controller)
            _spin(node, lambda: figures["tick"] > plan.ticks, simulator)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    return figures


def _spin(node: Node, done: Callable[[], bool], simulator: Child) -> None:
    """Take messages until it is done."""
    deadline = time.monotonic() + _PATIENCE
    while not done():
        rclpy.spin_once(node, timeout_sec=0.05)
        if simulator.exit_code or time.monotonic() > deadline:
            raise RuntimeError(f"no report of the simulator: {simulator.last_words()}")


def _start(
    children: Children, directory: Path, name: str, parameters: Mapping[str, object]
) -> Child:
    file = write_parameters(directory, name, parameters)
    arguments = ["--ros-args", "--params-file", str(file)]
    log = directory / f"{name}.log"
    return children.start(Child(name, f"{name}.main", arguments, log, dict(os.environ)))
