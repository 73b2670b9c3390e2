"""Shrinks a recorded run that fell to the fewest and smallest inputs with which it still falls."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

from actuated_characters.bags.recording import Recording, find_bag, read_recordings
from actuated_characters.fork.execution import run_fork, with_files
from actuated_characters.fork.plan import ForkInputs, ForkPlan, plan_fork
from actuated_characters.metrics.falls import FALLEN_TIME
from actuated_characters.metrics.recording_metrics import fall_time
from actuated_characters.runs.in_process import Progress
from actuated_characters.runs.until_fall import Keyframe
from actuated_characters.shrink.inputs import STEER, Event, Input, without_needless_stops
from actuated_characters.shrink.minimal import Sizes, shrunk
from actuated_characters.shrink.reading import read_inputs
from actuated_characters.shrink.trial import TrialSetting, run_trial, script_of
from msgs_config.errors import ConfigurationError, RefusedError, SimulationError

LATER = 1.0
"""How much later than in the recording a fall may begin to count as one, s."""

_Sent: TypeAlias = tuple[str, ...]  # the events before a state, as texts: lists have no hash
_MOST_BYTES = 200_000_000  # of keyframes that are kept: those of a planner have some megabytes


@dataclass(frozen=True)
class Shrinking:
    """A recorded run that fell, and its inputs."""

    fork: ForkPlan  # of its first state
    inputs: Sequence[Input]  # those that count before it fell
    total: int  # of all that could be left out, later ones as well
    fall_row: int

    @property
    def order(self) -> list[int]:
        """The inputs that can be left out, by their numbers, the last one before the fall first."""
        numbers = [number for number, each in enumerate(self.inputs) if each.can_be_left_out]
        return sorted(numbers, key=lambda number: -self.inputs[number].row)

    @property
    def scalable(self) -> set[int]:
        """The inputs that have a size."""
        return {number for number in self.order if self.inputs[number].is_scalable}

    def events(self, sizes: Sizes) -> list[Event]:
        """What is sent where inputs have these sizes; others are left out."""
        events = [
            event
            for number, each in enumerate(self.inputs)
            for event in each.events(sizes.get(number, 0.0))
        ]
        return without_needless_stops(sorted(events, key=lambda event: event.stop))

    def describe(self, sizes: Sizes) -> list[str]:
        """A line for each input that is left, in the order of their times; velocities in one."""
        left = sorted(sizes, key=lambda number: self.inputs[number].row)
        lines = [self.inputs[number].describe(sizes[number]) for number in left]
        velocities = [line.removeprefix(STEER) for line in lines if line.startswith(STEER)]
        others = [line for line in lines if not line.startswith(STEER)]
        return [f'{STEER}"{" ".join(velocities)}"', *others] if velocities else others

    @property
    def duration(self) -> float:
        """Of the run of what is left, s."""
        return self.fork.plan.ticks / self.fork.plan.simulation.rate_hz


def plan_shrinking(path: Path) -> Shrinking:
    """Read a run that fell, and plan to repeat it.

    Raises:
        ConfigurationError: it did not fall, was reset before, or had no inputs.
        RecordingError: the recording cannot be repeated exactly; says why.
    """
    recording, *others = read_recordings(path)
    fell_at = None if others else fall_time(recording)
    if not others and fell_at is None:
        raise ConfigurationError(f"{path} did not fall, so that there is nothing to shrink")
    rate = int(recording.parameters["rate"])
    fall_row = round((fell_at or 0.0) * rate)
    known = fall_row + math.ceil(FALLEN_TIME * rate)  # by then it fell, whatever comes
    ticks = known + round(LATER * rate)
    fork = plan_fork(path, 0.0, ForkInputs({}, with_later=False), ticks / rate)
    if any(row <= known for row in recording.episode_rows.tolist()[1:]):
        raise ConfigurationError(
            f"{path} was reset before it fell, at {fell_at:g} s; shrink takes a run of one episode"
        )
    found = read_inputs(find_bag(path), recording)
    total = sum(each.can_be_left_out for each in found)
    shrinking = Shrinking(fork, [each for each in found if each.row < known], total, fall_row)
    if not shrinking.order:
        raise ConfigurationError(f"{path} fell at {fell_at:g} s without any input before")
    return shrinking


@dataclass
class Trials:
    """Tries choices of inputs, each once, from the latest keyframe on that they have in common."""

    shrinking: Shrinking
    folder: Path  # where files are written meanwhile
    report: Callable[["Trials"], object] = lambda trials: None  # is called before each trial
    count: int = 0
    best: Sizes | None = None  # the best choice so far that falls
    setting: TrialSetting = field(init=False)
    _fell: dict[_Sent, bool] = field(default_factory=dict)
    _keyframes: dict[tuple[int, _Sent], Keyframe] = field(default_factory=dict)

    def __post_init__(self) -> None:
        fork = self.shrinking.fork
        plan = with_files(fork.plan, fork.recording, self.folder)
        own = self.folder / "trial"  # apart from the recording's own keyframe, which `plan` names
        own.mkdir()
        self.setting = TrialSetting(fork.recording, plan, plan.ticks, own)

    def repeat(self) -> None:
        """Repeat the recording to its fall, with all inputs, to the bit.

        Raises:
            ReplayError: a state is another one.
            ConfigurationError: it does not fall.
        """
        whole = dict.fromkeys(self.shrinking.order, 1.0)
        if not self._fails(whole, compared=self.shrinking.fall_row):
            raise ConfigurationError("the recorded inputs, sent again, do not make it fall")

    def fails(self, sizes: Sizes) -> bool:
        """Whether it falls with these inputs; False where it diverges, or a node refuses them.

        Raises:
            ActuatedCharactersError: something else went wrong.
        """
        try:
            return self._fails(sizes)
        except (RefusedError, SimulationError):  # as a parameter that is valid with another alone
            return False

    def _fails(self, sizes: Sizes, compared: int = -1) -> bool:
        events = tuple(self.shrinking.events(sizes))
        key = tuple(map(repr, events))
        if key not in self._fell:
            self.count += 1
            self.report(self)
            self._fell[key] = False  # unless the trial, which may raise an error, says otherwise
            begin = None if compared >= 0 else self._latest_keyframe(events)
            ended = run_trial(self.setting, events, begin, compared=compared)
            self._fell[key] = ended.fell is True
            self._keep(events, ended.keyframes)
        if self._fell[key] and (self.best is None or _cost(sizes) < _cost(self.best)):
            self.best = dict(sizes)
        return self._fell[key]

    def _keep(self, events: Sequence[Event], keyframes: Sequence[Keyframe]) -> None:
        for each in keyframes:
            row = self.setting.row_of(each)
            self._keyframes[row, _before(events, row)] = each
        excess = sum(each.size for each in self._keyframes.values()) - _MOST_BYTES
        while excess > 0:
            excess -= self._keyframes.pop(next(iter(self._keyframes))).size

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


def _before(events: Sequence[Event], row: int) -> _Sent:
    """What was sent before the answer to a row's state."""
    return tuple(repr(event) for event in events if event.stop <= row)


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
    return shrunk(shrinking.order, shrinking.scalable, trials.fails)


def run_shrunk(
    shrinking: Shrinking,
    sizes: Sizes,
    directory: Path,
    progress: Progress = lambda ticks: None,
) -> None:
    """Run the inputs that are left into a directory, prepared, as a fork of the recording.

    Raises:
        ActuatedCharactersError: one of the nodes failed.
    """
    recording: Recording = shrinking.fork.recording
    script = script_of(recording, shrinking.events(sizes), compared=0)
    run_fork(shrinking.fork, directory, progress=progress, script=script)
