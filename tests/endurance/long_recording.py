"""`python -m tests.endurance.long_recording`: minutes of the humanoid at 1 kHz, none lost.

The recorder takes all topics of the contract beside simulator and controller, as fast as they go.
What is in the bag is then held against what must have been published.
"""

import argparse
import os
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from msgs_config.runtime.process import limit_threads

limit_threads()

from rich.console import Console  # noqa: E402 - after the limit on threads

from actuated_characters.bags.format.metadata import BAG  # noqa: E402
from actuated_characters.bags.reader import read_messages  # noqa: E402
from actuated_characters.recorder.run_directory import read_metrics  # noqa: E402
from actuated_characters.runs.ros_domain import own_domain  # noqa: E402
from benchmarks.recorder import RATE, walk  # noqa: E402
from benchmarks.support.nodes import Nodes, processor_time  # noqa: E402
from msgs_config.messages import topics  # noqa: E402

_PATIENCE = 3600.0  # s
_REPORT_PERIOD = 10.0  # s
_OF_STATES = [
    topics.CLOCK,
    topics.JOINT_STATES,
    topics.CONTACTS,
    topics.APPLIED_WRENCH,
    topics.ODOM,
]
_OF_ANSWERS = [topics.JOINT_TORQUES, topics.REFERENCE, topics.NET_WRENCH]


def main() -> int:
    """Record, count and print; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.endurance.long_recording")
    parser.add_argument("--minutes", type=float, default=5.0, help="of simulated time (5)")
    parser.add_argument("--real-time", action="store_true", help="in real time, not in lockstep")
    arguments = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    console = Console()
    with own_domain() as domain, tempfile.TemporaryDirectory() as name:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        directory = Path(name)
        simulator = {"mode": "realtime"} if arguments.real_time else {}
        ticks = record(directory, 60.0 * arguments.minutes, simulator, console)
        problems = missing(directory, ticks, lockstep=not arguments.real_time)
    for problem in problems:
        console.print(f"[red]{problem}")
    console.print("nothing was lost" if not problems else "messages were lost")
    return 1 if problems else 0


def record(
    directory: Path, duration: float, simulator: Mapping[str, object], console: Console
) -> int:
    """Let the humanoid walk for so many s, recorded into a directory; returns the ticks."""
    plan = walk(duration, **simulator)
    with Nodes() as nodes:
        recorder = nodes.start(topics.RECORDER_NODE, {"directory": str(directory)})
        all_of_them = {"wait_for_subscribers": 2}
        nodes.start(topics.CONTROLLER_NODE, {**plan.controller, **all_of_them})
        simulator_node = nodes.start(topics.SIM_NODE, {**plan.simulator, **all_of_them})
        began, told = time.monotonic(), 0.0

        def is_over() -> bool:
            nonlocal told
            tick = int(nodes.reports[-1]["tick"]) if nodes.reports else 0
            taken = time.monotonic() - began
            if taken > told + _REPORT_PERIOD:
                told = taken
                share = processor_time(recorder) / taken
                console.print(f"tick {tick} after {taken:.0f} s; the recorder has {share:.0%}")
            return simulator_node.exit_code is not None  # then all who listen have all

        nodes.wait_until(is_over, patience=_PATIENCE)
        taken = time.monotonic() - began
        console.print(
            f"{plan.ticks} ticks of {1000 / RATE:g} ms in {taken:.0f} s: "
            f"{plan.ticks / taken:.0f} a second; the recorder had "
            f"{processor_time(recorder) / taken:.0%} of a core"
        )
        if recorder.end(signal.SIGINT):
            raise RuntimeError(f"the recorder failed: {recorder.last_words()}")
        return plan.ticks


def missing(directory: Path, ticks: int, *, lockstep: bool) -> list[str]:
    """What is not in the bag though it was published, in sentences.

    A state that is published again is the same bytes, and counts once.
    """
    counts, last = Counter[str](), dict[str, bytes]()
    for message in read_messages(directory / BAG):
        if last.get(message.topic) != message.raw:
            counts[message.topic] += 1
            last[message.topic] = message.raw
    summary, _ = read_metrics(directory)
    problems = [f"{name}: {count} lost" for name, count in summary["lost_messages"].items()]
    expected = {topic.name: ticks + 1 for topic in _OF_STATES}
    if lockstep:
        expected |= {topic.of(topics.CONTROLLER_NODE).name: ticks for topic in _OF_ANSWERS}
    for relative, least in expected.items():
        name = "/" + relative.lstrip("/")
        if not least <= counts[name] <= ticks + 1:
            problems.append(f"{name}: {counts[name]} messages instead of {least}")
    return problems


if __name__ == "__main__":
    sys.exit(main())
