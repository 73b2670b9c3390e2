"""The names by which other runs are chosen as the ghost of a recorded run."""

from dataclasses import replace
from pathlib import Path

import pytest

from actuated_characters.viewer.recorded.ghosts import Ghosts
from actuated_characters.viewer.recorded.run import RecordedRun, read_run
from tests.support.bags import make_run, write_bag


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    directory = tmp_path_factory.mktemp("run")
    write_bag(directory / "bag", make_run("pendulum", 0.1).messages())
    return replace(read_run(directory), path=Path("x"))


def names_of(run: RecordedRun, *paths: str) -> list[str]:
    """The names of ghosts in the directories of these paths."""
    ghosts, here = Ghosts(run), run.scene
    added = []
    for path in paths:
        added.append(ghosts.make(RecordedRun(Path(path), here)))
        ghosts.add(added[-1])
    assert all(ghosts.get(each.name) is each for each in added)
    assert [each.name for each in added] == ghosts.names
    for each in added:
        assert {curves.name for curves in each.curves.values()} == {each.name}
    return ghosts.names


@pytest.fixture(autouse=True)
def keyframes(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bags of these paths are not there."""
    monkeypatch.setattr("actuated_characters.viewer.recorded.ghosts.find_marks", lambda run: [])


def test_a_run_has_its_directorys_name_or_its_path_if_that_is_taken(run: RecordedRun) -> None:
    assert names_of(run, "a/demo", "b/demo", "c/x", "y") == ["demo", "b/demo", "c/x", "y"]


@pytest.mark.parametrize("name", ["none", "reference"])
def test_no_run_has_the_name_of_another_entry_of_the_menu(run: RecordedRun, name: str) -> None:
    assert names_of(run, f"a/{name}", name) == [f"a/{name}", str(Path(name).resolve())]


def test_a_run_that_is_given_twice_is_two_ghosts(run: RecordedRun) -> None:
    path = str(Path("demo").resolve())

    assert names_of(run, *["demo"] * 4) == ["demo", path, f"{path} (2)", f"{path} (3)"]
