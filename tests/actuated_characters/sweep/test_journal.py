"""The journal of a sweep: what it keeps, and whom it refuses."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from actuated_characters.sweep.grid import Row
from actuated_characters.sweep.journal import JOURNAL, Done, Journal, Verified, fingerprint
from actuated_characters.sweep.row import Outcome
from msgs_config.errors import RunError

MADE_OF = {"rows": "ab", "mujoco-core": "4.0.1"}
DONE = Done(3, Outcome({"ticks": 2, "error_m": 0.1 + 0.2, "fell": None}, "It ran.", "cd"), "here")
VERIFIED = Verified(3, "", "there")


def kept(folder: Path, made_of: Mapping[str, str] = MADE_OF, *, again: bool = False) -> Journal:
    with Journal(folder, made_of, again=again) as journal:
        return journal


def begin(folder: Path) -> None:
    with Journal(folder, MADE_OF) as journal:
        journal.add(DONE)
        journal.add_verified(VERIFIED)


def test_what_is_done_is_there_again(tmp_path: Path) -> None:
    begin(tmp_path)

    journal = kept(tmp_path)

    assert (journal.done, journal.verified) == ({3: DONE}, {3: VERIFIED})


def test_a_row_is_on_the_disk_as_soon_as_it_is_added(tmp_path: Path) -> None:
    with Journal(tmp_path, MADE_OF) as journal:
        journal.add(DONE)

        assert (tmp_path / JOURNAL).read_bytes().count(b"\n") == 2


@pytest.mark.parametrize("cut", [1, 5, 20])
def test_a_line_that_was_cut_is_as_if_never_written(tmp_path: Path, cut: int) -> None:
    begin(tmp_path)
    path = tmp_path / JOURNAL
    path.write_bytes(path.read_bytes()[:-cut])

    with Journal(tmp_path, MADE_OF) as journal:
        assert (journal.done, journal.verified) == ({3: DONE}, {})
        journal.add_verified(VERIFIED)

    assert kept(tmp_path).verified == {3: VERIFIED}


def test_a_journal_cut_in_its_first_line_begins_anew(tmp_path: Path) -> None:
    begin(tmp_path)
    (tmp_path / JOURNAL).write_bytes(b'{"sweep": 1, "ro')

    assert not kept(tmp_path).done


@pytest.mark.parametrize(
    ("made_of", "error"),
    [
        ({**MADE_OF, "rows": "xy"}, "is of another file, or a file that it names has changed"),
        ({**MADE_OF, "mujoco-core": "5"}, r"was made with mujoco-core 4.0.1 \(now 5\)"),
    ],
)
def test_another_sweep_is_refused_until_it_may_begin_again(
    tmp_path: Path, made_of: Mapping[str, str], error: str
) -> None:
    begin(tmp_path)

    with pytest.raises(RunError, match=error):
        Journal(tmp_path, made_of)

    again = kept(tmp_path, made_of, again=True)
    assert (again.done, again.has_forgotten) == ({}, True)
    assert not kept(tmp_path, made_of).has_forgotten


@pytest.mark.parametrize("content", ["[]\n", "nonsense\n", '{"sweep": 1}\n{"row": 1}\n'])
def test_what_is_no_journal_is_a_line(tmp_path: Path, content: str) -> None:
    (tmp_path / JOURNAL).write_text(content)

    with pytest.raises(RunError, match=r"rows\.jsonl.*--again"):
        Journal(tmp_path, MADE_OF)


def test_two_sweeps_do_not_write_to_one_directory(tmp_path: Path) -> None:
    with Journal(tmp_path, MADE_OF), pytest.raises(RunError, match="another command writes to"):
        Journal(tmp_path, MADE_OF)

    kept(tmp_path)


def test_a_directory_that_is_a_file_is_a_line(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")

    with pytest.raises(RunError, match="cannot write to"):
        Journal(tmp_path / "out", MADE_OF)


def test_results_depend_on_rows_bags_and_the_files_that_rows_name(tmp_path: Path) -> None:
    clip = tmp_path / "clip.json"
    clip.write_text("1")
    rows = [Row(1, (f"--clip={clip}",), {})]
    first = fingerprint(rows, {}, "none", 0)

    assert fingerprint([Row(1, (f"--clip={clip}",), {"column": 1})], {}, "none", 0) == first
    assert fingerprint(rows, {}, "all", 0) != first
    assert fingerprint([*rows, *rows], {}, "none", 0) != first
    clip.write_text("23")
    assert fingerprint(rows, {}, "none", 0) != first
