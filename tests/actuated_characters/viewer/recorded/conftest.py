"""What the tests of a recorded run's page share: the viewer of their run `walk`, and a browser."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.browser import Browser, one_browser
from tests.support.ros import Process, Processes


@pytest.fixture
def viewer(processes: Processes, walk: Path) -> Process:
    return processes.command("view", str(walk))


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    with one_browser(tmp_path) as browser:
        yield browser
