"""What the tests of the physics share: the engines."""

import pytest

from sim_node.physics.engine import DEFAULT_ENGINE, ENGINES


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Each engine in turn, which all worlds of the test are simulated by unless it says which."""
    monkeypatch.setitem(ENGINES, DEFAULT_ENGINE, ENGINES[request.param])
    return str(request.param)
