"""A study: runs that it asks for one by one, and a result that it fills."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from actuated_characters.bags.recording import Recording
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.velocities import PlannedVelocity, plan_velocities
from actuated_characters.runs.planned.wrenches import PlannedPush
from lecture.framework.result import StudyResult
from msgs_config.character.model import Vector
from msgs_config.messages.clock import FIRST_TICK, TickClock

WALK: Mapping[str, object] = {"reference": "clip", "clip": "walk"}
HOLD: Mapping[str, object] = {"reference": "hold"}
"""References that several studies track."""


@dataclass(frozen=True)
class RunSpec:
    """One run of a study, with the options of `actuated_characters run`."""

    label: str  # unique in its study; also the name of its directory
    character: str  # a shipped one, or a file's path
    duration: float  # s
    reference: Mapping[str, object] = field(default_factory=dict)  # `reference`, `clip`, ...
    simulator: Mapping[str, object] = field(default_factory=dict)  # parameters of sim_node
    controller: Mapping[str, object] = field(default_factory=dict)  # parameters of controller_node
    pushes: Sequence[PlannedPush] = ()  # each lasts the simulator's `wrench_duration`
    throws: Sequence[str] = ()  # as `--throw` has them
    commands: str = ""  # velocities as `--cmd-vel` has them
    contacts: bool = False  # whether to record them

    def plan(self) -> tuple[RunPlan, list[PlannedVelocity]]:
        """The run, and the velocities that are sent to it."""
        plan = make_plan(
            self.character, self.duration, self.reference, self.simulator, self.controller
        )
        return plan_velocities(plan, self.commands) if self.commands else (plan, [])


def plan_push(time: float, rate: int, link: str, force: Vector) -> PlannedPush:
    """A force in N, world axes, on a link's centre of mass from the tick at a time in s on."""
    stamp = TickClock(rate).stamp_ns(FIRST_TICK + round(time * rate))
    return PlannedPush(stamp, link, (*force, 0.0, 0.0, 0.0))


@dataclass(frozen=True)
class RunResult:
    """A run's recording and summary."""

    recording: Recording
    summary: Mapping[str, object]  # the content of summary.json
    diverged: str = ""  # why it ended before its time; "" if it did not

    def measured(self, name: str) -> float | bool | None:
        """A number or a yes or no of summary.json; None where that has none."""
        value = self.summary[name]
        return value if isinstance(value, bool | int | float) else None


class StudyRunner(Protocol):
    """Makes the runs of a study."""

    fine: bool  # whether more runs than usual are wanted, where they make a finer figure

    def run(self, case: RunSpec) -> RunResult:
        """Run a case to its end, or until it diverges.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or a node failed.
        """
        ...

    def path(self, name: str) -> Path:
        """The path for a file that runs need, such as a URDF, below the study's directory."""
        ...


@dataclass(frozen=True)
class Study:
    """One of the lecture's topics: a module's `TITLE`, `RUNS` and `run`."""

    name: str  # name of the module, of the command's argument and of the files
    title: str  # one line
    runs: int  # how many it asks for, about; for the progress bar
    fill: Callable[[StudyRunner, StudyResult], None]  # makes the runs, and adds what they show

    def run(self, runner: StudyRunner) -> StudyResult:
        """Make the runs and return the filled result."""
        result = StudyResult(self.name)
        self.fill(runner, result)
        return result
