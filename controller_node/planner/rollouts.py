"""Rollouts of many plans from one state, shared by threads.

Each depends on its own plan alone, so that neither their number nor their order matters.
"""

import itertools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from controller_node.planner.compiled.rollout import (
    Body,
    Desired,
    Engine,
    features_of,
    roll_out,
)
from controller_node.planner.contact_model import ContactModel
from controller_node.planner.offsets import knot_before
from msgs_config.arrays import BoolArray, FloatArray

_LARGEST = 1e4  # of a feature; beyond, a rollout has come to nothing


class Rollouts:
    """Threads with an engine each."""

    def __init__(self, model: ContactModel, workers: int) -> None:
        """The thread that asks is one of the workers."""
        self._model = model
        self._engines = [model.engine() for _ in range(workers)]
        self._threads = ThreadPoolExecutor(workers - 1) if workers > 1 else None
        self.between: Callable[[], None] = lambda: None
        """What the thread that asks does between two rollouts."""

    def features_of(self, position: FloatArray, velocity: FloatArray, body: Body) -> FloatArray:
        """The features (f,) of a reference's state, MuJoCo's position (q,) and velocity (n,)."""
        row = np.zeros(self._model.feature_count)
        features_of(row, position, velocity, body, self._engines[0])
        return row

    def simulate(
        self,
        position: FloatArray,
        velocity: FloatArray,
        plans: FloatArray,
        desired: Desired,
        body: Body,
    ) -> tuple[FloatArray, BoolArray]:
        """What becomes of plans (s, k, n - 6): features (s, checks, f), and which went well (s,).

        The features of those that did not are zero.
        """
        ticks = len(desired.positions) - 1
        last_knot, _ = knot_before(desired.first_tick + ticks - 1, desired.knot_ticks)
        # compiled code does not look whether the knots are there
        assert plans.shape[1] >= last_knot + 2 - desired.first_knot
        checks = ticks // desired.check_ticks
        features = np.zeros((len(plans), checks, self._model.feature_count))
        sound = np.zeros(len(plans), dtype=np.bool_)
        numbers = itertools.count()  # each worker takes the next plan

        def work(engine: Engine, between: Callable[[], None] | None) -> None:
            while (number := next(numbers)) < len(plans):
                sound[number] = roll_out(
                    features[number], position, velocity, plans[number], desired, body, engine
                )
                if between is not None:
                    between()

        own, *others = self._engines
        if self._threads is None:
            work(own, self.between)
        else:
            waiting = [self._threads.submit(work, engine, None) for engine in others]
            work(own, self.between)
            for done in waiting:
                done.result()
        with np.errstate(invalid="ignore"):
            sound &= (np.abs(features) < _LARGEST).all(axis=(1, 2))  # NaN is not
        features[~sound] = 0.0
        return features, sound
