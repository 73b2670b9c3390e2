"""The trials of a shrinking: each choice once, from what it has in common with others on."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
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
from msgs_config.errors import (
    ActuatedCharactersError,
    ConfigurationError,
    RefusedError,
    RunError,
    SimulationError,
)
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
    _begun: dict[_Sent, tuple[Sizes, Future[Ended]]] = field(default_factory=dict)
    _fell: dict[_Sent, bool] = field(default_factory=dict)
    _failed: dict[_Sent, ActuatedCharactersError] = field(default_factory=dict)
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
            if self._falls(sizes, choices[number + 1 :]):
                return number
        return None

    def _falls(self, sizes: Sizes, later: Sequence[Sizes]) -> bool:
        """Whether a choice falls; meanwhile `later` ones are tried, should this one not."""
        key = _texts(self.shrinking.events(sizes))
        while key not in self._fell:
            if key in self._failed:
                raise self._failed[key]
            if self._pool is None:
                self._try(sizes)
            else:
                self._try_together(self._pool, [sizes, *later])
        self._keep_best(sizes, self._fell[key])
        return self._fell[key]

    def _try(self, sizes: Sizes) -> None:
        events = self.shrinking.events(sizes)
        begin = self._latest_keyframe(events)
        self._count()
        self._learn_of(sizes, lambda: run_trial(self.setting, events, begin))

    def _try_together(self, pool: WorkerProcesses, choices: Sequence[Sizes]) -> None:
        """Begin the first choice, and others where there is room; learn of those that end next."""
        try:
            self._begin(pool, choices)
            wait([future for _, future in self._begun.values()], return_when=FIRST_COMPLETED)
            for key in [key for key, (_, future) in self._begun.items() if future.done()]:
                sizes, future = self._begun.pop(key)
                self._learn_of(sizes, future.result)
        except BrokenProcessPool as error:
            raise RunError("a process that tries inputs was killed; begin again") from error

    def _begin(self, pool: WorkerProcesses, choices: Sequence[Sizes]) -> None:
        """Begin what is not known of some choices, up to one that is known to fall."""
        for number, sizes in enumerate(choices):
            events = self.shrinking.events(sizes)
            key = _texts(events)
            if self._fell.get(key):
                return
            if key in self._fell or key in self._failed or key in self._begun:
                continue
            if number and len(self._begun) >= self._at_once:
                return
            self._count()
            begin = self._latest_keyframe(events)
            self._begun[key] = sizes, pool.submit(_Worker.run, tuple(events), begin)

    def _learn_of(self, sizes: Sizes, ended: Callable[[], Ended]) -> None:
        """Learn of a choice; one that a node refuses, or that diverges, does not fall.

        What else goes wrong counts where the choice is asked for.
        """
        key = _texts(self.shrinking.events(sizes))
        try:
            self._learn(sizes, ended())
        except (RefusedError, SimulationError):
            self._fell[key] = False
        except ActuatedCharactersError as error:
            self._failed[key] = error

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
