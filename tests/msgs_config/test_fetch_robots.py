"""The shipped robots without PyBullet: what of its wheel is unpacked, and where."""

import subprocess
import zipfile
from pathlib import Path
from typing import Any

import pytest

from msgs_config import fetch_robots

FILES = {"pybullet_data/__init__.py": "", "pybullet_data/plane.urdf": "<robot/>"}
OTHERS = {"pybullet.so": "", "pybullet_data.txt": "", "pybullet_envs/__init__.py": ""}


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The calls of pip, which leaves a wheel where it is told to."""
    calls: list[list[str]] = []

    def run(command: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
        calls.append(list(command))
        folder = Path(command[command.index("--dest") + 1])
        with zipfile.ZipFile(folder / "pybullet-3.2.7-cp311.whl", "w") as wheel:
            for name, text in {**FILES, **OTHERS}.items():
                wheel.writestr(name, text)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(subprocess, "run", run)
    monkeypatch.setattr("sysconfig.get_path", lambda name: str(tmp_path / name))
    (tmp_path / "purelib").mkdir()
    return calls


def test_the_robots_alone_are_unpacked_beside_the_other_packages(
    tmp_path: Path, asked: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fetch_robots, "find_spec", lambda name: None)

    assert fetch_robots.main() == 0

    unpacked = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert {str(path.relative_to(tmp_path / "purelib")) for path in unpacked} == set(FILES)
    assert "pybullet==3.2.7" in asked[0] and "--no-deps" in asked[0]


def test_where_it_cannot_be_unpacked_is_one_line(
    tmp_path: Path,
    asked: list[list[str]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(fetch_robots, "find_spec", lambda name: None)
    (tmp_path / "purelib").rmdir()

    assert fetch_robots.main() == 1

    assert len(asked) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ") and str(tmp_path) in line


def test_what_is_there_is_not_fetched(asked: list[list[str]]) -> None:
    assert fetch_robots.main() == 0
    assert asked == []


def test_where_pip_fails_its_exit_code_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fetch_robots, "find_spec", lambda name: None)
    monkeypatch.setattr(
        subprocess, "run", lambda command, **_: subprocess.CompletedProcess(command, 3)
    )

    assert fetch_robots.main() == 3
