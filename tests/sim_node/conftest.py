"""Fixtures of the tests of the simulator: its engines, and clients of its node."""

from collections.abc import Callable, Iterator

import pytest
from rclpy.context import Context

from sim_node.physics.engine import DEFAULT_ENGINE, ENGINES, INSTALLED_ENGINES
from tests.support.engines import need_engine
from tests.support.ros import SimulatorClient

Join = Callable[..., SimulatorClient]


@pytest.fixture
def join(context: Context) -> Iterator[Join]:
    """Makes more clients, by their names and, of several characters, that of their character."""
    clients: list[SimulatorClient] = []

    def make(name: str, below: str = "") -> SimulatorClient:
        clients.append(SimulatorClient(context, name, below))
        return clients[-1]

    yield make
    for client in clients:
        client.close()


@pytest.fixture(params=INSTALLED_ENGINES)
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Each engine in turn, which all worlds of the test are simulated by unless it says which."""
    need_engine(request.param)
    monkeypatch.setitem(ENGINES, DEFAULT_ENGINE, ENGINES[request.param])
    return str(request.param)
