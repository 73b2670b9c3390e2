"""A recorder in bad circumstances: disks, bags that are there, pauses, and messages that are lost.

Circumstances are real ones: a limit on the size of files is what a full disk is to a process, and a
process that stands still is what a busy machine makes of it.
"""

import itertools
import json
import os
import re
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from rclpy.context import Context
from std_msgs.msg import Header

from actuated_characters.bags.reader import read_messages
from actuated_characters.bags.recording import read_recording
from actuated_characters.cli import main
from msgs_config.bus.polling import DirectSubscription
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.joint_state import JointStateDecoder
from msgs_config.messages.state import StampedState
from msgs_config.messages.topic import Quality, Topic
from sim_node.node_settings import SensingSettings
from sim_node.sensors.readers import make_readers
from tests.support.physics import simulation
from tests.support.ros import Client, Process, Processes, SimulatorClient, tick_of, wait_until

pytestmark = pytest.mark.slow

FULL_AT = 200_000  # bytes: more than the figures of a short run, less than its bag
TICKS = 480
LONG = 4000  # ticks
RUN = ("run", "--character", "pendulum", "--duration", "2")
LIMITED = (
    "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, ({0}, {0})); "
    "from actuated_characters.cli import main; sys.exit(main(sys.argv[1:]))"
)
MOST_UNACKNOWLEDGED = 1200  # ticks: the simulator looks each 1000
ENOUGH = 2000  # ticks: some before and after those
STILL = 1.0  # s without a tick, that say that the simulator waits
SLOW = 120.0  # s that thousands of ticks may take on a machine that is busy with other things
BEGIN, END = "before_the_flood", "after_the_flood"  # in no message definition
FLOOD = 4000  # messages, many more than the middleware has room for while nobody takes them


def summary_of(directory: Path) -> dict[str, Any]:
    return dict(json.loads((directory / "summary.json").read_text()))


# The disk


def test_on_a_full_disk_the_simulation_goes_on_and_is_measured(
    processes: Processes, tmp_path: Path
) -> None:
    run = processes.python("-c", LIMITED.format(FULL_AT), *RUN, "--output", "run")

    assert run.wait(120.0) == 1

    (error,) = [line for line in run.stderr.splitlines() if line.startswith("error: ")]
    bag = tmp_path / "run" / "bag"
    assert error == (
        f"error: recorder failed: recording {bag} is incomplete, cannot write: File too large"
    )
    assert summary_of(tmp_path / "run")["ticks"] == TICKS
    assert (bag / "bag.mcap").stat().st_size <= FULL_AT


@pytest.mark.parametrize("where", ["below a file", "read-only"])
def test_a_directory_that_cannot_be_written_to_is_one_clear_line(
    processes: Processes, tmp_path: Path, where: str
) -> None:
    (tmp_path / "file").write_text("mine")
    directory = {"below a file": str(tmp_path / "file" / "run"), "read-only": "/proc/run"}[where]

    recorder = processes.node(topics.RECORDER_NODE, directory=directory)
    run = processes.command(*RUN, "--output", directory)

    assert recorder.wait() == run.wait() == 1
    assert only_line(recorder).startswith(f"error: cannot create recording {directory}/bag: ")
    assert only_line(run).startswith(f"error: cannot write to {directory}: ")
    assert (tmp_path / "file").read_text() == "mine"


def test_a_bag_that_is_there_already_is_never_touched(processes: Processes, tmp_path: Path) -> None:
    (tmp_path / "run" / "bag").mkdir(parents=True)
    (tmp_path / "run" / "bag" / "bag.mcap").write_text("of years")

    recorder = processes.node(topics.RECORDER_NODE, directory="run")

    assert recorder.wait() == 1
    assert "recording run/bag exists already" in only_line(recorder)
    assert [path.name for path in (tmp_path / "run").rglob("*")] == ["bag", "bag.mcap"]
    assert (tmp_path / "run" / "bag" / "bag.mcap").read_text() == "of years"


def test_a_recorder_that_hears_no_simulator_fails_in_a_line(
    processes: Processes, tmp_path: Path
) -> None:
    recorder = processes.node(topics.RECORDER_NODE, directory=str(tmp_path / "run"))
    wait_until(lambda: "recording to" in recorder.stderr, "the recorder")

    assert recorder.end(signal.SIGINT) == 1
    assert recorder.stderr.splitlines()[-1] == "error: no simulator was heard"


