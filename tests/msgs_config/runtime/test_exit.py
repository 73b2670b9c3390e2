"""A signal ends every process promptly, well, and without a trace, whatever it is doing."""

import os
import re
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context

from actuated_characters.bags.reader import read_messages
from actuated_characters.runs.ros_domain import own_domain
from msgs_config.messages import topics
from msgs_config.runtime.process import LEAVE_TIME
from tests.support.engines import BULLET_IS_INSTALLED
from tests.support.ros import PATIENCE, Process, Processes, SimulatorClient, wait_until
from tests.support.runs import Run

pytestmark = pytest.mark.slow

PROJECT = Path(__file__).parents[3]
SIGNALS = [signal.SIGINT, signal.SIGTERM]
SHARED_MEMORY = Path("/dev/shm")
OF_NO_DOMAIN = re.compile(r"fastrtps_port7[0-3]\d\d(\D|$)")  # those of domains begin at 7400
A_PORT = re.compile(r"fastrtps_port\d+")
PROMPTLY = 1.0  # s
BEHINDHAND = 20.0  # s; what had come before is still taken, up to 50,000 messages
WHILE_STARTING = 3.0  # s; a library may have to finish something first
A_FEW_STATES = 50
SECONDS = 5.0  # s that a run of several processes may take
INTERRUPTED = 130  # exit code of a command


