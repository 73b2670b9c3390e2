"""Files of a run on a full disk: each is whole or not there, and one line says which and why."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.metrics.run_metrics import COLUMNS
from actuated_characters.recorder.run_directory import (
    LOGS,
    PARAMETERS,
    PLOT,
    SERIES,
    SUMMARY,
    prepare_directory,
    read_metrics,
    write_metrics,
    write_parameters,
)
from actuated_characters.render.stills import save_png
from actuated_characters.report.metrics_plot import plot_metrics
from actuated_characters.runs.planned.files import write_planned
from actuated_characters.runs.planned.wrenches import PlannedPush
from msgs_config.errors import RecordingError
from msgs_config.whole_files import part_of, write_whole, writing
from tests.support.limits import file_size_limit
from tests.support.ros import Processes

FULL_AT = 1000  # bytes
OLD, NEW = "old", "x" * (FULL_AT + 1)
FIGURES: dict[str, object] = {"character": "none", "ticks": 100, "body_weight_n": 9.81}
ROWS = {name: np.ones(100) for name in COLUMNS}
LIMITED = (
    "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, ({0}, {0})); "
    "from actuated_characters.cli import main; sys.exit(main(sys.argv[1:]))"
)
IN_PROCESS = ("run", "--in-process", "--no-record", "--character", "pendulum", "--duration", "1")


def files_below(directory: Path) -> set[str]:
    return {str(path.relative_to(directory)) for path in directory.rglob("*") if path.is_file()}


# One file


@pytest.mark.parametrize("before", [None, OLD])
def test_a_file_is_whole_or_what_was_there_before(tmp_path: Path, before: str | None) -> None:
    file = tmp_path / "file.txt"
    if before is not None:
        file.write_text(before)

    with file_size_limit(FULL_AT), pytest.raises(RecordingError) as caught:
        write_whole(file, NEW)

    assert str(caught.value) == f"cannot write {file}: File too large"
    assert files_below(tmp_path) == ({"file.txt"} if before else set())
    assert before is None or file.read_text() == before
    write_whole(file, NEW)
    assert file.read_text() == NEW and files_below(tmp_path) == {"file.txt"}


def test_nothing_of_a_file_is_left_where_its_writer_or_its_directory_fails(
    tmp_path: Path,
) -> None:
    with pytest.raises(ZeroDivisionError), writing(tmp_path / "file.txt") as part:
        part.write_text(NEW)
        assert not (tmp_path / "file.txt").exists()
        raise ZeroDivisionError

    assert files_below(tmp_path) == set()
    with pytest.raises(RecordingError, match=r"cannot write .*none/file: No such file or dir"):
        write_whole(tmp_path / "none" / "file", NEW)


# The files of a run


WRITERS: dict[str, tuple[Callable[[Path], object], str]] = {  # and the file that is too large
    "summary": (
        lambda run: write_metrics(run, FIGURES | {"notes": NEW}, {"time_s": np.ones(1)}),
        SUMMARY,
    ),
    "series": (lambda run: write_metrics(run, FIGURES, ROWS), SERIES),
    "parameters": (
        lambda run: write_parameters(run, "sim_node", {"character": NEW}),
        f"{PARAMETERS}/sim_node.yaml",
    ),
    "pushes": (
        lambda run: write_planned(
            run / PARAMETERS / "pushes.json", 20 * [PlannedPush(1, "rod", (0.0,) * 6)]
        ),
        f"{PARAMETERS}/pushes.json",
    ),
    "plot": (plot_metrics, PLOT),
    "picture": (
        lambda run: save_png(
            np.random.default_rng(1).integers(0, 255, (30, 30, 3)).astype(np.uint8),
            run / "strip.png",
        ),
        "strip.png",
    ),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_leaves_no_file_in_part(tmp_path: Path, name: str) -> None:
    write, file = WRITERS[name]
    run = tmp_path / "run"
    prepare_directory(run, overwrite=False)
    if file == PLOT:
        write_metrics(run, FIGURES, ROWS)
    before = files_below(run)

    with file_size_limit(FULL_AT), pytest.raises(RecordingError) as caught:
        write(run)

    assert str(caught.value) == f"cannot write {run / file}: File too large"
    assert files_below(run) - before <= {SERIES} - {file}
    write(run)
    assert (run / file).stat().st_size > FULL_AT
    if before:
        summary, series = read_metrics(run)
        assert summary == FIGURES
        assert series.keys() == ROWS.keys() and all(
            map(np.array_equal, series.values(), ROWS.values())
        )


def test_what_a_killed_run_has_left_of_a_file_is_overwritten(tmp_path: Path) -> None:
    run = tmp_path / "run"
    prepare_directory(run, overwrite=False)
    part_of(run / SERIES).write_text(NEW)

    prepare_directory(run, overwrite=True)

    assert files_below(run) == set()


# The command


@pytest.mark.slow
def test_a_run_on_a_full_disk_ends_with_the_file_and_the_reason(
    processes: Processes, tmp_path: Path
) -> None:
    full_at = 10_000  # bytes: more than its parameters and its summary, less than its series
    run = processes.python("-c", LIMITED.format(full_at), *IN_PROCESS, "--output", "run")

    assert run.wait(120.0) == 1

    (error,) = [line for line in run.stderr.splitlines() if line.startswith("error: ")]
    assert error == f"error: cannot write {tmp_path / 'run' / SERIES}: File too large"
    nodes = ("sim_node", "controller_node", "recorder")
    names = {f"{PARAMETERS}/{node}.yaml" for node in nodes} | {f"{LOGS}/recorder.log"}
    assert files_below(tmp_path / "run") == names

    again = processes.command(*IN_PROCESS, "--output", "run", "--overwrite")

    assert again.wait(120.0) == 0
    assert json.loads((tmp_path / "run" / SUMMARY).read_text())["ticks"] == 240
