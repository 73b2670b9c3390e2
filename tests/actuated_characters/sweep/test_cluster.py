"""The command on a cluster: the table of the runs alone, however many workers, and whoever dies."""

import os
import signal
import subprocess
import sys
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from actuated_characters.commands.common.row_runs import asked_run, row_options
from actuated_characters.sweep.file import read_sweep
from actuated_characters.sweep.journal import JOURNAL, Done
from actuated_characters.sweep.row import FIGURES, RowTask, compute
from actuated_characters.sweep.table import TABLE, csv_text, make_records
from tests.support.programs import PROJECT
from tests.support.ros import wait_until
from tests.support.runs import FAMILY, family

pytest.importorskip("distributed")
pytestmark = [pytest.mark.slow, pytest.mark.sharing]
PATIENCE = 120.0  # s
FILE = """
run: {character: pendulum, duration: 1.0, push: ["rod:{force},0,0@0.1", none]}
set: {sim_node.gravity: [9.81, 3.7]}
random: {count: 8, force: {uniform: [1, 20]}}
"""
ROWS = 32


@pytest.fixture(scope="module")
def sweep_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("sweep") / "pushes.yaml"
    file.write_text(FILE)
    return file


@pytest.fixture(scope="module")
def alone(sweep_file: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The table of the rows, one after the other in this process."""
    folder = tmp_path_factory.mktemp("alone")
    rows = read_sweep(sweep_file, row_options(), FIGURES).rows()
    tasks = [RowTask(row.number, row.arguments, "none", folder) for row in rows]
    done = {task.number: Done(task.number, compute(task, asked_run), "") for task in tasks}
    return csv_text(make_records(rows, done))


class Command:
    """The command in a process, with all that it starts."""

    def __init__(self, file: Path, results: Path, *options: str) -> None:
        self.results = results
        self._mark = uuid.uuid4().hex
        program = [sys.executable, "-m", "actuated_characters.cli", "sweep", str(file)]
        self.process = subprocess.Popen(
            [*program, "--output", str(results), *options],
            cwd=PROJECT,
            env={**os.environ, FAMILY: self._mark},
            start_new_session=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def rows(self) -> int:
        """How many rows are in the journal."""
        try:
            return (self.results / JOURNAL).read_bytes().count(b'"outcome"')
        except FileNotFoundError:
            return 0

    def wait_for_rows(self, count: int) -> None:
        has_ended = self.process.poll
        wait_until(lambda: self.rows() >= count or has_ended() is not None, "rows", PATIENCE)
        assert self.process.poll() is None, self.process.communicate()

    def workers(self) -> list[int]:
        """The processes of the workers."""
        return [pid for pid, program in family(self._mark).items() if "spawn_main" in program]

    def finish(self) -> tuple[int, str]:
        """Its exit code and what it printed; nothing of it is left."""
        printed, _ = self.process.communicate(timeout=PATIENCE)
        wait_until(lambda: not family(self._mark), "none of its processes")
        return self.process.returncode, printed


def table(results: Path) -> str:
    return (results / TABLE).read_text()


@pytest.mark.nightly
def test_one_worker_that_is_verified_by_itself(
    sweep_file: Path, alone: str, tmp_path: Path
) -> None:
    code, printed = Command(sweep_file, tmp_path, "--workers", "1", "--verify", "0.05").finish()

    assert (code, table(tmp_path)) == (0, alone), printed
    assert "0 differ" in printed
    assert "by the same worker, for no other was there" in printed


def test_two_workers_of_which_one_is_killed(sweep_file: Path, alone: str, tmp_path: Path) -> None:
    command = Command(sweep_file, tmp_path, "--workers", "2", "--verify", "0.1")
    command.wait_for_rows(3)
    os.kill(command.workers()[0], signal.SIGKILL)
    code, printed = command.finish()

    assert (code, table(tmp_path)) == (0, alone), printed
    assert {path.name for path in tmp_path.iterdir()} <= {JOURNAL, TABLE, "table.parquet"}


@pytest.mark.nightly
def test_a_command_that_is_ended_in_three_ways_and_goes_on_with_four_workers(
    sweep_file: Path, alone: str, tmp_path: Path
) -> None:
    done = 0
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        command = Command(sweep_file, tmp_path, "--workers", "1")
        command.wait_for_rows(done + 3)
        to_all = number == signal.SIGINT  # as a terminal does it
        (os.killpg if to_all else os.kill)(command.process.pid, number)
        code, printed = command.finish()
        done = command.rows()
        assert done < ROWS
        if number != signal.SIGKILL:
            assert code == 130
            assert f"{done} of {ROWS} rows are in {tmp_path}" in printed
            assert "Traceback" not in printed
            assert len(table(tmp_path).splitlines()) == 1 + done

    command = Command(sweep_file, tmp_path, "--workers", "4")
    code, printed = command.finish()

    assert (code, table(tmp_path)) == (0, alone), printed
    assert command.rows() == ROWS


@contextmanager
def dask(
    *arguments: str, says: str, before: str = "pass"
) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A scheduler or a worker, and what it says after some words."""
    module = f"distributed.cli.dask_{arguments[0]}"
    start = f"import sys; {before}; from {module} import main; main()"
    program = [sys.executable, "-c", start, *arguments[1:]]
    with subprocess.Popen(
        [*program, "--no-dashboard"], stderr=subprocess.PIPE, text=True, cwd=PROJECT
    ) as process:
        try:
            assert process.stderr is not None
            line = next(line for line in process.stderr if says in line)
            yield process, line.partition(says)[2].strip()
        finally:
            process.kill()


@pytest.mark.nightly
def test_a_scheduler_with_two_workers_that_is_lost(
    sweep_file: Path, alone: str, tmp_path: Path
) -> None:
    local = ("--host", "127.0.0.1")
    with (
        dask("scheduler", *local, "--port", "0", says="Scheduler at:") as (scheduler, address),
        dask(
            "worker",
            address,
            *local,
            "--nthreads",
            "1",
            "--local-directory",
            f"{tmp_path}/a",
            says="Registered to:",
        ),
        dask(
            "worker",
            address,
            *local,
            "--nthreads",
            "2",
            "--local-directory",
            f"{tmp_path}/b",
            says="Registered to:",
        ),
    ):
        options = ("--scheduler", address)
        code, printed = Command(sweep_file, tmp_path / "all", *options, "--verify", "0.2").finish()
        assert (code, table(tmp_path / "all")) == (0, alone), printed
        assert "rows were computed twice, 0 differ\n" in printed

        command = Command(sweep_file, tmp_path / "part", *options)
        command.wait_for_rows(3)
        scheduler.kill()
        code, printed = command.finish()
        assert (code, command.rows() < ROWS) == (1, True)
        assert f"{command.rows()} of {ROWS} rows are in {tmp_path / 'part'}" in printed
        assert "error: the scheduler of the cluster is gone" in printed
        assert "Traceback" not in printed

    code, printed = Command(sweep_file, tmp_path / "part", *options).finish()
    assert code == 1
    assert f"error: --scheduler {address}: no scheduler of Dask answers there" in printed
    code, printed = Command(sweep_file, tmp_path / "part", "--workers", "1").finish()
    assert (code, table(tmp_path / "part")) == (0, alone), printed


def test_a_worker_without_the_package_is_named(sweep_file: Path, tmp_path: Path) -> None:
    local, missing = ("--host", "127.0.0.1"), "sys.modules['actuated_characters'] = None"
    with (
        dask("scheduler", *local, "--port", "0", says="Scheduler at:") as (_, address),
        dask(
            *("worker", address, *local, "--no-nanny", f"--local-directory={tmp_path}/a"),
            says="Registered to:",
            before=missing,
        ),
    ):
        code, printed = Command(sweep_file, tmp_path / "out", "--scheduler", address).finish()

    assert code == 1
    assert "error: the worker tcp://127.0.0.1:" in printed
    assert "has no actuated_characters; install it in the Python that runs it" in printed
    assert "Traceback" not in printed
