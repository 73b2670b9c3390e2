"""Makes takes: of a timeline that was edited, only what follows the edit is simulated."""

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from actuated_characters.fork.execution import run_fork
from actuated_characters.fork.plan import ForkInputs, ForkPlan, plan_fork
from actuated_characters.recorder.run_directory import PARAMETERS, prepare_directory
from actuated_characters.runs.in_process import run_in_process
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.behaviours import PlannedBehaviour, read_behaviours
from actuated_characters.runs.planned.files import Planned
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.runs.planned.strengths import PlannedStrengths, read_strengths
from actuated_characters.runs.planned.timeline import TimelineRun, plan_timeline
from actuated_characters.timeline.takes import Take, Takes, write_copy
from controller_node.behaviours.asked import UNASKED
from controller_node.planner.settings import (
    NO_PLANNER,
    PlannerParameters,
    make_planner_settings,
)
from controller_node.references.base import Reference
from msgs_config.messages.clock import FIRST_TICK, TickClock
from msgs_config.parameters import Values
from msgs_config.shared_parameters import KEYFRAME_BUDGET, KEYFRAME_PERIOD

Progress = Callable[[float], None]
"""Is called with the time in s that is simulated so far, since the first state."""

# s that a take may have to begin before an edit; kB/s that suffice for a planner's keyframes then.
_KEYFRAMES = {KEYFRAME_PERIOD.name: 0.5, KEYFRAME_BUDGET.name: 5_000}
_Planned = TypeVar("_Planned", bound=Planned)


@dataclass(frozen=True)
class PlannedTake:
    """A take that was checked."""

    run: TimelineRun
    takes: Takes
    parent: Take | None  # None: it is simulated from the beginning
    fork: ForkPlan | None  # of a take of the line that the parent ends
    begin: float  # s, where its recording begins
    since: float  # s, from which on it may differ from its parent
    is_as_before: bool  # nothing has changed: the parent is the take of this file

    @property
    def until(self) -> float:
        """The end of it, s."""
        return self.run.plan.ticks / self.run.plan.simulation.rate_hz


def plan_take(name: str, takes: Takes, parent: Take | None) -> PlannedTake:
    """Plan the take of a timeline as its file is now; without a parent, from the beginning.

    `name` is a shipped timeline, or the path of a file.

    Raises:
        ActuatedCharactersError: names the entry that cannot be simulated, or what is wrong with
            the parent.
    """
    run = plan_timeline(name, _KEYFRAMES, {})
    fresh = PlannedTake(run, takes, None, None, 0.0, 0.0, is_as_before=False)
    if parent is None:
        return fresh
    before = plan_timeline(str(parent.timeline), _KEYFRAMES, {})
    if not _same_settings(run.plan, before.plan):
        return fresh
    rate = run.plan.simulation.rate_hz
    first = first_difference(before, run)
    if first is None:
        return replace(fresh, parent=parent, since=parent.until, is_as_before=True)
    line = [take for take in takes.line(parent) if round(take.begin * rate) < first]
    if not line:
        return replace(fresh, parent=parent, since=first / rate)
    fork = _fork(line, first, run)
    begin = line[-1].begin + fork.skipped / rate
    return PlannedTake(run, takes, parent, fork, begin, first / rate, is_as_before=False)


def make_take(
    planned: PlannedTake, title: str = "", progress: Progress = lambda time: None
) -> Take:
    """Simulate a planned take into a folder of its own, which is removed if that fails.

    Raises:
        ActuatedCharactersError: one of the nodes failed.
    """
    directory = planned.takes.free_directory()
    try:
        _simulate(planned, directory, progress)
    except BaseException:
        shutil.rmtree(directory, ignore_errors=True)
        raise
    parent = "" if planned.parent is None else planned.parent.name
    take = Take(directory, parent, planned.begin, planned.since, planned.until, title)
    take.write()
    return take


def _simulate(planned: PlannedTake, directory: Path, progress: Progress) -> None:
    prepare_directory(directory, overwrite=False)
    run, rate = planned.run, planned.run.plan.simulation.rate_hz
    copy = {"timeline": str(write_copy(run.reference.timeline.file, directory))}
    if planned.fork is None:
        plan = replace(run.plan, controller=Values({**run.plan.controller, **copy}))
        run_in_process(
            plan, directory, inputs=run.inputs, progress=lambda ticks: progress(ticks / rate)
        )
    else:
        fork, begin = planned.fork, planned.begin
        plan = replace(fork.plan, controller=Values({**fork.plan.controller, **copy}))
        run_fork(
            replace(fork, plan=plan),
            directory,
            progress=lambda ticks: progress(begin + ticks / rate),
        )


