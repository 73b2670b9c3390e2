"""A row that ends when its character fell, and begins where rows begin to differ by their pushes.

Rows that are equal but for their pushes have the same states until the first one acts. A process
that runs several of them computes these once; what becomes of a row does not depend on it.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

from actuated_characters.runs.perturbation_node import PerturbationNode
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.runs.senders import plan_senders
from actuated_characters.runs.until_fall import Ended, Keyframe, Sender, run_until_fall
from actuated_characters.sweep.row import Ask, AskedRun, Outcome, RowTask, run_row
from msgs_config.messages.clock import FIRST_TICK, TickClock

_MOST_STARTS = 32  # that a process keeps; one of a planner has some megabytes


@dataclass(frozen=True)
class _Start:
    """What rows have in common until a tick."""

    arguments: tuple[str, ...]  # without pushes
    tick: int
    asked: AskedRun = field(compare=False)
    folder: Path = field(compare=False)


def run_row_until_fall(task: RowTask, ask: Ask, directory: Path) -> Outcome:
    """Run a row until its character fell; its figures are whether, and when.

    Raises:
        RecordingError: files cannot be written.
    """
    return run_row(task, ask, directory, _run_until_fall)


def _run_until_fall(asked: AskedRun, task: RowTask, directory: Path) -> Outcome:
    plan, inputs, clock = asked.plan, asked.inputs, TickClock(asked.plan.simulation.rate_hz)
    tick = min((clock.first_tick_from(each.stamp_ns) for each in inputs.pushes), default=0) - 1
    begin = None
    if tick > FIRST_TICK:
        arguments = tuple(each for each in task.arguments if not each.startswith("--push="))
        begin = _keyframe(_Start(arguments, tick, asked, directory))
    if begin is not None:  # it has all that was sent but the pushes
        plan = plan.lasting(plan.ticks - (begin.tick - FIRST_TICK))
        inputs = PlannedInputs(pushes=inputs.pushes)
    ended = _run(plan, inputs, directory, begin)
    fell_at = None if ended.fell_tick is None else clock.time_after(ended.fell_tick - FIRST_TICK)
    return Outcome({"fell": ended.fell, "fell_at_s": fell_at})


@lru_cache(_MOST_STARTS)
def _keyframe(start: _Start) -> Keyframe | None:
    """The keyframe of a start's last tick; None if it fell before."""
    plan, inputs = start.asked.plan, replace(start.asked.inputs, pushes=())
    after = start.tick - FIRST_TICK
    period = after / plan.simulation.rate_hz
    ended = _run(plan.lasting(after + 1), inputs, start.folder, None, period)
    found = [each for each in ended.keyframes if each.tick == start.tick]
    return found[0] if found and not ended.fell else None


def _run(
    plan: RunPlan, inputs: PlannedInputs, directory: Path, begin: Keyframe | None, period: float = 0
) -> Ended:
    """Run a plan until the fall; keyframes come once a period, in s."""
    senders = plan_senders(directory, inputs, {"write_bag": False}, None, simulator_waits=True)
    sender = next((Sender(name, PerturbationNode, senders[name]) for name in senders), None)
    return run_until_fall(plan, sender, directory, begin=begin, keyframe_period=period)
