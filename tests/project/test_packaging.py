"""What `colcon build` installs: the same call of setup.py, into a prefix of the test's own."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sim_node.physics.engine import DEFAULT_ENGINE
from tests.support.ros import Processes

PROJECT = Path(__file__).parents[2]
PACKAGE = "actuated_characters"
EXECUTABLES = {
    *("sim_node", "controller_node", "composed", "recorder", "viewer", "ros2_control_bridge"),
    PACKAGE,
}
NOT_SOURCES = (".*", "__pycache__", "*.egg-info", "build", "install", "log", "runs")
AS_COLCON_DOES = ("--single-version-externally-managed", "--record", "install.log")


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An installed package."""
    folder = tmp_path_factory.mktemp("workspace")
    sources, prefix = folder / "src", folder / "install"
    shutil.copytree(PROJECT, sources, ignore=shutil.ignore_patterns(*NOT_SOURCES))
    subprocess.run(
        [sys.executable, "setup.py", "-q", "install", "--prefix", prefix, *AS_COLCON_DOES],
        cwd=sources,
        check=True,
        capture_output=True,
    )
    return prefix


@pytest.fixture(scope="module")
def environment(prefix: Path, domain: int) -> dict[str, str]:
    """What install/setup.bash sets, once what each tick computes has been compiled."""
    del domain
    (site_packages,) = prefix.glob("lib/python3*/site-packages")
    given = {**os.environ, "AMENT_PREFIX_PATH": str(prefix), "PYTHONPATH": str(site_packages)}
    command = [
        sys.executable,
        "-c",
        f"import sim_node.node, sim_node.physics.{DEFAULT_ENGINE}.world",
    ]
    said = [
        subprocess.run(
            command, cwd=prefix, env=given, check=True, capture_output=True, text=True
        ).stderr
        for _ in range(2)
    ]
    assert said == ["compiling what is computed often, once; it takes some seconds\n", ""]
    return given


def test_executables_lie_where_ros2_run_looks_for_them(prefix: Path) -> None:
    found = {path.name: path for path in (prefix / "lib" / PACKAGE).iterdir()}

    assert set(found) == EXECUTABLES
    assert all(os.access(path, os.X_OK) for path in found.values())
    assert not (prefix / "bin").exists()


@pytest.mark.parametrize(
    "folder", ["launch", "config", "examples", "examples/trials", "examples/without_rclpy"]
)
def test_what_users_read_and_launch_is_shared(prefix: Path, folder: str) -> None:
    shipped = {path.name for path in (PROJECT / folder).iterdir() if path.is_file()}

    shared = {p.name for p in (prefix / "share" / PACKAGE / folder).iterdir() if p.is_file()}

    assert shared == shipped
    assert shared


@pytest.mark.slow
def test_the_package_is_known_to_ros(
    prefix: Path, environment: dict[str, str], processes: Processes
) -> None:
    script = (
        "from ament_index_python import get_package_share_directory as share;"
        f"print(share('{PACKAGE}'))"
    )

    known = processes.python("-c", script, environment=environment)

    assert known.wait() == 0
    assert known.stdout.strip() == str(prefix / "share" / PACKAGE)
    assert (prefix / "share" / PACKAGE / "package.xml").is_file()


def test_files_that_a_package_reads_come_with_it(environment: dict[str, str]) -> None:
    installed = Path(environment["PYTHONPATH"])
    needed = [
        path.relative_to(PROJECT)
        for path in (PROJECT / "msgs_config").rglob("*")
        if path.suffix in (".yaml", ".urdf", ".xml")
    ]

    assert needed
    assert all((installed / path).is_file() for path in needed)


@pytest.mark.slow
def test_an_installed_node_runs_with_an_installed_file(
    prefix: Path, environment: dict[str, str], processes: Processes
) -> None:
    file = prefix / "share" / PACKAGE / "config" / "franka_panda_realtime.yaml"
    program = str(prefix / "lib" / PACKAGE / "sim_node")

    node = processes.python(
        program,
        *("--ros-args", "--params-file", str(file), "-p", "max_ticks:=20"),
        environment=environment,
    )

    assert node.wait() == 0
    assert node.stderr == ""
