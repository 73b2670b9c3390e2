"""The reference over a horizon, as rollouts and residuals need it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller_node.planner.anchor import PlanarState, planar_state
from controller_node.planner.base import DesiredAt
from controller_node.planner.compiled.rollout import Desired, RolloutModel
from controller_node.planner.contact_model import ContactModel
from controller_node.planner.search.rollout_pool import RolloutPool
from controller_node.planner.settings import PlannerSettings
from msgs_config.arrays import FloatArray


@dataclass(frozen=True)
class ReferenceSample:
    """The reference at one tick, or a state in its world."""

    position: FloatArray  # (q,) as MuJoCo has it
    velocity: FloatArray  # (n,)
    features: FloatArray  # (f,)

    def planar(self, centre: int) -> PlanarState:
        """How it moves over the ground; `centre` is the place of the centre of mass in features."""
        balance = self.features[centre : centre + 3], self.features[centre + 3 : centre + 6]
        return planar_state(self.position, self.velocity, *balance)


@dataclass(frozen=True)
class Foreseen:
    """The reference over a horizon, and its features (checks, f)."""

    rollout: Desired
    features: FloatArray


class SampledReference:
    """Samples a reference, each tick of it once, until `clear` is called for it."""

    def __init__(
        self, model: ContactModel, rollouts: RolloutPool, settings: PlannerSettings
    ) -> None:
        self._model, self._rollouts, self._settings = model, rollouts, settings
        self._targets: dict[int, ReferenceSample] = {}

    def clear(self, since: int = 0) -> None:
        """Say that the reference may be another one from a tick on."""
        for known in [known for known in self._targets if known >= since]:
            del self._targets[known]

    def target(self, tick: int, desired_at: DesiredAt, body: RolloutModel) -> ReferenceSample:
        """The reference at a tick."""
        if tick not in self._targets:
            state = desired_at(tick)
            position = self._model.position_of(state.configuration.position)
            features = self._rollouts.features_of(position, state.velocity, body)
            self._targets[tick] = ReferenceSample(position, state.velocity, features)
        return self._targets[tick]

    def ahead(self, tick: int, desired_at: DesiredAt, body: RolloutModel) -> Foreseen:
        """The reference from a tick on, over the horizon."""
        settings = self._settings
        for known in [known for known in self._targets if known < tick]:
            del self._targets[known]
        ticks = range(tick, tick + settings.horizon + 1, settings.step)
        targets = [self.target(each, desired_at, body) for each in ticks]
        desired = self._desired(tick, settings.step, targets, tick // settings.knots)
        checked = targets[desired.check_steps :: desired.check_steps]
        return Foreseen(desired, np.array([target.features for target in checked]))

    def between(
        self, first: int, last: int, first_knot: int, desired_at: DesiredAt, body: RolloutModel
    ) -> Desired:
        """The reference from one tick to another, for offsets whose first knot is given."""
        targets = [self.target(each, desired_at, body) for each in range(first, last + 1)]
        return self._desired(first, 1, targets, first_knot)

    def _desired(
        self, tick: int, step: int, targets: Sequence[ReferenceSample], first_knot: int
    ) -> Desired:
        return Desired(
            tick,
            step,
            self._settings.knots,
            first_knot,
            self._settings.period // step,
            np.array([target.position for target in targets]),
            np.array([target.velocity for target in targets]),
        )
