"""The equation of motion tick by tick, with and without contacts; and where a tick's time goes."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.equation_of_motion import EquationOfMotion
from actuated_characters.runs.plan import make_plan
from actuated_characters.studies.framework.plots import label, make_panels
from actuated_characters.studies.framework.study import (
    Cell,
    RunResult,
    RunSpec,
    StudyResult,
    StudyRunner,
)
from controller_node.parameters import make_controller
from msgs_config.arrays import FloatArray
from msgs_config.messages.wrenches import WrenchArrays
from sim_node.parameters import make_character_setup, make_settings
from sim_node.physics.simulation import Simulation

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.figure import Figure

_DURATION = 3.0  # s
_WALK: Mapping[str, object] = {"reference": "clip", "clip": "walk"}
_CASES = (
    RunSpec("walk", "humanoid", _DURATION, _WALK, contacts=True),
    RunSpec("stand", "humanoid", _DURATION, contacts=True),
    RunSpec("fall", "humanoid", _DURATION, controller={"root_assistance": False}, contacts=True),
)
_SMALLEST = 1e-17  # that a logarithmic axis shows
_PARTS = ("M (v' - v) / h", "C", "f", "J^T contacts")


@dataclass(frozen=True)
class Closure:
    """How the equation closes over the t ticks of a run."""

    times: FloatArray  # (t,) s
    relative: FloatArray  # (t,) norm of the residual, without limits, over the largest part
    without_contacts: FloatArray  # (t,) the same, the contacts left out
    parts: FloatArray  # (t, 4) norms, of `_PARTS`


@dataclass(frozen=True)
class TickTime:
    """What one tick takes, in µs, by its parts."""

    physics: float
    control: float
    over_topics: float  # all of it, by two processes

    @property
    def transport(self) -> float:
        """What the topics, the processes and the recorder beside them add."""
        return self.over_topics - self.physics - self.control


class EquationStudy:
    """What went over the topics, put into `M (v' - v) / h + C = f + J^T lambda`."""

    name = "equation"
    title = "what is left of M (v' - v) / h + C = f + J^T lambda, over its largest part"
    runs = len(_CASES)

    def run(self, runner: StudyRunner) -> StudyResult:
        """Walk, stand and fall; and time a walk part by part."""
        outcomes = {case.label: runner.run(case) for case in _CASES}
        closures = {name: close(outcome.recording) for name, outcome in outcomes.items()}
        tick = _measure(outcomes["walk"])
        rows = [_row(name, closure) for name, closure in closures.items()]
        walk = closures["walk"]
        return StudyResult(
            columns=("run", "p50", "p99", "largest", "p50 without contacts"),
            rows=rows,
            figures={self.name: _draw(closures, tick)},
            curves={
                "equation_walk": (
                    ("time_s", "relative_residual", "without_contacts"),
                    np.column_stack((walk.times, walk.relative, walk.without_contacts)),
                )
            },
            notes=(
                "all forces are on the topics, and the equation closes to rounding; the efforts of "
                "joint limits are on none, and are left out on those joints' own entries",
                f"of a tick's {tick.over_topics:.0f} us over topics physics takes "
                f"{tick.physics:.0f}, the control law {tick.control:.0f}, topics and recorder "
                f"{tick.transport:.0f}",
            ),
        )


def _row(name: str, closure: Closure) -> list[Cell]:
    p50, p99, largest = np.percentile(closure.relative, (50, 99, 100)).tolist()
    return [name, p50, p99, largest, float(np.median(closure.without_contacts))]


def close(run: Recording) -> Closure:
    """Put each tick of a run of one substep, with its contacts, into the equation."""
    equation = EquationOfMotion(
        run.character, float(run.parameters["gravity"]), int(run.parameters["rate"])
    )
    links = {link.name: row for row, link in enumerate(run.character.links)}
    nothing = np.zeros((len(links), 6))
    relative, without, parts = [], [], []
    for tick, contacts in enumerate(run.contacts):
        state = run.position[tick], run.velocity[tick], run.effort[tick], run.velocity[tick + 1]
        balance = equation.balance(*state, _rows(contacts, links))
        relative.append(balance.relative)
        without.append(equation.balance(*state, nothing).relative)
        summands = (balance.inertial, balance.bias, balance.applied, balance.contact)
        parts.append([float(np.linalg.norm(summand)) for summand in summands])
    return Closure(run.times[:-1], np.array(relative), np.array(without), np.array(parts))


def _rows(contacts: WrenchArrays | None, links: Mapping[str, int]) -> FloatArray:
    """Wrenches (links, 6), zero where nothing touches."""
    wrenches = np.zeros((len(links), 6))
    if contacts is not None and contacts.links:
        wrenches[[links[name] for name in contacts.links]] = contacts.wrenches
    return wrenches


def _measure(walk: RunResult) -> TickTime:
    """Time the walk's parts in one process; the whole is that of the run over topics."""
    plan = make_plan("humanoid", 1.0, _WALK, {}, {})
    controller = make_controller(plan.character, plan.reference, plan.controller)
    role = make_character_setup(plan.character, plan.simulator)
    physics, control = [], []
    with Simulation([role], make_settings(plan.simulator)) as simulation:
        (actor,) = simulation.characters
        episode_ns = actor.state.stamp_ns
        for _ in range(plan.ticks):
            began = time.perf_counter()
            effort, _ = controller.compute_effort(actor.state, episode_ns)
            answered = time.perf_counter()
            simulation.step([np.where(actor.commanded, effort, 0.0)])
            control.append(answered - began)
            physics.append(time.perf_counter() - answered)
    seconds, ticks = walk.summary["wall_time_s"], walk.summary["ticks"]
    assert isinstance(seconds, float) and isinstance(ticks, int)
    return TickTime(
        physics=1e6 * float(np.median(physics)),
        control=1e6 * float(np.median(control)),
        over_topics=1e6 * seconds / ticks,
    )


def _draw(closures: Mapping[str, Closure], tick: TickTime) -> "Figure":
    figure, (residuals, norms, bars) = make_panels(3, 1, (10.0, 9.0))
    for name, closure in closures.items():
        (line,) = residuals.semilogy(
            closure.times, np.maximum(closure.relative, _SMALLEST), linewidth=0.8, label=name
        )
        residuals.semilogy(
            closure.times,
            np.maximum(closure.without_contacts, _SMALLEST),
            linewidth=0.8,
            linestyle=":",
            color=line.get_color(),
            label=f"{name}, contacts left out",
        )
    label(residuals, "time (s)", "residual / largest part", legend="center right")
    walk = closures["walk"]
    for column, name in enumerate(_PARTS):
        norms.semilogy(walk.times, walk.parts[:, column], linewidth=0.8, label=name)
    label(norms, "time (s)", "norm (N, N m)", "the equation's parts, walk", legend="upper right")
    start = 0.0
    for name, width in (
        ("physics", tick.physics),
        ("control law", tick.control),
        ("topics, processes, recorder", tick.transport),
    ):
        bars.barh(0.0, width, left=start, label=f"{name}: {width:.0f} µs")
        start += width
    bars.set_yticks([])
    label(bars, "time (µs)", "", "where a tick's time goes, walk", legend="upper right")
    return figure


STUDY = EquationStudy()