def test_a_recorder_without_a_tick_fails_in_a_line(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    recorder = processes.node(
        topics.RECORDER_NODE, directory=str(tmp_path / "run"), progress_period=0.05
    )
    processes.simulator("pendulum")
    client.first_state(2)
    wait_until(lambda: "tick 1" in recorder.stdout, "a state that the recorder has heard")

    assert recorder.end(signal.SIGINT) == 1
    line = recorder.stderr.splitlines()[-1]
    assert line == "error: no tick was recorded: the simulator's first state had no answer"
    assert summary_of(tmp_path / "run")["ticks"] == 0


def test_a_recorder_of_bounded_size_measures_all_and_keeps_the_last_states(
    processes: Processes, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    recorder = processes.node(topics.RECORDER_NODE, directory=str(run), last_megabytes=1.0)
    loop = processes.composed(
        # Keyframes are not made before the recorder is known to hear them, which takes seconds
        # on a busy machine.
        {
            "max_ticks": LONG,
            "wait_for_subscribers": 2,
            "keyframe_period": 0.5,
            "real_time_factor": 2.0,
        },
        {"wait_for_subscribers": 2},
    )

    assert loop.wait(SLOW) == 0, loop.stderr
    assert recorder.end(signal.SIGINT, SLOW) == 0, recorder.stderr

    assert summary_of(run)["ticks"] == LONG
    recording = read_recording(run)
    assert recording.skipped_states
    assert recording.keyframe is not None
    assert len(recording.effort) < LONG
    assert tick_of_stamp(int(recording.stamps_ns[-1])) == LONG + 1
    size = sum(len(message.raw) for message in read_messages(run / "bag"))
    assert 1.0e6 < size < 2.2e6
    assert not (run / "bag-earlier").exists()
    replaying = processes.command("replay", str(run))
    assert replaying.wait() == 0, replaying.stderr
    assert "identical" in replaying.stdout


def tick_of_stamp(stamp_ns: int) -> int:
    return TickClock(240).tick(stamp_ns)


def only_line(process: Process) -> str:
    (line,) = process.stderr.splitlines()
    return line


@pytest.mark.nightly
def test_a_run_stores_and_compresses_its_bag_as_it_is_told(
    processes: Processes, tmp_path: Path
) -> None:
    how = ("--compression", "zstd", "--exclude", "contacts")
    run = processes.command(*RUN, *how, "--topic", "/mine", "--output", "run")

    assert run.wait(120.0) == 0, run.stderr

    with (tmp_path / "run" / "bag" / "bag.mcap").open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary is not None and {each.compression for each in summary.chunk_indexes} == {"zstd"}
    assert "/contacts" not in {channel.topic for channel in summary.channels.values()}
    assert "'/mine' had no publisher" in (tmp_path / "run/logs/recorder.log").read_text()
    states = read_messages(tmp_path / "run" / "bag", ["/joint_states"])
    ticks = dict.fromkeys(tick_of(message.decode()) for message in states)
    assert list(ticks) == list(range(1, TICKS + 2))


def test_a_run_records_the_sensors_and_the_states_alone_give_the_same_readings(
    tmp_path: Path, own_handlers: None
) -> None:
    command = ("run", "--in-process", "--character", "humanoid", "--duration", "0.5")
    sensors = ("--sensor", "imu/pelvis_imu", "--sensor", "force/right_sole")
    assert main([*command, *sensors, "--output", str(tmp_path / "run")]) == 0

    # Arrange: the states in the bag, one after the other
    bag, ticks = tmp_path / "run" / "bag", list(range(1, 122))
    recording, simulated = read_recording(bag), simulation("humanoid").simulated
    readers = {
        sensor.topic: reader
        for sensor, reader in make_readers(simulated, SensingSettings(240, 9.81, 0))
    }
    expected, before = [], None
    for stamp, position, velocity in zip(
        recording.stamps_ns.tolist(), recording.position, recording.velocity, strict=True
    ):
        simulated.state, simulated.before = StampedState(stamp, position, velocity, None), before
        before = simulated.state
        expected.append(readers["imu/pelvis_imu"].read(0).tobytes())

    # Act
    found: dict[str, dict[int, bytes]] = {}
    for message in read_messages(bag):
        if message.topic.startswith(("/imu/", "/force/")):
            found.setdefault(message.topic, {})[tick_of(message.decode())] = message.raw

    # Assert
    assert {topic: sorted(of_topic) for topic, of_topic in found.items()} == {
        "/imu/pelvis_imu": ticks,
        "/force/right_sole": ticks,
    }
    recorded = [found["/imu/pelvis_imu"][tick][-37 * 8 :] for tick in ticks]
    assert recorded == expected
    assert main(["replay", str(tmp_path / "run")]) == 0


# What is lost, and what is not


def test_what_was_flushed_is_on_the_disk_before_the_recorder_says_so(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    recorder = processes.node(topics.RECORDER_NODE, directory="run", progress_period=0.1)
    processes.simulator("pendulum", wait_for_subscribers=2)
    state = client.advance(client.first_state(listeners=2), {})
    while tick_of(state) < 30:
        state = client.advance(state, {})

    def flushed() -> int:
        return max(map(int, re.findall(r"^flushed (\d+)$", recorder.stdout, re.M)), default=0)

    client.spin_until(lambda: flushed() >= 30, "a flush")
    recorder.send(signal.SIGKILL)

    recorder.wait()
    assert (tmp_path / "run" / "bag" / "bag.mcap").read_bytes().count(b"hinge") >= 30


class Watcher:
    """Hears which tick it is, without the executor, which is slower than the loop."""

    def __init__(self, context: Context) -> None:
        self._client = Client(context, "watcher")
        self._states = DirectSubscription(self._client.node, topics.JOINT_STATES.for_listener())
        self._decoder = JointStateDecoder()
        self.tick = 0
        self.since = time.monotonic()

    def close(self) -> None:
        self._client.close()

    def look(self) -> None:
        """Take all states that have come."""
        while (raw := self._states.take()) is not None:
            self.tick = round(self._decoder.decode(raw).stamp_ns * 240 / 1e9)
            self.since = time.monotonic()
        time.sleep(0.002)

    @property
    def stands_still(self) -> bool:
        """Whether no state has come for a while."""
        return time.monotonic() - self.since > STILL


@pytest.fixture
def watcher(context: Context) -> Iterator[Watcher]:
    watcher = Watcher(context)
    yield watcher
    watcher.close()


def test_a_recorder_that_stands_still_holds_the_simulation_and_loses_nothing(
    processes: Processes, watcher: Watcher, tmp_path: Path
) -> None:
    recorder = processes.node(topics.RECORDER_NODE, directory="run")
    processes.controller("pendulum", wait_for_subscribers=2)
    simulator = processes.simulator("pendulum", max_ticks=ENOUGH, wait_for_subscribers=3)
    wait_until(lambda: watcher.tick > 300, "ticks", SLOW, watcher.look)

    recorder.send(signal.SIGSTOP)
    stopped_at = watcher.tick
    wait_until(lambda: watcher.stands_still, "a simulator that waits", SLOW, watcher.look)
    held_at = watcher.tick
    recorder.send(signal.SIGCONT)
    wait_until(lambda: simulator.exit_code is not None, "the end", SLOW, watcher.look)
    recorder.send(signal.SIGINT)

    assert held_at - stopped_at < MOST_UNACKNOWLEDGED
    assert simulator.wait() == recorder.wait() == 0
    assert summary_of(tmp_path / "run")["ticks"] == ENOUGH
    assert summary_of(tmp_path / "run")["lost_messages"] == {}


def test_no_thread_of_a_recorder_interrupts_who_works(processes: Processes, tmp_path: Path) -> None:
    recorder = processes.node(topics.RECORDER_NODE, directory="run")
    wait_until((tmp_path / "run" / "bag").is_dir, "a recorder")

    threads = [int(thread) for thread in os.listdir(f"/proc/{recorder.pid}/task")]

    assert len(threads) > 1  # those of the middleware as well
    assert {os.sched_getscheduler(thread) for thread in threads} == {os.SCHED_BATCH}


def test_messages_that_were_lost_are_counted_by_topic_and_said(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    # Arrange: nobody sends again what a best-effort topic has lost
    flood = client.speak(Topic("flood", "std_msgs/msg/Header", Quality(10, is_reliable=False)))
    recorder = processes.node(topics.RECORDER_NODE, directory="run", topics=["flood"])
    processes.simulator("pendulum", wait_for_subscribers=2)
    state = client.first_state(listeners=2)
    client.spin_until(flood.get_subscription_count, "a recorder")

    numbers = itertools.count()
    file = tmp_path / "run" / "bag" / "bag.mcap"

    def send(kind: str) -> None:
        flood.publish(Header(frame_id=f"{kind} {next(numbers)}"))

    # Act
    client.spin_sending(
        lambda: send(BEGIN), lambda: BEGIN.encode() in file.read_bytes(), "a message in the bag"
    )
    recorder.send(signal.SIGSTOP)
    stopped = Path(f"/proc/{recorder.pid}/stat")
    wait_until(lambda: stopped.read_text().rpartition(")")[2].split()[0] == "T", "its stop")
    for _ in range(FLOOD):
        send("flood")
    recorder.send(signal.SIGCONT)
    client.spin_sending(
        lambda: send(END), lambda: END.encode() in file.read_bytes(), "the flood's end in the bag"
    )
    client.advance(state, {})
    recorder.send(signal.SIGINT)

    # Assert
    assert recorder.wait() == 0
    bag = read_messages(tmp_path / "run" / "bag", ["/flood"])
    found = [int(message.decode().frame_id.split()[1]) for message in bag]
    missing = found[-1] - found[0] + 1 - len(found)
    assert missing > 0
    assert summary_of(tmp_path / "run")["lost_messages"] == {"/flood": missing}
    assert f"'/flood': {missing} messages lost" in recorder.stderr
