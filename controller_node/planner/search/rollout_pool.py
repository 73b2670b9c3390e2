"""Rollouts of many plans from one state, shared by threads.

Each depends on its own plan alone, so that neither their number nor their order matters.
"""

import numpy as np

from controller_node.planner.compiled.rollout import (
    Desired,
    EngineBuffers,
    RolloutModel,
    features_of,
    roll_out,
)
from controller_node.planner.contact_model import ContactModel
from controller_node.references.offsets import Offsets, knot_before
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.runtime.worker_threads import WorkerThreads

_MAX_FEATURE = 1e4  # the largest feature; beyond it a rollout has come to nothing


class RolloutPool:
    """Threads with an engine each."""

    def __init__(
        self, model: ContactModel, workers: int, of_ticks: ContactModel | None = None
    ) -> None:
        """The thread that asks is one of the workers.

        Where a step of the model is several ticks, `of_ticks` is one whose step is a tick.
        """
        self._model = model
        self._own = (of_ticks or model).engine()  # of single states, in the thread that asks
        self._threads = WorkerThreads([model.engine() for _ in range(workers)])

    def features_of(
        self, position: FloatArray, velocity: FloatArray, body: RolloutModel
    ) -> FloatArray:
        """The features (f,) of a reference's state, MuJoCo's position (q,) and velocity (n,)."""
        row = np.zeros(self._model.feature_count)
        features_of(row, position, velocity, body, self._own)
        return row

    def state_after(
        self,
        position: FloatArray,
        velocity: FloatArray,
        offsets: Offsets,
        desired: Desired,
        body: RolloutModel,
    ) -> tuple[FloatArray, FloatArray]:
        """The state, (q,) and (n,), to which offsets lead; the same one if they lead to nothing."""
        unchecked = desired._replace(check_steps=len(desired.positions))
        nothing = np.zeros((0, self._model.feature_count))
        assert _has_knots(offsets.rows, desired)
        if not roll_out(nothing, position, velocity, offsets.rows, unchecked, body, self._own):
            return position, velocity
        return self._own.position.copy(), self._own.velocity.copy()

    def simulate(
        self,
        position: FloatArray,
        velocity: FloatArray,
        plans: FloatArray,
        desired: Desired,
        body: RolloutModel,
    ) -> tuple[FloatArray, BoolArray]:
        """What becomes of plans (s, k, n - 6): features (s, checks, f), and which went well (s,).

        The features of those that did not are zero.
        """
        assert _has_knots(plans[0], desired)
        checks = (len(desired.positions) - 1) // desired.check_steps
        features = np.zeros((len(plans), checks, self._model.feature_count))
        sound = np.zeros(len(plans), dtype=np.bool_)

        def work(engine: EngineBuffers, number: int) -> None:
            sound[number] = roll_out(
                features[number], position, velocity, plans[number], desired, body, engine
            )

        self._threads.share(len(plans), work)
        with np.errstate(invalid="ignore"):
            sound &= (np.abs(features) < _MAX_FEATURE).all(axis=(1, 2))  # NaN is not sound
        features[~sound] = 0.0
        return features, sound


def _has_knots(rows: FloatArray, desired: Desired) -> bool:
    """Whether the knots (k, n - 6) are there, for which compiled code does not look."""
    last_tick = desired.first_tick + (len(desired.positions) - 2) * desired.step_ticks
    first, _ = knot_before(desired.first_tick, desired.knot_ticks)
    last, _ = knot_before(last_tick, desired.knot_ticks)
    return desired.first_knot <= first and last + 2 - desired.first_knot <= len(rows)
