"""Shrinks a recorded run that fell to the fewest and smallest inputs with which it still falls."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from actuated_characters.bags.recording import Recording, find_bag, read_recordings
from actuated_characters.fork.execution import run_fork
from actuated_characters.fork.plan import ForkInputs, ForkPlan, plan_fork
from actuated_characters.metrics.falls import FALLEN_TIME
from actuated_characters.metrics.recording_metrics import fall_time
from actuated_characters.runs.in_process import Progress
from actuated_characters.shrink.inputs import STEER, Event, Input, without_needless_stops
from actuated_characters.shrink.minimal import Sizes
from actuated_characters.shrink.reading import read_inputs
from actuated_characters.shrink.trial import script_of
from msgs_config.errors import ConfigurationError

LATER = 1.0
"""How much later than in the recording a fall may begin to count as one, s."""


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
