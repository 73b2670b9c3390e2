"""The command: boundaries that theory knows, and bags that replay."""

import csv
import math
import subprocess
import sys
from pathlib import Path

import pytest

from actuated_characters.bags.recording import read_recordings
from actuated_characters.replay.replay import replay
from tests.support.programs import PROJECT

pytest.importorskip("distributed")
pytestmark = [pytest.mark.slow, pytest.mark.sharing]

MASS, STIFFNESS, GRAVITY = 1.0, 100.0, 9.81  # kg, N/m, m/s^2: of `lift`, critically damped
FILE = """
run:
  character: lift
  reference: hold
  duration: 2.0
  push: "impulse={impulse} from=above at=1.5 target=mass"
set: {sim_node.rate: 1000, sim_node.wrench_duration: 0.001}
search:
  value: impulse
  from: 0.0
  to: 6.0
  within: 0.02
  steps: 3
  fails: {slider_error_max_m: 0.2}
"""


def search(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    program = [sys.executable, "-m", "actuated_characters.cli", "search"]
    return subprocess.run(
        [*program, str(folder / "lift.yaml"), "--output", str(folder / "out"), *options],
        cwd=PROJECT,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def test_the_blow_that_lowers_a_mass_too_far_is_that_of_theory(tmp_path: Path) -> None:
    """A blow J on a critically damped mass moves it by J / (m w e) at most, from where it rests."""
    (tmp_path / "lift.yaml").write_text(FILE)

    done = search(tmp_path, "--workers", "1")

    assert done.returncode == 0, done.stderr
    with (tmp_path / "out" / "boundary.csv").open() as file:
        (record,) = csv.DictReader(file)
    rest = MASS * GRAVITY / STIFFNESS
    expected = (0.2 - rest) * MASS * math.sqrt(STIFFNESS / MASS) * math.e  # N s
    assert float(record["holds"]) < float(record["fails"]) <= float(record["holds"]) + 0.02
    assert float(record["fails"]) == pytest.approx(expected, rel=0.03)
    bag = tmp_path / "out" / "rows" / f"{int(record['row']):05d}"
    assert replay(read_recordings(bag)).identical
    assert "slider_error_max_m is above 0.2" in done.stdout
    again = search(tmp_path, "--workers", "1")
    assert again.returncode == 0
    assert again.stdout == done.stdout


@pytest.mark.nightly
def test_a_search_is_not_taken_for_another_one(tmp_path: Path) -> None:
    (tmp_path / "lift.yaml").write_text(FILE.replace("to: 6.0", "to: 0.1"))
    assert search(tmp_path, "--workers", "1").returncode == 0
    (tmp_path / "lift.yaml").write_text(FILE.replace("to: 6.0", "to: 0.1").replace("0.2}", "0.3}"))

    other = search(tmp_path, "--workers", "1")

    assert other.returncode == 1
    assert f"{tmp_path / 'out' / 'rows.jsonl'} is of another " in other.stderr
    assert search(tmp_path, "--workers", "1", "--again").returncode == 0
