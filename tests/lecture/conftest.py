"""The runner that the tests of a module share."""

import pytest

from tests.support.in_process import InProcessRunner


@pytest.fixture(scope="module")
def runner(tmp_path_factory: pytest.TempPathFactory) -> InProcessRunner:
    return InProcessRunner(tmp_path_factory.mktemp("studies"))
