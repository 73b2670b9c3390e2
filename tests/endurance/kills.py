"""Kills the recorder at random moments, and checks the bags that a recovery makes of the rest.

A humanoid is simulated in real time all the while. Each recorder joins it, says what it has
flushed, and is killed; what it recorded must come back whole, without a gap, up to what was flushed
at least.

A recorder that is killed while it holds the lock of its port in shared memory leaves that port
unusable. Fast DDS makes another for the next process, of which those that were there before do not
learn: that process hears nothing. Such deaf ones are counted, and another recorder is started.
"""

import argparse
import os
import re
import shutil
import signal
import struct
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from msgs_config.runtime.process import limit_threads

limit_threads()

import numpy as np  # noqa: E402 - after the limit on threads
from mcap.reader import make_reader  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.table import Table  # noqa: E402
from rosbags.highlevel import AnyReader  # noqa: E402

from actuated_characters.bags.format.metadata import BAG  # noqa: E402
from actuated_characters.bags.format.storage import COMPRESSIONS  # noqa: E402
from actuated_characters.recorder.recovery import recover  # noqa: E402
from actuated_characters.runs.plan import make_plan  # noqa: E402
from actuated_characters.runs.processes import Child  # noqa: E402
from actuated_characters.runs.ros_domain import own_domain  # noqa: E402
from benchmarks.support.nodes import Nodes  # noqa: E402
from msgs_config.errors import RecordingError  # noqa: E402
from msgs_config.messages import topics  # noqa: E402
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND, TickClock  # noqa: E402

_RATE = 500  # Hz: in real time a machine that cannot keep up loses messages, killed or not
_LONGEST = 3.0  # s that a recorder lives, from when it has heard a state
_PATIENCE = 30.0  # s for its start; longer than Fast DDS remembers the dead
_MOST_DEAF = 3  # recorders in a row
_POLL_PERIOD = 0.002  # s
_MOST_LOST = 1.0  # s before a recorder's last word that may be lost
_STATES = f"/{topics.JOINT_STATES.name}"
_FIRST_STATE = re.compile(r"^tick [1-9]\d*$", re.MULTILINE)
_CUT_OFF = re.compile(r"bag\.mcap: bytes cut off \(\d+\)")  # of a write; it was never flushed
_STAMP = struct.Struct("<4xiI")  # of the header that a message begins with: CDR, little-endian


@dataclass
class _Found:
    """The recorders of one compression."""

    recovered: int = 0
    deaf: int = 0  # heard nothing, and had nothing to lose
    too_early: int = 0  # killed before anything was flushed, and nothing was there
    ticks: int = 0
    most_lost: float = 0.0  # s between the last message that was kept and the last word
    problems: list[str] = field(default_factory=list)


def kill_recorders(count: int, seed: int, console: Console) -> dict[str, _Found]:
    """Kill so many recorders, of each compression in turn."""
    rng = np.random.default_rng(seed)
    found = {kind: _Found() for kind in COMPRESSIONS}
    with Nodes() as nodes, tempfile.TemporaryDirectory() as scratch:
        # In lockstep the simulator would wait for a dead subscriber; a ragdoll never diverges.
        settings = {"mode": "realtime", "rate": _RATE}
        plan = make_plan("humanoid", 1.0, {"reference": "hold"}, settings, {"law": "zero"})
        nodes.start(topics.SIM_NODE, {**plan.simulator, "max_ticks": 0})
        nodes.start(topics.CONTROLLER_NODE, plan.controller)
        for number in range(count):
            kind = COMPRESSIONS[number % len(COMPRESSIONS)]
            run = Path(scratch) / "run"
            try:
                for _ in range(_MOST_DEAF):
                    shutil.rmtree(run, ignore_errors=True)
                    if _kill_one(nodes, run, kind, rng.uniform(0.0, _LONGEST), found[kind]):
                        break
                else:
                    raise RuntimeError(f"{_MOST_DEAF} recorders in a row heard nothing")
            except Exception as error:  # a reader of others raises what it likes
                found[kind].problems.append(f"{type(error).__name__}: {error}")
            if number % 10 == 9:
                console.print(f"{number + 1} of {count}")
    return found


