"""Which directories a run may take: free ones, and those of earlier runs."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.bags.directory_lock import DirectoryLock
from actuated_characters.bags.format.metadata import BAG
from actuated_characters.recorder.run_directory import (
    LOGS,
    PARAMETERS,
    PLOT,
    SERIES,
    prepare_directory,
    prepare_free_directory,
    write_metrics,
)
from msgs_config.errors import RunError


def earlier_run(directory: Path, *characters: str) -> Path:
    """A run of a scene with characters of some names."""
    (directory / BAG).mkdir(parents=True)
    (directory / BAG / "bag_0.mcap").write_text("old")
    for name in characters:
        write_metrics(directory / name, {"ticks": 1}, {"time_s": np.zeros(1)})
        (directory / name / PLOT).write_text("old")
    return directory


def texts_below(directory: Path) -> Mapping[str, str]:
    files = (path for path in directory.rglob("*") if path.is_file())
    return {str(path.relative_to(directory)): path.read_text() for path in files}


def test_a_default_directory_is_that_of_the_run_before_whatever_its_characters_were_named(
    tmp_path: Path,
) -> None:
    run = earlier_run(tmp_path / "play-brawl", "left", "right")

    assert prepare_free_directory(run, replace=True) == run

    assert {path.name for path in run.iterdir()} == {PARAMETERS, LOGS}


@pytest.mark.parametrize("other", ["notes.txt", "left/notes.txt", f"diary/{PLOT}"])
def test_files_that_no_run_has_made_stay_and_a_default_directory_gets_a_number(
    tmp_path: Path, other: str
) -> None:
    run = earlier_run(tmp_path / "play-brawl", "left")
    (run / other).parent.mkdir(exist_ok=True)
    (run / other).write_text("mine")
    before = texts_below(run)

    free = prepare_free_directory(run, replace=True)

    assert (free, texts_below(run)) == (tmp_path / "play-brawl-2", before)
    with pytest.raises(RunError, match="holds other files"):
        prepare_directory(run, overwrite=True)
    assert texts_below(run) == before


def test_a_file_in_the_place_of_a_default_directory_stays(tmp_path: Path) -> None:
    (tmp_path / "play-brawl").write_text("mine")

    names = [
        prepare_free_directory(tmp_path / "play-brawl", replace=replace).name
        for replace in (True, False)
    ]

    assert names == ["play-brawl-2", "play-brawl-3"]
    assert (tmp_path / "play-brawl").read_text() == "mine"


def test_a_run_that_is_still_recorded_is_not_replaced(tmp_path: Path) -> None:
    run = earlier_run(tmp_path / "play-brawl", "left")
    lock = DirectoryLock(run / BAG)

    assert prepare_free_directory(run, replace=True).name == "play-brawl-2"
    lock.release()
    assert prepare_free_directory(run, replace=True) == run


def test_what_a_killed_run_left_of_a_characters_figures_is_replaced(tmp_path: Path) -> None:
    run = earlier_run(tmp_path / "run")
    (run / "left").mkdir()
    (run / "right").mkdir()
    (run / "right" / f".{SERIES}.part").write_text("half")

    prepare_directory(run, overwrite=True)

    assert not texts_below(run)
