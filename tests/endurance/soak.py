"""`make soak`: hundreds of thousands of lockstep ticks through real processes, and disturbances.

At seeded moments the pendulum is pushed, paused and stepped, reset, and given other parameters.
No tick may be lost, the memory of both processes must not grow, and the simulator's counts must be
those of what was sent.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from msgs_config.bus.dds import create_publisher
from msgs_config.runtime.process import limit_threads

limit_threads()

import numpy as np  # noqa: E402 - after the limit on threads
import rclpy  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
from rclpy.client import Client  # noqa: E402
from rclpy.context import Context  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.task import Future  # noqa: E402
from rich.console import Console  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402

from actuated_characters.runs.processes import Child, Children  # noqa: E402
from actuated_characters.runs.ros_domain import own_domain  # noqa: E402
from benchmarks.support.nodes import private_memory  # noqa: E402
from msgs_config.bus.polling import DirectSubscription  # noqa: E402
from msgs_config.messages import topics  # noqa: E402
from msgs_config.messages.clock import TickClock  # noqa: E402
from msgs_config.messages.joint_state import JointStateDecoder  # noqa: E402
from msgs_config.messages.wrenches import WrenchArrays, encode_wrenches  # noqa: E402
from tests.endurance.soak_report import MEMORY_PERIOD, SoakReport  # noqa: E402

_RATE = 240  # Hz
_MOST_GROWTH = 5.0  # MB
_QUIET_END = 2_000  # ticks without disturbances, so that all that was sent is counted
_AHEAD = 2_000  # ticks that a push with a future stamp is ahead, so that it is not too late
_MOST_STEPS = 3  # of one pause
_MOST_ASKED_AGAIN = _MOST_STEPS + 1  # commands of one pause: before each step and the end
_PATIENCE = 60.0  # s without a new tick
_NAP = 0.002  # s that leave the processor to the others; states queue up meanwhile

Progress = Callable[[int], None]
"""Is told the number of ticks so far."""

_Disturbance = Iterator[Future | None]


def soak(ticks: int, seed: int, progress: Progress) -> SoakReport:
    """Run simulator and controller for a number of ticks with seeded disturbances.

    Raises:
        RuntimeError: a process ended too early, or no tick came for a minute.
    """
    context = Context()
    rclpy.init(context=context)
    node = Node("soak", context=context, start_parameter_services=False)
    try:
        with tempfile.TemporaryDirectory() as name, Children(Path(name)) as children:
            hold = {"character": "pendulum", "rate": _RATE}
            alone = {**hold, "max_ticks": ticks, "wait_for_subscribers": 2}
            started = {
                "sim_node": children.start_node(topics.SIM_NODE, alone),
                "controller_node": children.start_node(topics.CONTROLLER_NODE, hold),
            }
            return _Soak(node, started, ticks, seed).run(progress)
    finally:
        node.destroy_node()
        context.try_shutdown()


class _Soak:
    """Listens to every state, and disturbs."""

    def __init__(self, node: Node, started: dict[str, Child], ticks: int, seed: int) -> None:
        self._started = started
        self._ticks = ticks
        self._rng = np.random.default_rng(seed)
        self._spacing = max(min(1_000, ticks // 30), 1)  # ticks between disturbances, on average
        self._clock = TickClock(_RATE)
        self._decoder = JointStateDecoder()
        # this process naps and waits for services, on a machine that may be busy
        self._states = DirectSubscription(node, topics.JOINT_STATES.for_listener())
        self._pushes = create_publisher(node, topics.EXTERNAL_WRENCH)
        diagnostics = topics.DIAGNOSTICS
        node.create_subscription(
            diagnostics.message_type, diagnostics.name, self._listen, diagnostics.qos
        )
        self._pausing = node.create_client(SetBool, "sim_node/pause")
        self._stepping = node.create_client(Trigger, "sim_node/step")
        self._resetting = node.create_client(Trigger, "sim_node/reset")
        self._setting = {
            name: node.create_client(SetParameters, f"{name}/set_parameters") for name in started
        }
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._tick = 0
        self._found = SoakReport()

    def run(self, progress: Progress) -> SoakReport:
        """Until the simulator has ended by itself."""
        found = self._found
        started_at = heard_at = time.monotonic()
        disturbance: _Disturbance = iter(())
        waits_for: Future | None = None
        next_disturbance, next_look = self._spacing, 0
        while self._tick <= self._ticks:
            if self._take_states():
                heard_at = time.monotonic()
            self._executor.spin_once(timeout_sec=0.0)
            time.sleep(_NAP)
            self._check_alive(heard_at)
            if self._tick >= next_look:
                next_look += MEMORY_PERIOD
                self._look_at_memory()
                progress(self._tick)
            if waits_for is not None:
                if not waits_for.done():
                    continue
                self._check_response(waits_for.result())
            waits_for = next(disturbance, None)
            if waits_for is None and self._may_disturb and self._tick > next_disturbance:
                next_disturbance = self._tick + int(self._rng.integers(1, 2 * self._spacing))
                disturbance = self._disturb()
        found.ticks = self._tick - 1
        found.wall_time = time.monotonic() - started_at
        self._wait_for_last_report()
        self._judge()
        self._executor.shutdown()
        return found

    @property
    def _may_disturb(self) -> bool:
        hears_pushes = self._pushes.get_subscription_count() > 0
        return hears_pushes and self._tick < self._ticks - _QUIET_END

    def _take_states(self) -> bool:
        """Take all states that have come, and check that no tick is missing."""
        heard = False
        while (raw := self._states.take()) is not None:
            stamp_ns = self._decoder.decode(raw).stamp_ns
            if stamp_ns == self._clock.stamp_ns(self._tick):
                self._found.repeated_states += 1
                continue
            if stamp_ns != self._clock.stamp_ns(self._tick + 1):
                self._found.problems.append(f"after tick {self._tick} comes {stamp_ns} ns")
            self._tick = self._clock.tick(stamp_ns)
            heard = True
        return heard

    def _check_alive(self, heard_at: float) -> None:
        for name, child in self._started.items():
            has_ended = child.exit_code is not None and self._tick < self._ticks
            if has_ended or time.monotonic() - heard_at > _PATIENCE:
                raise RuntimeError(f"{name} at tick {self._tick}: {child.last_words()}")

    def _disturb(self) -> _Disturbance:
        """One disturbance: a generator that waits for what it yields."""
        choices = [self._reset, self._push, self._pause, self._set_gain, self._set_duration]
        # each once to begin with: what the first of a kind takes for good is no growth
        known = self._found.disturbances.total()
        number = known if known < len(choices) else int(self._rng.integers(len(choices)))
        chosen = choices[number]
        self._found.disturbances[chosen.__name__.strip("_")] += 1
        return chosen()

    def _push(self) -> _Disturbance:
        """Now, or at a tick to come."""
        ahead = bool(self._rng.integers(2))
        stamp_ns = self._clock.stamp_ns(self._tick + _AHEAD) if ahead else 0
        wrench = np.append(self._rng.uniform(-5.0, 5.0, 3), np.zeros(3))  # N, no torque
        push = WrenchArrays.of_rows(stamp_ns, ["rod"], [wrench], [])
        self._pushes.publish(encode_wrenches(push))
        yield from ()

    def _pause(self) -> _Disturbance:
        """And a few steps before it goes on."""
        yield _call(self._pausing, SetBool.Request(data=True))
        for _ in range(int(self._rng.integers(_MOST_STEPS + 1))):
            yield _call(self._stepping, Trigger.Request())
        yield _call(self._pausing, SetBool.Request(data=False))

    def _reset(self) -> _Disturbance:
        yield _call(self._resetting, Trigger.Request())

    def _set_gain(self) -> _Disturbance:
        yield self._set("controller_node", "gains.hinge.p", self._rng.uniform(30.0, 60.0))

    def _set_duration(self) -> _Disturbance:
        yield self._set("sim_node", "wrench_duration", self._rng.uniform(0.01, 0.5))

    def _set(self, node: str, name: str, value: float) -> Future:
        message = Parameter(name, value=value).to_parameter_msg()
        return _call(self._setting[node], SetParameters.Request(parameters=[message]))

    def _check_response(self, response: Any) -> None:
        answers = getattr(response, "results", [response])  # of SetParameters, one a parameter
        if not all(getattr(a, "successful", getattr(a, "success", False)) for a in answers):
            self._found.problems.append(f"at tick {self._tick}: {response}")

    def _listen(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith(topics.SIM_NODE):
                self._found.report = {item.key: item.value for item in status.values}

    def _wait_for_last_report(self) -> None:
        deadline = time.monotonic() + _PATIENCE
        while self._found.report.get("tick") != str(self._tick) and time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=0.1)

    def _look_at_memory(self) -> None:
        for name, child in self._started.items():
            with suppress(FileNotFoundError, ProcessLookupError):  # it has ended by itself, and
                # this process hears so later; one that ends too early is found by `_check_alive`
                self._found.megabytes.setdefault(name, []).append(private_memory(child))

    def _judge(self) -> None:
        found = self._found
        simulator = self._started["sim_node"]
        if simulator.end() != 0:
            found.problems.append(f"sim_node ended with an error: {simulator.last_words()}")
        sent = found.disturbances
        expected = {
            "tick": self._ticks + 1,
            "episode": sent["reset"] + 1,
            "paused": False,
            "timeouts": 0,
            "accepted_pushes": sent["push"],
        }
        expected |= dict.fromkeys(("rejected", "rejected_pushes", "conflict", "future"), 0)
        for key, value in expected.items():
            if found.report.get(key) != str(value):
                reported = found.report.get(key)
                found.problems.append(f"sim_node reports {key} {reported}; it must be {value}")
        # a tick that is paused or reset asks for its command again
        more = int(found.report.get("accepted", 0)) - (self._ticks - sent["reset"])
        if not 0 <= more <= sent["reset"] + _MOST_ASKED_AGAIN * sent["pause"]:
            found.problems.append(f"{more} commands more than ticks were accepted")
        for name, growth in found.growth.items():
            if growth > _MOST_GROWTH:
                found.problems.append(f"{name} has grown by {growth:.1f} MB")


def _call(client: Client, request: Any) -> Future:
    client.wait_for_service()
    return client.call_async(request)


def main() -> int:
    """Soak, and print what was found; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.endurance.soak", description=__doc__)
    parser.add_argument("--ticks", type=int, default=500_000, help="lockstep ticks")
    parser.add_argument("--seed", type=int, default=1, help="of the disturbances")
    arguments = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    console = Console()

    def progress(tick: int) -> None:
        if tick % (10 * MEMORY_PERIOD) < MEMORY_PERIOD:
            console.print(f"tick {tick} of {arguments.ticks}")

    with own_domain() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        try:
            found = soak(arguments.ticks, arguments.seed, progress)
        except (RuntimeError, KeyboardInterrupt) as error:
            console.print(f"[red]not to the end: {error or 'interrupted'}")
            return 1
    console.print(found.table())
    for problem in found.problems[:20]:
        console.print(f"[red]{problem}")
    return 1 if found.problems else 0


if __name__ == "__main__":
    sys.exit(main())