@pytest.fixture
def own_graph(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A domain without the tests' own node, which would keep open what others have left."""
    with own_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield domain


@pytest.fixture
def processes(domain: int, tmp_path: Path) -> Iterator[Processes]:
    """Starts processes that begin as they do for a user, which matters while they start."""
    del domain
    started = Processes(tmp_path, fresh=True)
    yield started
    started.end()


@pytest.fixture
def forked(domain: int, tmp_path: Path) -> Iterator[Processes]:
    """Starts processes that are soon there; how those end that are not `fresh` is not looked at."""
    del domain
    started = Processes(tmp_path)
    yield started
    started.end()


@contextmanager
def observer(domain: int) -> Iterator[SimulatorClient]:
    """A client that leaves the graph again."""
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    client = SimulatorClient(context)
    try:
        yield client
    finally:
        client.close()
        context.try_shutdown()


def belongings(pid: int) -> set[Path]:
    """The files of Fast DDS in shared memory that a process has mapped or open, locks too.

    Without those of ports that are of no domain: other tests' processes have them as well, and some
    of those are killed.
    """
    names = set[str]()
    with suppress(OSError):  # it has ended, or closed a file meanwhile
        names |= {line.split()[-1] for line in Path(f"/proc/{pid}/maps").read_text().splitlines()}
        names |= {os.readlink(link) for link in Path(f"/proc/{pid}/fd").iterdir()}
    shared = {Path(name) for name in names if name.startswith(f"{SHARED_MEMORY}/")}
    return {
        path for path in shared if "fastrtps_" in path.name and not OF_NO_DOMAIN.search(path.name)
    }


def waited_for_a_processor(pid: int) -> float:
    """Seconds that its main thread was ready to work while others had the processors."""
    with suppress(OSError):  # it has ended
        return 1e-9 * int(Path(f"/proc/{pid}/schedstat").read_text("ascii").split()[1])
    return 0.0


def briefly() -> None:
    """Let some time pass: less than a stage of a start takes."""
    time.sleep(0.001)


def living() -> list[int]:
    return [int(entry.name) for entry in Path("/proc").glob("[0-9]*")]


def left_behind(files: set[Path]) -> set[Path]:
    """Those that are still there, and nobody's; some are shared by all on this machine.

    Without ports whose lock is gone. Their reader has closed them in good order; Fast DDS removes
    the file only where at the last close the port is well and its mutex free, which a busy machine
    can spoil, and whoever opens the port next recreates it.
    """
    there = {file for file in files if file.exists()}.difference(*map(belongings, living()))
    return {
        file
        for file in there
        if not A_PORT.fullmatch(file.name) or file.with_name(f"{file.name}_el").exists()
    }


class Ending:
    """The end of a process by signals: what belonged to it until its very end, and its time."""

    def __init__(self, process: Process, *numbers: signal.Signals) -> None:
        """Send the signals."""
        self.files = belongings(process.pid)
        self._process, self._numbers = process, numbers
        self._waited_before = self._waited = waited_for_a_processor(process.pid)
        self._begin, self._took = time.monotonic(), 0.0
        for number in numbers:
            process.send(number)

    def is_over(self) -> bool:
        """Look at it once more."""
        self.files.update(belongings(self._process.pid))
        self._waited = max(self._waited, waited_for_a_processor(self._process.pid))
        if self._process.exit_code is not None and not self._took:
            self._took = time.monotonic() - self._begin
        return bool(self._took)

    def was_the_last_resort(self) -> bool:
        """Whether it is the end of a process that its middleware did not let leave."""
        return self._took - self._others > LEAVE_TIME

    @property
    def _others(self) -> float:
        return self._waited - self._waited_before

    def assert_took_less_than(self, within: float) -> None:
        """It took less than some seconds, without those in which others had the processors."""
        took = self._took - self._others
        assert took < within, f"took {took:.2f} s, {self._others:.2f} s of others not counted"


def end(process: Process, *numbers: signal.Signals) -> Ending:
    """End a process well by signals."""
    ending = Ending(process, *numbers)
    wait_until(ending.is_over, f"the end after {numbers}", PATIENCE + BEHINDHAND)
    assert_ended_well(process)
    return ending


def session_of(process: Process) -> list[int]:
    """The processes that a process has started and that live, itself included."""
    found = []
    for pid in living():
        with suppress(ProcessLookupError):
            if os.getsid(pid) == process.pid:
                found.append(pid)
    return found


def assert_ended_well(process: Process) -> None:
    assert process.exit_code == 0
    assert "Traceback" not in process.stderr
    assert "error" not in process.stderr.lower()
    assert session_of(process) == []


# In the middle of something


def hear_states(client: SimulatorClient) -> None:
    client.spin_until(lambda: len(client.states) >= A_FEW_STATES, "states")


def publishing(processes: Processes, client: SimulatorClient) -> Process:
    simulator = processes.simulator(fresh=True)
    client.first_state()
    return simulator


def waiting_for_subscribers(processes: Processes, client: SimulatorClient) -> Process:
    simulator = processes.simulator(fresh=True, wait_for_subscribers=9)
    client.spin_until(lambda: client.configuration.messages, "configuration")
    return simulator


def running(processes: Processes, client: SimulatorClient, *, fresh: bool = True) -> Process:
    processes.controller()
    simulator = processes.simulator(fresh=fresh)
    hear_states(client)
    return simulator


def paused(processes: Processes, client: SimulatorClient) -> Process:
    simulator = running(processes, client)
    assert client.pause(True).success
    return simulator


def in_real_time(processes: Processes, client: SimulatorClient) -> Process:
    simulator = processes.simulator(fresh=True, mode="realtime")
    hear_states(client)
    return simulator


def slowed_down(processes: Processes, client: SimulatorClient) -> Process:
    slowly = {"mode": "realtime", "real_time_factor": 0.001, "wait_for_subscribers": 1}
    simulator = processes.simulator(fresh=True, **slowly)
    client.first_state()
    return simulator


def idle(processes: Processes, client: SimulatorClient) -> Process:
    configuration = client.listen(topics.CONFIGURATION.of(topics.CONTROLLER_NODE))
    controller = processes.controller(fresh=True)
    client.spin_until(lambda: configuration.messages, "configuration")
    return controller


def answering(processes: Processes, client: SimulatorClient) -> Process:
    processes.simulator()
    controller = processes.controller(fresh=True)
    hear_states(client)
    return controller


def composed(processes: Processes, client: SimulatorClient) -> Process:
    both = processes.composed(fresh=True)
    hear_states(client)
    return both


def recording(processes: Processes, client: SimulatorClient) -> Process:
    told = {"directory": f"recording_{time.monotonic_ns()}", "progress_period": 0.05}
    recorder = processes.node("recorder", fresh=True, **told)
    running(processes, client, fresh=False)
    client.spin_until(lambda: re.search(r"tick \d\d", recorder.stdout), "ticks")
    return recorder


Situation = Callable[[Processes, SimulatorClient], Process]
SITUATIONS: list[Situation] = [
    publishing,
    waiting_for_subscribers,
    running,
    paused,
    in_real_time,
    slowed_down,
    idle,
    answering,
    composed,
    recording,
]


def assert_ends_well(
    processes: Processes, domain: int, situation: Situation, *numbers: signal.Signals
) -> None:
    """Promptly, and without a trace.

    Seldom a participant that leaves waits in Fast DDS for itself (its issues 6193 and 6502), until
    our last resort. Twice in a row is taken for a fault of ours.
    """
    for _ in range(2):
        before = set(SHARED_MEMORY.iterdir())  # by others, some of whom may have been killed
        with observer(domain) as client:
            ending = end(situation(processes, client), *numbers)
            processes.end()
        if not ending.was_the_last_resort():
            break
    ending.assert_took_less_than(PROMPTLY)
    assert ending.files - before
    assert not left_behind(ending.files - before)


@pytest.mark.parametrize(
    ("situation", "number"),
    [
        pytest.param(each, number, marks=[] if (at + number) % 2 else pytest.mark.nightly)
        for at, each in enumerate(SITUATIONS)
        for number in SIGNALS
    ],
)
def test_a_signal_ends_a_node_within_a_second_and_leaves_nothing_behind(
    forked: Processes, own_graph: int, situation: Situation, number: signal.Signals
) -> None:
    assert_ends_well(forked, own_graph, situation, number)


@pytest.mark.parametrize("situation", [running, composed, recording])
def test_more_signals_disturb_nothing(
    forked: Processes, own_graph: int, situation: Situation
) -> None:
    signals = signal.SIGINT, signal.SIGTERM, signal.SIGINT
    assert_ends_well(forked, own_graph, situation, *signals)


FLOODS = 2  # already twice as much as the recorder can take
FLOODING = """
import rclpy
from std_msgs.msg import Header

rclpy.init()
node = rclpy.create_node("flooding")
publisher = node.create_publisher(Header, "flood", 1000)
while rclpy.ok():
    publisher.publish(Header())
"""


@pytest.mark.nightly
def test_a_signal_ends_a_recorder_to_whom_more_comes_than_it_can_take(
    forked: Processes, own_graph: int, tmp_path: Path
) -> None:
    (tmp_path / "flooding.py").write_text(FLOODING)

    def flushes(recorder: Process) -> int:
        return recorder.stdout.count("flushed")

    with observer(own_graph) as client:
        told = {"directory": "recording", "topics": ["flood"], "progress_period": 0.05}
        recorder = forked.node("recorder", fresh=True, **told)
        running(forked, client, fresh=False)
        client.spin_until(lambda: re.search(r"tick \d\d", recorder.stdout), "ticks")
        for _ in range(FLOODS):
            forked.python("-m", "flooding")
        client.spin_until(lambda: client.node.count_subscribers("flood"), "the flood recorded")
        before = flushes(recorder)
        client.spin_until(lambda: flushes(recorder) > before + 2, "flushes")

        end(recorder, signal.SIGTERM).assert_took_less_than(BEHINDHAND)
    recorded = sum(1 for _ in read_messages(tmp_path / "recording" / "bag", ["/flood"]))
    assert recorded > A_FEW_STATES


# On its way there

ENGINE = f"/{'pybullet' if BULLET_IS_INSTALLED else 'libmujoco'}."
PARTICIPANT = "/dev/shm/fastrtps_"
COMMON_STAGES = ["", "_rclpy_pybind11", "/yaml/_yaml.", "_multiarray_umath"]
STAGES = {  # what each loads, one after the other, once it handles signals
    "sim_node": [*COMMON_STAGES, ENGINE, PARTICIPANT],
    "controller_node": [*COMMON_STAGES, "/libmujoco.", PARTICIPANT],
    "composed": [*COMMON_STAGES, *{ENGINE: 0, "/libmujoco.": 0}, PARTICIPANT],
    "recorder": COMMON_STAGES,  # once it is there, having heard nobody is an error
}


def has_come_to(process: Process, stage: str) -> bool:
    """Whether a process handles signals, and has mapped a file that a stage begins with."""
    place = Path("/proc") / str(process.pid)
    caught = re.search(r"^SigCgt:\s*(\w+)", (place / "status").read_text(), re.MULTILINE)
    assert caught is not None
    handles = all(int(caught[1], 16) >> (number - 1) & 1 for number in SIGNALS)
    return handles and stage in (place / "maps").read_text()


def marks_of(name: str, stage: str) -> list[pytest.MarkDecorator]:
    again = {"controller_node": COMMON_STAGES, "composed": STAGES["composed"][:-1]}.get(name, [])
    return [pytest.mark.nightly] if stage in again else []


@pytest.mark.parametrize(
    ("name", "stage"),
    [
        pytest.param(name, stage, marks=marks_of(name, stage))
        for name, stages in STAGES.items()
        for stage in stages
    ],
)
def test_each_signal_ends_a_node_that_is_still_starting(
    processes: Processes, own_graph: int, name: str, stage: str
) -> None:
    del own_graph
    before = set(SHARED_MEMORY.iterdir())
    start = processes.composed if name == "composed" else partial(processes.node, name)
    nodes = {number: start() for number in SIGNALS}
    endings: dict[signal.Signals, Ending] = {}

    def are_over() -> bool:
        for number, node in [*nodes.items()]:
            if number in endings or not has_come_to(node, stage):
                continue
            if name == "recorder" and has_come_to(node, PARTICIPANT):  # it was seen too late
                nodes[number] = start()
            else:
                endings[number] = Ending(node, number)
        over = [ending.is_over() for ending in endings.values()]
        return len(over) == len(nodes) and all(over)

    wait_until(are_over, f"their ends at stage {stage}", step=briefly)

    for number, node in nodes.items():
        endings[number].assert_took_less_than(WHILE_STARTING)
        assert_ended_well(node)
        assert not left_behind(endings[number].files - before)


AMID_A_TEXT = """
import os, signal
from msgs_config.runtime.process import run_node

class Node:
    def run(self, stop):
        pass

    def destroy_node(self):
        pass

def make_node():
    exec("os.kill(os.getpid(), signal.SIGTERM); [None for _ in range(10)]")
    return Node()

run_node("__main__:make_node")
"""


def test_a_signal_amid_code_from_a_text_ends_a_node_well_too(
    processes: Processes, tmp_path: Path
) -> None:
    # Dataclasses are made by such code. Python remembers a KeyboardInterrupt that has gone through
    # it, caught or not, and in the end a module that was run by `-m` is killed by SIGINT.
    (tmp_path / "amid.py").write_text(AMID_A_TEXT)

    node = processes.python("-m", "amid")
    node.wait()

    assert_ended_well(node)


# The command

ONE_SIGNAL = [SIGNALS[0], *(pytest.param(each, marks=pytest.mark.nightly) for each in SIGNALS[1:])]
RUN = ("run", "--character", "pendulum", "--duration", "1e6")


def assert_interrupted(run: Run) -> None:
    assert run.process.wait(SECONDS) == INTERRUPTED
    assert "interrupted" in run.process.stderr
    assert "Traceback" not in run.process.stderr
    assert run.family == {}


@pytest.mark.parametrize("number", ONE_SIGNAL)
@pytest.mark.parametrize("stage", ["", "_multiarray_umath", *{ENGINE: 0, "/libmujoco.": 0}])
def test_a_signal_ends_a_run_that_is_being_planned(
    processes: Processes, tmp_path: Path, stage: str, number: signal.Signals
) -> None:
    run = Run(processes, *RUN, "--output", str(tmp_path / "run"))
    wait_until(lambda: has_come_to(run.process, stage), f"stage {stage}", step=briefly)

    run.process.send(number)

    assert_interrupted(run)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("number", ONE_SIGNAL)
@pytest.mark.parametrize("count", [1, pytest.param(2, marks=pytest.mark.nightly), 3])
def test_a_signal_ends_a_run_whose_nodes_are_starting_and_its_domain_is_free_again(
    processes: Processes, tmp_path: Path, count: int, number: signal.Signals
) -> None:
    locks = tmp_path / "locks"
    locks.mkdir()
    run = Run(processes, *RUN, "--output", str(tmp_path / "run"), TMPDIR=str(locks))
    wait_until(lambda: len(run.family) > count, f"{count} nodes", step=briefly)

    run.process.send(number)

    assert_interrupted(run)
    assert [path for path in locks.rglob("*") if path.is_file()] == []


@pytest.mark.parametrize("number", ONE_SIGNAL)
def test_a_signal_ends_a_run_in_one_process(
    processes: Processes, tmp_path: Path, number: signal.Signals
) -> None:
    run = Run(processes, *RUN, "--in-process", "--output", str(tmp_path / "run"))
    begun = tmp_path / "run" / "parameters" / "controller_node.yaml"
    wait_until(begun.exists, "the begin of the run")

    run.process.send(number)

    assert_interrupted(run)
