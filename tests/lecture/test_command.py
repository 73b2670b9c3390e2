"""The command `study`: what it leaves, what it says, what it refuses."""

import csv
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from lecture.framework.catalogue import NAMES, load_study
from tests.support.ros import PATIENCE, wait_until

pytestmark = pytest.mark.slow

COMMAND = [sys.executable, "-m", "actuated_characters.cli", "study"]


def study(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*COMMAND, *arguments], capture_output=True, text=True, timeout=8 * PATIENCE, check=False
    )


@pytest.mark.parametrize("name", NAMES)
def test_every_study_can_be_loaded_and_says_what_it_is(name: str) -> None:
    found = load_study(name)

    assert found.name == name
    assert found.title and "\n" not in found.title
    assert found.runs > 0


def test_a_study_leaves_pictures_and_a_table_and_no_runs(tmp_path: Path) -> None:
    done = study("equation", "--output", str(tmp_path))

    assert done.returncode == 0, done.stderr
    directory = tmp_path / "equation"
    png, svg = (directory / f"equation.{suffix}" for suffix in ("png", "svg"))
    assert png.read_bytes().startswith(b"\x89PNG")
    assert "<svg" in svg.read_text("utf-8")
    with (directory / "equation.csv").open(encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    assert rows and all(len(row) == len(header) for row in rows)
    assert not (directory / "runs").exists()
    assert str(directory) in done.stdout.replace("\n", "")
    progress = [line for line in done.stderr.splitlines() if line.startswith("equation: run ")]
    assert progress[0].startswith("equation: run 1 of ") and len(progress) > 1


def test_what_is_there_is_not_overwritten_unasked(tmp_path: Path) -> None:
    (tmp_path / "lift").mkdir()
    (tmp_path / "lift" / "thesis.tex").touch()

    done = study("lift", "--output", str(tmp_path))

    assert done.returncode == 1
    assert done.stderr.startswith("error: ") and "--overwrite" in done.stderr
    assert [path.name for path in (tmp_path / "lift").iterdir()] == ["thesis.tex"]


def test_an_unknown_study_is_refused_with_those_that_there_are() -> None:
    done = study("lfit")

    assert done.returncode == 2
    assert all(name in done.stderr for name in NAMES)


def test_ctrl_c_ends_a_study(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [*COMMAND, "balance", "--output", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    wait_until((tmp_path / "balance/runs/stand/bag").exists, "the first run")

    process.send_signal(signal.SIGINT)

    _, errors = process.communicate(timeout=2 * PATIENCE)
    assert process.returncode == 130
    assert "interrupted" in errors and "Traceback" not in errors
