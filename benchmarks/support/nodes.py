"""Nodes of this package as child processes, and what the simulator reports of itself."""

import os
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from actuated_characters.runs.processes import Child, Children
from msgs_config.messages import topics

_PATIENCE = 120.0  # s for a whole run


class Nodes:
    """Child processes in a `with` block, and a node of this process that hears their reports."""

    def __init__(self) -> None:
        self.reports: list[dict[str, str]] = []  # those of the simulator, oldest first
        self._simulator: Child | None = None
        self._loop: list[Child] = []

    def __enter__(self) -> "Nodes":
        self._stack = ExitStack()
        rclpy.init()
        self._stack.callback(rclpy.try_shutdown)
        self.node = Node("benchmark")
        self._stack.callback(self.node.destroy_node)
        directory = Path(self._stack.enter_context(tempfile.TemporaryDirectory()))
        self._children = self._stack.enter_context(Children(directory))
        topic = topics.DIAGNOSTICS
        self.node.create_subscription(topic.message_type, topic.name, self._listen, topic.qos)
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def start(self, name: str, parameters: Mapping[str, object]) -> Child:
        """Start one of the package's nodes."""
        child = self._children.start_node(name, parameters)
        if name == topics.SIM_NODE:
            self._simulator = child
        return child

    def start_loop(
        self,
        simulator: Mapping[str, object],
        controller: Mapping[str, object],
        *,
        composed: bool = False,
    ) -> None:
        """Start the simulator and a controller, in a process each, or in one if `composed`.

        The simulator's reports are heard before its first tick, or as it waits for subscribers.
        """
        if composed:
            parameters = {topics.SIM_NODE: simulator, topics.CONTROLLER_NODE: controller}
            self._simulator = self._children.start_composed("composed", parameters)
            self._loop = [self._simulator]
            return
        simulating = self.start(topics.SIM_NODE, simulator)
        if not simulator.get("wait_for_subscribers"):
            self.wait_until(lambda: self.reports)
        self._loop = [simulating, self.start(topics.CONTROLLER_NODE, controller)]

    def loop_processor_time(self) -> float:
        """How long simulator and controller have kept processors busy so far, s."""
        return sum(processor_time(child.pid) for child in self._loop)

    @property
    def tick(self) -> int:
        """The tick of the simulator's last report; 0 before the first."""
        return int(self.reports[-1]["tick"]) if self.reports else 0

    def wait_until(
        self,
        done: Callable[[], object],
        step: Callable[[], object] | None = None,
        patience: float = _PATIENCE,
    ) -> None:
        """Take reports, or what else a step takes, until it is done.

        Raises:
            RuntimeError: the simulator failed, or it takes longer than `patience`, s.
        """
        deadline = time.monotonic() + patience
        while not done():
            if step is None:
                rclpy.spin_once(self.node, timeout_sec=0.05)
            else:
                step()
            failed = self._simulator is not None and self._simulator.exit_code
            if failed or time.monotonic() > deadline:
                words = self._simulator.last_words() if self._simulator else "not started"
                raise RuntimeError(f"the simulator does not report what is waited for: {words}")

    def _listen(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith(topics.SIM_NODE):
                self.reports.append({item.key: item.value for item in status.values})


def private_memory(child: Child) -> float:
    """Memory in MB that a child does not share and no file holds."""
    lines = Path(f"/proc/{child.pid}/smaps_rollup").read_text().splitlines()
    (anonymous,) = (line.split()[1] for line in lines if line.startswith("Pss_Anon:"))
    return 1e-3 * float(anonymous)


def processor_time(pid: int) -> float:
    """How long a process has kept processors busy so far, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    user, system = (int(field) for field in fields[11:13])  # utime and stime of proc(5)
    return (user + system) / os.sysconf("SC_CLK_TCK")
