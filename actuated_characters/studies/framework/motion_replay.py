"""How well a motion came back, and which efforts it needs."""

import csv
import io
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.error_measures import joint_errors
from controller_node.effort_series import TIME_COLUMN
from controller_node.references.base import Reference
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointLayout


def effort_table(layout: JointLayout, times: FloatArray, efforts: FloatArray) -> str:
    """The CSV text of efforts (t, n) that act from times (t,) in s on, to the last bit."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow([TIME_COLUMN, *layout.dof_names])
    writer.writerows(np.column_stack([times, efforts]).tolist())
    return text.getvalue()


def errors_of(run: Recording) -> tuple[FloatArray, FloatArray]:
    """Times (t,) in s, and the joint error (t,) in rad, mean over the joints, before each tick."""
    errors = joint_errors(run.layout, run.position[:-1], run.reference_position[:-1])
    return run.times[:-1], errors.mean(axis=1)


def same_states(first: Recording, second: Recording) -> bool:
    """Whether two runs went through the same states, to the last bit."""
    return (
        first.position.tobytes() == second.position.tobytes()
        and first.velocity.tobytes() == second.velocity.tobytes()
    )


def efforts_along(
    model: DynamicsModel, reference: Reference, times: FloatArray, period: float
) -> FloatArray:
    """The generalised efforts (t, n) of a reference at times (t,) in s: `M dv/dt + C`.

    `dv/dt` is the change of the reference's velocity over the tick, so that a jump counts too.
    """
    efforts = []
    upcoming = reference.sample(float(times[0]))
    for time in times.tolist():
        now, upcoming = upcoming, reference.sample(time + period)
        model.update(now.configuration.position, now.velocity)
        efforts.append(model.inverse_dynamics((upcoming.velocity - now.velocity) / period))
    return np.array(efforts)


def orders(periods: Sequence[float], errors: Sequence[float]) -> list[float]:
    """With which power of the tick (s) the error shrinks, from each tick to the next one."""
    both = pairwise(zip(np.log(periods), np.log(errors), strict=True))
    return [float((e1 - e0) / (h1 - h0)) for (h0, e0), (h1, e1) in both]
