"""The trials of a shrinking: each choice once, from what it has in common with others on."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import mkdtemp
from typing import TypeAlias

from actuated_characters.fork.execution import with_files
from actuated_characters.runs.until_fall import Ended, Keyframe
from actuated_characters.shrink.inputs import Event
from actuated_characters.shrink.minimal import Sizes, shrunk
from actuated_characters.shrink.shrinking import Shrinking
from actuated_characters.shrink.trial import TrialSetting, run_trial
from msgs_config.errors import ConfigurationError, RefusedError, RunError, SimulationError
from msgs_config.runtime.worker_processes import WorkerProcesses

_Sent: TypeAlias = tuple[str, ...]  # the events before a state, as texts: lists have no hash
_MOST_BYTES = 200_000_000  # of keyframes that are kept: those of a planner have some megabytes


@dataclass
class Trials:
    """Tries choices of inputs, each once, from the latest keyframe on that they have in common.

    What becomes of a choice does not depend on who tries it, or beside what.
    """

    shrinking: Shrinking
    folder: Path  # where files are written meanwhile
    report: Callable[["Trials"], object] = lambda trials: None  # is called before each trial
    count: int = 0
    best: Sizes | None = None  # the best choice so far that falls
    setting: TrialSetting = field(init=False)
    _pool: WorkerProcesses | None = None
    _at_once: int = 1
    _begun: dict[_Sent, Future[Ended]] = field(default_factory=dict)
    _fell: dict[_Sent, bool] = field(default_factory=dict)
    _keyframes: dict[tuple[int, _Sent], Keyframe] = field(default_factory=dict)

    def __post_init__(self) -> None:
        fork = self.shrinking.fork
        plan = with_files(fork.plan, fork.recording, self.folder)
        own = self.folder / "trial"  # apart from the recording's own keyframe, which `plan` names
        own.mkdir()
        self.setting = TrialSetting(fork.recording, plan, plan.ticks, own)

    @contextmanager
    def at_once(self, count: int) -> Iterator[None]:
        """Have so many processes try; with one it is this process that does."""
        if count == 1:
            yield
            return
        with WorkerProcesses(count, _Worker.begin, self.setting) as pool:
            for _ in range(count):  # they begin while the recording is repeated
                pool.submit(_Worker.wait)
            self._pool, self._at_once = pool, count
            try:
                yield
            finally:
                self._pool, self._at_once = None, 1
                self._begun.clear()

    def repeat(self) -> None:
        """Repeat the recording to its fall, with all inputs, to the bit.

        Raises:
            ReplayError: a state is another one.
            ConfigurationError: it does not fall.
        """
        whole = dict.fromkeys(self.shrinking.order, 1.0)
        events = self.shrinking.events(whole)
        self._count()
        ended = run_trial(self.setting, events, None, compared=self.shrinking.fall_row)
        self._learn(whole, ended)
        if not ended.fell:
            raise ConfigurationError("the recorded inputs, sent again, do not make it fall")

    def first(self, choices: Sequence[Sizes]) -> int | None:
        """The number of the first choice that falls; None if none does.

        Those that come after it may be tried meanwhile. A choice that diverges, or that a node
        refuses, as a parameter that is valid with another alone, does not fall.

        Raises:
            ActuatedCharactersError: something else went wrong.
        """
        for number, sizes in enumerate(choices):
            self._begin(choices[number:])
            if self._falls(sizes):
                return number
        return None

    def _falls(self, sizes: Sizes) -> bool:
        key = _texts(self.shrinking.events(sizes))
        if key not in self._fell:
            try:
                self._learn(sizes, self._ended(sizes))
            except (RefusedError, SimulationError):
                self._fell[key] = False
        self._keep_best(sizes, self._fell[key])
        return self._fell[key]

    def _ended(self, sizes: Sizes) -> Ended:
        events = self.shrinking.events(sizes)
        if self._pool is None:
            self._count()
            return run_trial(self.setting, events, self._latest_keyframe(events))
        try:
            return self._begun.pop(_texts(events)).result()
        except BrokenProcessPool as error:
            raise RunError("a process that tries inputs was killed; begin again") from error

    def _begin(self, choices: Sequence[Sizes]) -> None:
        """Begin the first of some choices, of which nothing is known, where there is room."""
        for sizes in choices if self._pool is not None else ():
            events = self.shrinking.events(sizes)
            key = _texts(events)
            if key in self._fell or key in self._begun:
                continue
            at_work = sum(not each.done() for each in self._begun.values())
            if at_work >= self._at_once and sizes is not choices[0]:
                return
            assert self._pool is not None
            self._count()
            begin = self._latest_keyframe(events)
            self._begun[key] = self._pool.submit(_Worker.run, tuple(events), begin)

    def _count(self) -> None:
        self.count += 1
        self.report(self)

    def _learn(self, sizes: Sizes, ended: Ended) -> None:
        events = self.shrinking.events(sizes)
        self._fell[_texts(events)] = ended.fell is True
        self._keep_best(sizes, ended.fell is True)
        for each in ended.keyframes:
            row = self.setting.row_of(each)
            self._keyframes[row, _before(events, row)] = each
        excess = sum(each.size for each in self._keyframes.values()) - _MOST_BYTES
        while excess > 0:
            excess -= self._keyframes.pop(next(iter(self._keyframes))).size

    def _keep_best(self, sizes: Sizes, falls: bool) -> None:
        if falls and (self.best is None or _cost(sizes) < _cost(self.best)):
            self.best = dict(sizes)

    def _latest_keyframe(self, events: Sequence[Event]) -> Keyframe | None:
        """The last keyframe of a run that was sent the same before."""
        rows = sorted({row for row, _ in self._keyframes}, reverse=True)
        return next(
            (
                self._keyframes[row, sent]
                for row in rows
                if (row, sent := _before(events, row)) in self._keyframes
            ),
            None,
        )


class _Worker:
    """A process that tries choices for another one."""

    setting: TrialSetting

    @classmethod
    def begin(cls, setting: TrialSetting) -> None:
        """Have a folder of its own, in that of all, for the keyframes that nodes read."""
        cls.setting = replace(setting, folder=Path(mkdtemp(dir=setting.folder)))

    @staticmethod
    def wait() -> None:
        """Do nothing but be there."""

    @classmethod
    def run(cls, events: Sequence[Event], begin: Keyframe | None) -> Ended:
        """Try events."""
        return run_trial(cls.setting, events, begin)


def _texts(events: Sequence[Event]) -> _Sent:
    return tuple(map(repr, events))


def _before(events: Sequence[Event], row: int) -> _Sent:
    """What was sent before the answer to a row's state."""
    return _texts([event for event in events if event.stop <= row])


def _cost(sizes: Sizes) -> tuple[int, float]:
    """By which the better of two choices is the less one: fewer inputs, then smaller ones."""
    return len(sizes), sum(sizes.values())


def shrink(trials: Trials) -> Sizes:
    """The fewest and smallest inputs with which the run of trials still falls.

    Raises:
        ActuatedCharactersError: the recording is not repeated.
    """
    trials.repeat()
    shrinking = trials.shrinking
    return shrunk(shrinking.order, shrinking.scalable, trials.first)
