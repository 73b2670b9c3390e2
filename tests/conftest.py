"""Fixtures of the tests that start nodes: a ROS domain of their own, processes, clients."""

import gc
import os
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from hypothesis import settings
from rclpy.context import Context

from actuated_characters.runs.ros_domain import own_domain
from tests.support.ros import DDS_PROFILES, RANGE, ControllerClient, Processes, SimulatorClient

# It is read once, when a process makes its first node, which may be in any test.
os.environ[DDS_PROFILES] = str(
    Path(__file__).parents[1] / "msgs_config/runtime/fastdds_localhost.xml"
)

# The key that seals keyframes is one of the tests alone, also where there is no home.
STATE_HOME = tempfile.TemporaryDirectory(prefix="actuated-characters-tests-")
os.environ["XDG_STATE_HOME"] = STATE_HOME.name

# On a machine that is busy with other things an example takes as long as it takes.
settings.register_profile("any load", deadline=None)
settings.load_profile("any load")


def pytest_xdist_auto_num_workers() -> int:
    """Half as many workers again as processors: many tests wait for processes, and for times."""
    processors = len(os.sched_getaffinity(0))
    return processors + (processors + 1) // 2


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put first those that share what takes long to make.

    A worker begins with the first tests of its part, and another one that is idle takes over the
    last ones: it would have to make again what they share.
    """
    items.sort(key=lambda item: item.get_closest_marker("sharing") is None)


def pytest_collection_finish() -> None:
    """Spare the collector of garbage what lives until the end: thousands of tests, all modules."""
    gc.collect()
    gc.freeze()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the tests in a browser that did not run, where there is none."""
    skipped = terminalreporter.stats.get("skipped", ())
    if not skipped:
        return
    from tests.support.browser import NO_CHROMIUM

    names = [report.nodeid for report in skipped if NO_CHROMIUM in str(report.longrepr)]
    if names:
        terminalreporter.section(f"{len(names)} tests in a browser {NO_CHROMIUM}")
        for name in sorted(names):
            terminalreporter.line(name)


@pytest.fixture(scope="session")
def domain() -> Iterator[int]:
    """A ROS domain that nobody else on this machine uses; the tests' processes inherit it."""
    with own_domain() as number, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(number))
        patch.setenv(RANGE, "SYSTEM_DEFAULT")  # what LOCALHOST means is in that file
        yield number


@pytest.fixture(scope="session")
def context(domain: int) -> Iterator[Context]:
    """The test process's own part in the domain."""
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    yield context
    context.try_shutdown()


@pytest.fixture
def processes(domain: int, tmp_path: Path) -> Iterator[Processes]:
    """Starts processes that end with the test."""
    del domain
    started = Processes(tmp_path)
    yield started
    started.end()


@pytest.fixture
def client(context: Context) -> Iterator[SimulatorClient]:
    """A node that stands where a controller stands."""
    client = SimulatorClient(context)
    yield client
    client.close()


@pytest.fixture
def simulator(context: Context) -> Iterator[ControllerClient]:
    """A node that stands where the simulator stands."""
    client = ControllerClient(context)
    yield client
    client.close()


@pytest.fixture
def own_handlers() -> Iterator[None]:
    """`main` sets the handlers of signals; afterwards they are as before."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)
