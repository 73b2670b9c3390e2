"""A recording as CSV is read back by Python's own reader, to the last bit."""

import csv
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.bags.writer import BagWriter
from actuated_characters.cli import main
from tests.support.bags import Made, add_to, make_run, write_bag
from tests.support.eventful import Eventful, eventful_run, write_timed

RESET_AFTER = 6


@pytest.fixture(scope="module")
def pendulum() -> Made:
    return make_run("pendulum", 0.05)


@pytest.fixture(scope="module")
def dropped() -> Eventful:
    return eventful_run("humanoid", 12, reset_after=RESET_AFTER)


def exported(*arguments: str | Path) -> int:
    return main(["export", *map(str, arguments)])


def table(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def numbers(rows: list[dict[str, str]], kind: str, names: tuple[str, ...]) -> np.ndarray:
    """The cells of a kind (rows, n); NaN where they are empty."""
    cells = [[row[f"{kind}.{name}"] for name in names] for row in rows]
    return np.array([[float(cell) if cell else np.nan for cell in row] for row in cells])


def test_every_number_is_the_messages_own(dropped: Eventful, tmp_path: Path) -> None:
    bag, file = write_timed(tmp_path / "bag", dropped.messages()), tmp_path / "states.csv"

    assert exported(bag, "--output", file) == 0

    rows, names = table(file), dropped.plan.character.layout.dof_names
    assert len(rows) == len(dropped.states) == 13
    assert [int(row["stamp_ns"]) for row in rows] == [s.stamp_ns for s in dropped.states]
    for kind in ("position", "velocity"):
        expected = np.array([getattr(state, kind) for state in dropped.states])
        assert numbers(rows, kind, names).tobytes() == expected.tobytes()
    missing = np.full(len(names), np.nan)
    expected = np.array([missing if s.effort is None else s.effort for s in dropped.states])
    np.testing.assert_array_equal(numbers(rows, "effort", names), expected)
    assert not any(column.startswith("reference") for column in rows[0])
    times = [(state.stamp_ns - dropped.states[0].stamp_ns) / 1e9 for state in dropped.states]
    assert [float(row["time_s"]) for row in rows] == pytest.approx(times, abs=1e-12)
    assert [row["episode"] for row in rows] == ["1"] * (RESET_AFTER + 1) + ["2"] * 6
    began = rows[RESET_AFTER + 1]
    assert {began[column] for column in began if column.startswith("effort.")} == {""}


def test_the_reference_comes_by_request(dropped: Eventful, tmp_path: Path) -> None:
    bag, file = write_timed(tmp_path / "bag", dropped.messages()), tmp_path / "states.csv"

    exported(bag, "--output", file, "--reference")

    rows, names = table(file), dropped.plan.character.layout.dof_names
    desired = {reference.stamp_ns: reference for reference in dropped.references}
    missing = np.full(len(names), np.nan)
    for kind in ("position", "velocity"):
        expected = np.array(
            [
                getattr(desired[s.stamp_ns], kind) if s.stamp_ns in desired else missing
                for s in dropped.states
            ]
        )
        np.testing.assert_array_equal(numbers(rows, f"reference_{kind}", names), expected)
    assert np.isnan(numbers(rows, "reference_position", names)[-1]).all()  # nobody answered it


def test_a_file_is_not_overwritten_unasked_and_what_cannot_be_written_is_one_line(
    pendulum: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag, file = write_bag(tmp_path / "bag", pendulum.messages()), tmp_path / "states.csv"
    for nowhere in ("nowhere/states.csv", "."):
        assert exported(bag, "--output", tmp_path / nowhere) == 1
        output = capsys.readouterr().err
        assert output.startswith("error: cannot write") and output.count("\n") == 1
    file.write_text("mine")

    assert exported(bag, "--output", file) == 1
    assert capsys.readouterr().err == f"error: {file} exists already; --overwrite replaces it\n"
    assert file.read_text() == "mine"

    assert exported(bag, "--output", file, "--overwrite") == 0
    assert len(table(file)) == len(pendulum.states)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag", "states.csv"]


def test_one_of_several_characters_is_named(
    pendulum: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "states.csv"
    with BagWriter(tmp_path / "bag") as bag:
        for namespace in ("left", "right"):
            add_to(bag, pendulum.messages(), namespace)

    assert exported(tmp_path, "--output", file) == 1
    output = capsys.readouterr().err
    assert "left" in output and "right" in output and output.count("\n") == 1
    assert not file.exists()
    assert exported(tmp_path, "--output", file, "--character", "left") == 0
    assert len(table(file)) == len(pendulum.states)
