"""Fixtures of the tests of the simulator's node."""

from collections.abc import Callable, Iterator

import pytest
from rclpy.context import Context

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
