"""What a rollout's deviations from the reference cost: each feature has its weight."""

import math

import numpy as np

from controller_node.planner.compiled.features import STEP_TIME
from controller_node.planner.contact_model import ContactModel
from controller_node.planner.settings import PlannerSettings
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character

_STEP = 5.0  # 1/m, the weight of a foot that steps to there
_LOOSE_CENTRE = 0.4  # share of the centre of mass's horizontal weight while the place gives way


class ResidualModel:
    """Turns deviations of features (..., f) into residuals, linearly.

    While the reference gives way, feet are not held to places but to the centre of mass and its
    velocity, so that they step to where they catch it, and hands to the centre of mass. (Raibert
    1986, "Legged Robots That Balance"; Pratt et al. 2006, "Capture Point".)
    """

    def __init__(
        self, character: Character, model: ContactModel, settings: PlannerSettings
    ) -> None:
        layout, weights = model.feature_layout, settings.parameters.weights
        is_foot = [
            character.links[index].name in character.feet for index in character.end_effectors
        ]
        parts = [
            weights.root_rotation,
            weights.joints,
            weights.root_spin,
            weights.joint_rates,
            weights.centre_of_mass,
            weights.centre_of_mass_velocity,
            weights.angular_momentum,
            *(weights.feet if foot else weights.hands for foot in is_foot),
        ]
        # the mean of the checks' squares counts
        self._share = share = 1.0 / math.sqrt(settings.checks)
        self._weights = share * np.repeat(parts, [*layout.sizes[:-1], *(3 for _ in is_foot)])
        self.centre = layout.centre
        """Where the centre of mass begins among features."""
        self.feet, self.hands = (
            [layout.first_end + 3 * i for i, foot in enumerate(is_foot) if foot is wanted]
            for wanted in (True, False)
        )
        """Where feet and hands begin among features."""
        self._loose_weights = self._weights.copy()
        self._loose_weights[self.centre : self.centre + 2] *= _LOOSE_CENTRE
        for foot in self.feet:
            self._loose_weights[foot : foot + 2] = share * _STEP

    @property
    def weights(self) -> FloatArray:
        """Weights (f,) of a state's deviations; rollouts count the mean of their checks."""
        return self._weights / self._share

    @property
    def loose_weights(self) -> FloatArray:
        """The same while the reference gives way."""
        return self._loose_weights / self._share

    def balance(self, features: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Centres of mass (..., 3) in m, their velocities (..., 3) in m/s of features (..., f)."""
        first = self.centre
        return features[..., first : first + 3], features[..., first + 3 : first + 6]

    def residuals(self, deviations: FloatArray, *, perturbed: bool) -> FloatArray:
        """The residuals of deviations, both (..., f)."""
        if not perturbed:
            residuals: FloatArray = deviations * self._weights
            return residuals
        loose = deviations.copy()
        centre = deviations[..., self.centre : self.centre + 3]
        velocity = deviations[..., self.centre + 3 : self.centre + 6]
        for foot in self.feet:
            loose[..., foot : foot + 2] -= centre[..., :2] + STEP_TIME * velocity[..., :2]
        for hand in self.hands:
            loose[..., hand : hand + 3] -= centre
        loose *= self._loose_weights
        return loose