def first_difference(before: TimelineRun, run: TimelineRun) -> int | None:
    """The first tick, counted from 0, in whose state two runs may answer otherwise.

    They have the same parameters. None: one is what the other is, and as long.
    """
    ahead, ticks = _ticks_ahead(run.plan), min(before.plan.ticks, run.plan.ticks)
    changes = _changed_inputs(before, run)
    if before.plan.ticks != run.plan.ticks:
        changes.append(ticks - 1)
    clock = TickClock(run.plan.simulation.rate_hz)
    motions = before.reference, run.reference
    if not motions[0].is_motion_of(motions[1]):
        for tick in range(min([ticks, *changes]) + ahead):
            if not _is_same(*motions, clock.time_after(tick)):
                changes.append(max(tick - ahead, 0))
                break
    return min(changes, default=None)


def _is_same(one: Reference, other: Reference, time: float) -> bool:
    """Whether two motions have the same bits at a time in s."""
    first, second = one.sample(time), other.sample(time)
    return all(
        mine.tobytes() == its.tobytes()
        for mine, its in (
            (first.configuration.position, second.configuration.position),
            (first.configuration.orientations_xyzw, second.configuration.orientations_xyzw),
            (first.velocity, second.velocity),
            (first.acceleration, second.acceleration),
        )
    )


def _ticks_ahead(plan: RunPlan) -> int:
    """How many ticks ahead of a state the answer to it may look at the reference."""
    given = PlannerParameters.of(plan.controller)
    if given.planner == NO_PLANNER:
        return 2 + given.delay
    settings = make_planner_settings(plan.character, plan.controller)
    return settings.horizon + 2 * settings.period + given.delay + 2


def _changed_inputs(before: TimelineRun, run: TimelineRun) -> list[int]:
    """The ticks of inputs that only one of two runs has."""
    clock = TickClock(run.plan.simulation.rate_hz)
    pairs = zip(before.inputs.by_name().values(), run.inputs.by_name().values(), strict=True)
    return [
        clock.tick(each.stamp_ns) - FIRST_TICK
        for old, new in pairs
        for some, others in ((old, new), (new, old))
        for each in some
        if each not in others
    ]


def _same_settings(one: RunPlan, other: RunPlan) -> bool:
    """Whether two runs have the same character and parameters, but for the timeline itself."""

    def settings(plan: RunPlan) -> tuple[object, ...]:
        simulator, controller = dict(plan.simulator), dict(plan.controller)
        del simulator["max_ticks"], controller["timeline"]
        return simulator, controller, plan.character.file_text, plan.character.loading.urdf_text

    return settings(one) == settings(other)


def _fork(line: Sequence[Take], first: int, run: TimelineRun) -> ForkPlan:
    """The fork of the last of a line of takes, from a tick on that it has."""
    origin, clock = line[-1], TickClock(run.plan.simulation.rate_hz)
    begin = round(origin.begin * clock.rate_hz)
    fork = plan_fork(
        origin.directory,
        (first - begin) / clock.rate_hz,
        ForkInputs({}, with_later=False),
        (run.plan.ticks - begin) / clock.rate_hz,
    )
    from_stamp = clock.stamp_ns(FIRST_TICK + first)

    def later(planned: Sequence[_Planned]) -> list[_Planned]:
        return [each for each in planned if each.stamp_ns >= from_stamp]

    inputs = PlannedInputs(
        later(run.inputs.pushes),
        later(run.inputs.throws),
        strengths=later(
            _overriding(
                _sent(line, "strengths", read_strengths),
                run.inputs.strengths,
                PlannedStrengths(0, {}),
            )
        ),
        pins=later(run.inputs.pins),
        behaviours=later(
            _overriding(
                _sent(line, "behaviours", read_behaviours),
                run.inputs.behaviours,
                PlannedBehaviour(0, UNASKED.ask.value),
            )
        ),
    )
    return replace(fork, inputs=inputs)


def _sent(
    line: Sequence[Take], kind: str, read: Callable[[Path], Sequence[_Planned]]
) -> list[_Planned]:
    """What the controllers of a line of takes were sent of a kind."""
    files = [take.directory / PARAMETERS / f"{kind}.json" for take in line]
    return [each for file in files if file.is_file() for each in read(file)]


def _overriding(
    sent: Sequence[_Planned], wanted: Sequence[_Planned], first: _Planned
) -> list[_Planned]:
    """What counts in place of all that was sent; `first` holds until something is wanted.

    A controller has what waits for its stamp in its keyframes. Of two of one stamp the later one
    counts; so each of those stamps gets what is wanted then.
    """
    overriding = []
    for stamp_ns in sorted({each.stamp_ns for each in (*sent, *wanted)}):
        in_force = [first, *(each for each in wanted if each.stamp_ns <= stamp_ns)]
        overriding.append(replace(in_force[-1], stamp_ns=stamp_ns))
    return overriding
