"""Shared memory of killed processes is freed by the next one, and nobody else's is touched."""

import fcntl
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from actuated_characters.runs.ros_domain import own_domain
from msgs_config.runtime import shared_memory
from msgs_config.runtime.shared_memory import DIRECTORY, LEAST_AGE, remove_orphans
from tests.support.ros import Process, Processes, SimulatorClient, wait_until

OLD = 1000.0  # s
NAME = "fastrtps_0123456789abcdef"


def write(directory: Path, name: str = NAME, size: int = 100, age: float = OLD) -> Path:
    file = directory / name
    file.write_bytes(bytes(size))
    make_older(file, age)
    return file


def make_older(file: Path, seconds: float) -> None:
    then = time.time() - seconds
    os.utime(file, (then, then), follow_symlinks=False)


def names(directory: Path) -> set[str]:
    return {file.name for file in directory.iterdir()}


def test_a_segment_whose_lock_nobody_holds_is_removed(tmp_path: Path) -> None:
    write(tmp_path)
    write(tmp_path, f"{NAME}_el", size=0)

    assert remove_orphans(tmp_path) == [NAME]
    assert names(tmp_path) == set()


def test_a_segment_whose_lock_is_held_stays(tmp_path: Path) -> None:
    write(tmp_path)
    lock = write(tmp_path, f"{NAME}_el", size=0)

    with lock.open("rb") as locked:
        fcntl.flock(locked, fcntl.LOCK_EX)
        assert remove_orphans(tmp_path) == []
        assert names(tmp_path) == {NAME, f"{NAME}_el"}

    assert remove_orphans(tmp_path) == [NAME]


@pytest.mark.parametrize("young", [NAME, f"{NAME}_el"])
def test_a_segment_that_may_be_about_to_be_locked_stays(tmp_path: Path, young: str) -> None:
    write(tmp_path)
    write(tmp_path, f"{NAME}_el", size=0)
    make_older(tmp_path / young, LEAST_AGE - 3.0)

    assert remove_orphans(tmp_path) == []
    assert len(names(tmp_path)) == 2


OTHERS = [
    "fastrtps_port7413",
    "fastrtps_port7413_el",
    "sem.fastrtps_port7413_mutex",
    "fastrtps_0123456789abcde",
    "fastrtps_0123456789ABCDEF",
    "fastrtps_0123456789abcdef_sl",
    "my_fastrtps_0123456789abcdef",
    "psm_0123",
]


@pytest.mark.parametrize("name", OTHERS)
def test_files_of_other_names_stay(tmp_path: Path, name: str) -> None:
    write(tmp_path, name)
    write(tmp_path, f"{name}_el", size=0)

    assert remove_orphans(tmp_path) == []
    assert names(tmp_path) == {name, f"{name}_el"}


def test_what_a_process_tries_shared_memory_with_goes_and_a_segment_without_a_lock_stays(
    tmp_path: Path,
) -> None:
    write(tmp_path, size=1)
    other = write(tmp_path, "fastrtps_fedcba9876543210", size=2).name

    assert remove_orphans(tmp_path) == [NAME]
    assert names(tmp_path) == {other}


def test_other_users_files_links_and_directories_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    foreign = write(tmp_path / "..", "kept", size=1)
    (tmp_path / NAME).symlink_to(foreign)
    make_older(tmp_path / NAME, OLD)
    (tmp_path / "fastrtps_fedcba9876543210").mkdir()
    assert remove_orphans(tmp_path) == []
    (tmp_path / NAME).unlink()
    write(tmp_path)
    write(tmp_path, f"{NAME}_el", size=0)
    monkeypatch.setattr(shared_memory.os, "geteuid", lambda: os.getuid() + 1)

    assert remove_orphans(tmp_path) == []
    assert foreign.exists() and len(names(tmp_path)) == 3


def test_no_shared_memory_is_no_error(tmp_path: Path) -> None:
    assert remove_orphans(tmp_path / "missing") == []
    assert remove_orphans(Path(__file__)) == []


def segments(process: Process) -> set[Path]:
    """The segments that a process holds the locks of."""
    links = list[str]()
    for link in Path(f"/proc/{process.pid}/fd").iterdir():
        with suppress(FileNotFoundError):  # it was closed meanwhile
            links.append(os.readlink(link))
    locks = [
        link for link in links if re.fullmatch(rf"{DIRECTORY}/fastrtps_[0-9a-f]{{16}}_el", link)
    ]
    return {Path(file) for lock in locks for file in (lock, lock.removesuffix("_el"))}


def test_the_next_node_frees_what_a_killed_one_has_left_and_living_ones_work_on(
    processes: Processes, client: SimulatorClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    living = processes.simulator()
    state = client.first_state()
    with own_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        killed, other = processes.simulator(), processes.simulator()
        wait_until(lambda: segments(killed) and segments(other), "their segments")
        left, needed = segments(killed), segments(living) | segments(other)
        killed.send(signal.SIGKILL)
        killed.wait()
        for file in left | needed:  # it is not their age that saves them
            make_older(file, OLD)

        processes.simulator()

        wait_until(lambda: not any(file.exists() for file in left), "their end")
        assert all(file.exists() for file in needed)
        assert list(client.advance(state, {"hinge": 0.5}).effort) == [0.5]
        assert other.exit_code is None


def test_it_costs_a_start_next_to_nothing(tmp_path: Path) -> None:
    for number in range(50):
        write(tmp_path, f"fastrtps_{number:016x}")
    took = subprocess.run(
        [
            sys.executable,
            "-c",
            "import sys, time; from pathlib import Path\n"
            "from msgs_config.runtime.shared_memory import remove_orphans\n"
            "begin = time.process_time(); remove_orphans(Path(sys.argv[1]))\n"
            "print(time.process_time() - begin)",
            str(tmp_path),
        ],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[3],
    )

    assert float(took.stdout) < 0.01
