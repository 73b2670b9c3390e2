"""The closed loop of simulator and controller: in one process, and over topics."""

import os
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from controller_node.parameters import make_controller
from experiment.plan import Plan
from experiment.processes import Child, Children
from msgs_config import topics
from msgs_config.arrays import FloatArray
from sim_node.parameters import make_settings
from sim_node.simulation import Simulation

_PATIENCE = 120.0  # s for a whole run


def in_process(plan: Plan) -> FloatArray:
    """Durations (ticks,) in s of the ticks of a plan, without ROS."""
    controller = make_controller(plan.character, plan.reference, plan.controller)
    durations = np.empty(plan.ticks)
    with Simulation(plan.character, make_settings(plan.simulator)) as simulation:
        episode_ns = simulation.state.stamp_ns
        for tick in range(plan.ticks):
            started = time.perf_counter()
            effort, _ = controller.answer(simulation.state, episode_ns)
            simulation.step(np.where(simulation.commanded, effort, 0.0))
            durations[tick] = time.perf_counter() - started
    return durations


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
    file = directory / f"{name}.yaml"
    file.write_text(yaml.safe_dump({name: {"ros__parameters": dict(parameters)}}))
    arguments = ["--ros-args", "--params-file", str(file)]
    return children.start(
        Child(name, f"{name}.main", arguments, directory / f"{name}.log", dict(os.environ))
    )
