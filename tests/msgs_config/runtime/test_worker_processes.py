import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from pathlib import Path

import numpy as np

from msgs_config.runtime.worker_processes import WorkerProcesses

PROJECT = Path(__file__).parents[3]
MUCH = 1_000_000  # more bytes than a pipe takes: what feeds the processes stands still
ROUNDS = 5  # in one of two a process is ended amid writing a result


def test_an_interrupt_with_much_still_waiting_ends_without_a_word() -> None:
    ended = run_here("waiting")
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "interrupted\n", "")


def test_an_error_amid_the_results_ends_at_once() -> None:
    ended = run_here("writing")
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "ended\n" * ROUNDS, "")


def run_here(what: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        (sys.executable, "-m", __name__, what),
        cwd=PROJECT,
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )


def begin() -> None:
    """A process of the pool needs nothing."""


def slow(task: np.ndarray) -> int:
    if task[0]:
        time.sleep(600.0)
    return int(task[0])


def interrupted(pool: WorkerProcesses) -> None:
    tasks = [np.full(MUCH, number > 0, np.uint8) for number in range(9)]
    for _ in pool.map(slow, tasks):  # the first is done: the rest waits
        threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()


def large(number: int) -> np.ndarray:
    return np.full(30 * MUCH, number, np.uint8)  # to be written takes longer than to be made


def end_amid_results() -> None:
    with suppress(ArithmeticError), WorkerProcesses(2, begin) as pool:
        for _ in pool.map(large, range(9)):
            raise ArithmeticError
    print("ended", flush=True)


def main() -> None:
    if sys.argv[1:] == ["writing"]:
        for _ in range(ROUNDS):
            end_amid_results()
        return
    try:
        with WorkerProcesses(2, begin) as pool:
            asked_first = pool.submit(slow, np.ones(1))
            try:
                interrupted(pool)
            finally:  # else chance decides which of two threads is the first to see the end
                for process in multiprocessing.active_children():
                    process.terminate()
                assert isinstance(asked_first.exception(), BrokenProcessPool)
    except KeyboardInterrupt:
        print("interrupted")


if __name__ == "__main__":
    main()