def _kill_one(nodes: Nodes, run: Path, compression: str, life: float, found: _Found) -> bool:
    """Start a recorder, kill it and recover what it leaves; False if it was a deaf one."""
    parameters = {"directory": str(run), "compression": compression}
    recorder = nodes.start(topics.RECORDER_NODE, {**parameters, "progress_period": 0.1})
    output, spoke_at = _kill(recorder, life)
    if not _FIRST_STATE.search(output):
        found.deaf += 1
        return False
    complete = output[: output.rfind("\n") + 1].splitlines()
    flushed = [int(line.split()[1]) for line in complete if line.startswith("flushed ")]
    last_flushed = max(flushed, default=0)
    try:
        recovered = recover(run)
    except RecordingError as error:
        if last_flushed or "no message reached the disk" not in str(error):
            raise
        found.too_early += 1
        return True
    if recovered.damaged is None:
        raise RuntimeError("the bag of a killed recorder is complete")
    _check(run / BAG, recovered.contents.counts, last_flushed, found)
    found.recovered += 1
    unreadable = [part for part in recovered.contents.unreadable if not _CUT_OFF.fullmatch(part)]
    if unreadable:
        raise RuntimeError(f"unreadable: {'; '.join(unreadable)}")
    if last_flushed:  # else there are only latched messages, as old as they may be
        gap = spoke_at - recovered.contents.last_log_time_ns / NANOSECONDS_PER_SECOND
        found.most_lost = max(found.most_lost, gap)
        if gap > _MOST_LOST:
            raise RuntimeError(f"the last {gap:.2f} s are lost")
    return True


def _kill(recorder: Child, life: float) -> tuple[str, float]:
    """Kill a recorder so many s after it has said that it heard a state, or if it never does.

    Returns:
        All that it said, and the wall time of its last word, s: on a busy machine it may have had
        no turn since.
    """
    output, spoke_at, listens = "", 0.0, False
    deadline = time.monotonic() + _PATIENCE
    while time.monotonic() < deadline:
        if len(word := recorder.stdout) > len(output):
            output, spoke_at = word, time.time()
            if not listens and _FIRST_STATE.search(output):
                listens, deadline = True, time.monotonic() + life
        if recorder.exit_code is not None:
            raise RuntimeError(f"the recorder ended by itself: {recorder.last_words()}")
        time.sleep(_POLL_PERIOD)
    os.kill(recorder.pid, signal.SIGKILL)
    while recorder.exit_code is None:
        time.sleep(_POLL_PERIOD)
    return recorder.stdout, spoke_at


def _check(bag: Path, counts: Counter[str], last_flushed: int, found: _Found) -> None:
    """Read a bag by programs of others: every message, each state, and what was flushed.

    Raises:
        RuntimeError: something of it is missing.
    """
    clock, ticks, read = TickClock(_RATE), list[int](), Counter[str]()
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            read[connection.topic] += 1
            if connection.topic == _STATES:
                seconds, nanoseconds = _STAMP.unpack_from(raw)
                ticks.append(clock.tick(seconds * NANOSECONDS_PER_SECOND + nanoseconds))
    for file in bag.glob("*.mcap"):
        with file.open("rb") as stream:
            messages = make_reader(stream, validate_crcs=True).iter_messages()
            others = Counter(channel.topic for _, channel, _ in messages)
        if others != read:
            raise RuntimeError(f"mcap reads {others.total()} messages, rosbags {read.total()}")
    if read != counts:
        raise RuntimeError(f"recovered were {counts.total()} messages, read are {read.total()}")
    steps = np.diff(ticks)
    if steps.size and not np.isin(steps, (0, 1)).all():  # 0: a state that was published again
        where = int(steps.argmax())
        raise RuntimeError(
            f"after tick {ticks[where]} comes {ticks[where + 1]}, of {ticks[0]} to {ticks[-1]}; "
            f"{last_flushed} was flushed"
        )
    if last_flushed and (not ticks or ticks[-1] < last_flushed):
        raise RuntimeError(f"tick {last_flushed} was flushed, the last one is {ticks[-1:]}")
    found.ticks += len(ticks)


def _table(found: dict[str, _Found]) -> Table:
    table = Table(title="recorders killed", title_justify="left")
    for column in (
        "compression",
        "recovered",
        "too early",
        "deaf",
        "states",
        "lost, at most",
    ):
        table.add_column(column)
    for compression, each in found.items():
        table.add_row(
            compression,
            str(each.recovered),
            str(each.too_early),
            str(each.deaf),
            str(each.ticks),
            f"{each.most_lost:.2f} s",
        )
    return table


def main() -> int:
    """Kill, recover, and print what was found; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.endurance.kills", description=__doc__)
    parser.add_argument("--count", type=int, default=100, help="recorders to kill")
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    arguments = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    console = Console()
    with own_domain() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        found = kill_recorders(arguments.count, arguments.seed, console)
    console.print(_table(found))
    problems = [f"{kind}: {problem}" for kind, each in found.items() for problem in each.problems]
    for problem in problems:
        console.print(f"[red]{problem}", soft_wrap=True)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
