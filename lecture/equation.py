"""The equation of motion tick by tick, with and without contacts."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.equation_of_motion import EquationOfMotion
from actuated_characters.render.plots import label
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import WALK, RunSpec, StudyRunner
from msgs_config.arrays import FloatArray

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
    """Walk, stand and fall; put what went over the topics into the equation."""
    outcomes = {case.label: runner.run(case) for case in _CASES}
    closures = {name: close(outcome.recording) for name, outcome in outcomes.items()}
    walk = closures["walk"]
    result.rows += [_row(name, closure) for name, closure in closures.items()]
    _draw(result, closures)
    curves = {"relative_residual": walk.relative, "without_contacts": walk.without_contacts}
    result.add_curves("equation_walk", {"time_s": walk.times, **curves})
    result.remarks.append(
        "all forces are on the topics, and the equation closes to rounding; the efforts of "
        "joint limits are on none, and are left out on those joints' own entries"
    )


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


def _draw(result: StudyResult, closures: Mapping[str, Closure]) -> None:
    residuals, norms = result.add_panels(result.name, 2, 1, (10.0, 6.0))
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
