"""Another package's module in place of one of ours is said, once, and nothing else changes."""

import os
from pathlib import Path

import pytest

from msgs_config.runtime.shadowing import shadowed_packages
from tests.support.ros import Processes

pytestmark = pytest.mark.slow


def test_here_nothing_is_shadowed() -> None:
    assert shadowed_packages() == []


def test_a_node_says_which_package_stands_in_the_place_of_another(
    processes: Processes, tmp_path: Path
) -> None:
    other = tmp_path / "theirs" / "sim_node"
    other.mkdir(parents=True)
    (other / "__init__.py").write_text("")
    path = os.pathsep.join([str(other.parent), *filter(None, [os.environ.get("PYTHONPATH")])])

    node = processes.python(
        "-P",
        "-m",
        "controller_node.main",
        "--help",
        environment={**os.environ, "PYTHONPATH": path},
    )

    assert node.wait() == 0
    (line,) = node.stderr.splitlines()
    assert line.startswith(f"warning: Python finds another 'sim_node' first, {other}")
