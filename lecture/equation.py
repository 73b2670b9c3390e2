"""The equation of motion tick by tick, with and without contacts; and where a tick's time goes."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.equation_of_motion import EquationOfMotion
from actuated_characters.render.plots import label
from actuated_characters.runs.plan import make_plan
from controller_node.parameters import make_controller
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import WALK, RunResult, RunSpec, StudyRunner
from msgs_config.arrays import FloatArray
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_character_setup, make_simulation_settings

TITLE = "what is left of M (v' - v) / h + C = f + J^T lambda, over its largest part"
RUNS = 3

_DURATION = 3.0  # s
_CASES = (
    RunSpec("walk", "humanoid", _DURATION, WALK, contacts=True),
    RunSpec("stand", "humanoid", _DURATION, contacts=True),
    RunSpec("fall", "humanoid", _DURATION, controller={"root_assistance": False}, contacts=True),
)

_SMALLEST_DRAWN = 1e-17  # least value that a logarithmic axis shows
_PARTS = ("M (v' - v) / h", "C", "f", "J^T contacts")


@dataclass(frozen=True)
class Closure:
    """The residual of the equation over the t ticks of a run."""

    times: FloatArray  # (t,) s
    relative: FloatArray  # (t,) norm of the residual, without limits, over the largest part
    without_contacts: FloatArray  # (t,) as `relative`, the contacts left out
    parts: FloatArray  # (t, 4) norms, of `_PARTS`


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Walk, stand and fall; put what went over the topics into the equation; time a walk."""
    outcomes = {case.label: runner.run(case) for case in _CASES}
    closures = {name: close(outcome.recording) for name, outcome in outcomes.items()}
    times, walk = _time_parts(outcomes["walk"]), closures["walk"]
    result.rows += [_row(name, closure) for name, closure in closures.items()]
    _draw(result, closures, times)
    curves = {"relative_residual": walk.relative, "without_contacts": walk.without_contacts}
    result.add_curves("equation_walk", {"time_s": walk.times, **curves})
    physics, control, rest = times.values()
    result.remarks += [
        "all forces are on the topics, and the equation closes to rounding; the efforts of "
        "joint limits are on none, and are left out on those joints' own entries",
        f"of a tick's {physics + control + rest:.0f} us over topics physics takes {physics:.0f}, "
        f"the control law {control:.0f}, topics and recorder {rest:.0f}",
    ]


def _row(name: str, closure: Closure) -> Row:
    p50, p99, largest = np.percentile(closure.relative, (50, 99, 100)).tolist()
    without = float(np.median(closure.without_contacts))
    row = {"run": name, "p50": p50, "p99": p99, "largest": largest}
    return row | {"p50 without contacts": without}


def close(run: Recording) -> Closure:
    """Put each tick of a run of one substep, with its contacts, into the equation."""
    equation = EquationOfMotion(
        run.character, float(run.parameters["gravity"]), int(run.parameters["rate"])
    )
    links = {link.name: row for row, link in enumerate(run.character.links)}
    relative, without, parts = [], [], []
    for tick, contacts in enumerate(run.contacts):
        wrenches = np.zeros((len(links), 6))
        if contacts is not None and contacts.links:
            wrenches[[links[name] for name in contacts.links]] = contacts.wrenches
        state = run.position[tick], run.velocity[tick], run.effort[tick], run.velocity[tick + 1]
        balance = equation.balance(*state, wrenches)
        relative.append(balance.relative)
        without.append(replace(balance, contact=np.zeros_like(balance.contact)).relative)
        summands = (balance.inertial, balance.bias, balance.applied, balance.contact)
        parts.append([float(np.linalg.norm(summand)) for summand in summands])
    return Closure(run.times[:-1], np.array(relative), np.array(without), np.array(parts))


def _time_parts(walk: RunResult) -> dict[str, float]:
    """The parts of a tick's time, µs: two in one process, the rest of the run over topics."""
    plan = make_plan("humanoid", 1.0, WALK, {}, {})
    controller = make_controller(plan.character, plan.reference, plan.controller)
    setup = make_character_setup(plan.character, plan.simulator)
    physics, control = [], []
    with Simulation([setup], make_simulation_settings(plan.simulator)) as simulation:
        (character,) = simulation.characters
        episode_ns = character.state.stamp_ns
        for _ in range(plan.ticks):
            began = time.perf_counter()
            effort, _ = controller.compute_effort(character.state, episode_ns)
            answered = time.perf_counter()
            simulation.step([np.where(character.commanded, effort, 0.0)])
            control.append(answered - began)
            physics.append(time.perf_counter() - answered)
    seconds, ticks = walk.summary["wall_time_s"], walk.summary["ticks"]
    assert isinstance(seconds, float) and isinstance(ticks, int)
    parts = [1e6 * float(np.median(each)) for each in (physics, control)]
    names = ("physics", "control law", "topics, processes, recorder")
    return dict(zip(names, (*parts, 1e6 * seconds / ticks - sum(parts)), strict=True))


def _draw(result: StudyResult, closures: Mapping[str, Closure], times: Mapping[str, float]) -> None:
    residuals, norms, bars = result.add_panels(result.name, 3, 1, (10.0, 9.0))
    for name, closure in closures.items():
        relative = np.maximum(closure.relative, _SMALLEST_DRAWN)
        without = np.maximum(closure.without_contacts, _SMALLEST_DRAWN)
        (line,) = residuals.semilogy(closure.times, relative, linewidth=0.8, label=name)
        style, left_out = (
            {"color": line.get_color(), "linewidth": 0.8},
            f"{name}, contacts left out",
        )
        residuals.semilogy(closure.times, without, ":", label=left_out, **style)
    label(residuals, "time (s)", "residual / largest part", legend="center right")
    walk = closures["walk"]
    for column, name in enumerate(_PARTS):
        norms.semilogy(walk.times, walk.parts[:, column], linewidth=0.8, label=name)
    label(norms, "time (s)", "norm (N, N m)", "the equation's parts, walk", legend="upper right")
    start = 0.0
    for name, width in times.items():
        bars.barh(0.0, width, left=start, label=f"{name}: {width:.0f} µs")
        start += width
    bars.set_yticks([])
    label(bars, "time (µs)", "", "where a tick's time goes, walk", legend="upper right")
