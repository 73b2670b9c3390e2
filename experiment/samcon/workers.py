"""Processes that expand branches, through joblib: on this machine, or on a cluster.

Each process makes its own engine of a problem once, and keeps it.
"""

import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from types import TracebackType

import joblib
from joblib.externals.loky import get_reusable_executor

from experiment.samcon.problem import Problem
from experiment.samcon.rollout import Branch, Expansion, Rollout
from msgs_config.errors import ConfigurationError

_TASKS_A_WORKER = 4  # a window; more of them spread the work better, and cost more each

MOST_ENGINES = 8
"""A process keeps at most so many; a fit has one for each heading."""

_rollouts: dict[str, Rollout] = {}
_one_at_a_time = threading.Lock()


class Workers:
    """Expands branches on a number of processes; 1 is this process alone.

    Whoever opens it closes it: with it all the processes end.
    """

    def __init__(self, problem: Problem, count: int, cluster: str = "") -> None:
        """`cluster` is the address of a dask scheduler, whose workers are taken instead.

        Raises:
            ConfigurationError: there is no dask, or no scheduler at the address.
        """
        self._problem = problem
        self._open = ExitStack()
        if cluster:
            count = _join_cluster(self._open, cluster)
        self.count = count
        self._local = count == 1 and not cluster
        if not self._local:
            self._parallel = self._open.enter_context(processes(count, is_cluster=bool(cluster)))

    def __enter__(self) -> "Workers":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._open.close()
        forget()

    def expand(self, branches: Sequence[Branch]) -> Iterator[Expansion]:
        """The expansions of branches, in their order, as they come.

        Raises:
            ActuatedCharactersError: a process cannot make the problem's plan.
        """
        if self._local:
            for branch in branches:
                yield rollout_of(self._problem).expand(branch)
            return
        groups = _groups(branches, _TASKS_A_WORKER * self.count)
        work = (joblib.delayed(_expand)(self._problem, group) for group in groups)
        for expansions in self._parallel(work):
            yield from expansions


def rollout_of(problem: Problem) -> Rollout:
    """This process's engine for a problem, made when it is first asked for; a few are kept."""
    key = repr(problem)
    found = _rollouts.pop(key, None)
    if found is None:
        while len(_rollouts) >= MOST_ENGINES:
            _rollouts.pop(next(iter(_rollouts))).close()
        found = Rollout(problem)
    _rollouts[key] = found  # the last one that was asked for is the last to go
    return found


def forget() -> None:
    """Close this process's engines."""
    while _rollouts:
        _rollouts.popitem()[1].close()


@contextmanager
def some_processes(count: int) -> Iterator[joblib.Parallel | None]:
    """So many processes, or None for this one alone; its engines are closed in the end."""
    try:
        if count == 1:
            yield None
            return
        with processes(count) as parallel:
            yield parallel
    finally:
        forget()


@contextmanager
def processes(count: int, *, is_cluster: bool = False) -> Iterator[joblib.Parallel]:
    """So many processes, which end with the `with` block; those of a cluster do not."""
    backend = None if is_cluster else "loky"
    parallel = joblib.Parallel(n_jobs=count, backend=backend, return_as="generator", batch_size=1)
    with _quiet_managers(), parallel as opened:
        try:
            yield opened
        finally:
            if not is_cluster:
                get_reusable_executor(max_workers=count).shutdown(wait=True, kill_workers=True)


def leave_interrupts_to_the_parent() -> None:
    """To be called in a worker's process: Ctrl-C is for the process that started it."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _expand(problem: Problem, branches: Sequence[Branch]) -> list[Expansion]:
    """What a worker's process does."""
    leave_interrupts_to_the_parent()
    with _one_at_a_time:  # a cluster's worker may have several threads
        rollout = rollout_of(problem)
        return [rollout.expand(branch) for branch in branches]


def _groups(branches: Sequence[Branch], count: int) -> list[Sequence[Branch]]:
    """The branches in order, in at most `count` groups of about as many samples each."""
    total = sum(len(branch.samples) for branch in branches)
    groups: list[list[Branch]] = []
    done = 0
    for branch in branches:
        if not groups or done >= len(groups) * total / count:
            groups.append([])
        groups[-1].append(branch)
        done += len(branch.samples)
    return list(groups)


@contextmanager
def _quiet_managers() -> Iterator[None]:
    """Nothing from the threads that watch over processes: these are killed when all is stopped."""
    before = threading.excepthook

    def hook(arguments: threading.ExceptHookArgs) -> None:
        if "ExecutorManager" not in type(arguments.thread).__name__:
            before(arguments)

    threading.excepthook = hook
    try:
        yield
    finally:
        threading.excepthook = before


def _join_cluster(stack: ExitStack, address: str) -> int:
    """Have joblib use a dask cluster; returns how many threads its workers have."""
    try:
        stack.enter_context(joblib.parallel_config(backend="dask", scheduler_host=address))
    except (ImportError, ValueError) as error:
        if "pip install" not in str(error):
            raise ConfigurationError(f"--cluster {address}: {error}") from error
        raise ConfigurationError(
            "--cluster needs dask.distributed: pip install 'actuated_characters[cluster]'"
        ) from error
    except OSError as error:
        raise ConfigurationError(f"--cluster {address}: no dask scheduler answers there") from error
    threads: int = joblib.effective_n_jobs(-1)
    return threads
