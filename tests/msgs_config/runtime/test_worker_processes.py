import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np

from msgs_config.runtime.worker_processes import WorkerProcesses

PROJECT = Path(__file__).parents[3]
MUCH = 1_000_000  # more bytes than a pipe takes: what feeds the processes stands still


def test_an_interrupt_with_much_still_waiting_ends_without_a_word() -> None:
    ended = subprocess.run(
        (sys.executable, "-m", __name__),
        cwd=PROJECT,
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "interrupted\n", "")


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


def main() -> None:
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
