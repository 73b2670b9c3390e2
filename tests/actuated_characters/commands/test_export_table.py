"""`export` as CSV is read back by Python's own reader, to the last bit."""

import csv
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.bags.writer import BagWriter
from actuated_characters.cli import main
from msgs_config.clips.reading import read_clip
from msgs_config.geometry import rotations
from tests.support import robot_bags
from tests.support.bags import Made, add_to, make_run, write_bag
from tests.support.eventful import Eventful, eventful_run, write_timed
from tests.support.physics import character
from tests.support.robot_bags import JOINTS, ROLLER, joints

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
    (tmp_path / "folder.csv").mkdir()
    for nowhere in ("nowhere/states.csv", "folder.csv"):
        assert exported(bag, "--output", tmp_path / nowhere) == 1
        output = capsys.readouterr().err
        assert output.startswith("error: cannot write") and output.count("\n") == 1
    file.write_text("mine")

    assert exported(bag, "--output", file) == 1
    assert capsys.readouterr().err == f"error: {file} exists already; --overwrite replaces it\n"
    assert file.read_text() == "mine"

    assert exported(bag, "--output", file, "--overwrite") == 0
    assert len(table(file)) == len(pendulum.states)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag", "folder.csv", "states.csv"]


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


def test_a_clip_has_its_times_and_positions(tmp_path: Path) -> None:
    humanoid, file = character("humanoid"), tmp_path / "walk.csv"

    assert exported("walk", "--output", file) == 0

    rows, clip, names = table(file), read_clip(humanoid, "walk"), humanoid.layout.dof_names
    assert list(rows[0]) == ["time_s", *(f"position.{name}" for name in names)]
    assert [float(row["time_s"]) for row in rows] == clip.times.tolist()
    turns = humanoid.layout.rotation_entries
    expected = np.array(clip.positions)
    expected[:, turns] = rotations.log(clip.orientations_xyzw)
    np.testing.assert_allclose(numbers(rows, "position", names), expected, atol=1e-12)


@pytest.mark.slow
def test_a_bag_of_any_robot_has_what_it_publishes(tmp_path: Path) -> None:
    (tmp_path / "roller.urdf").write_text(ROLLER)
    sent = [joints(t, [*JOINTS], [t, 0.05, 2.0 * t]) for t in (0.0, 0.1, 0.2)]
    bag, file = robot_bags.write_bag(tmp_path / "bag", sent), tmp_path / "states.csv"

    assert exported(bag, "--output", file, "--character", tmp_path / "roller.urdf") == 0

    found = numbers(table(file), "position", JOINTS)
    np.testing.assert_allclose(found, [[0.0, 0.05, 0.0], [0.1, 0.05, 0.2], [0.2, 0.05, 0.4]])
