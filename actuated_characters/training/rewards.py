"""What a state costs, what a decision is worth, and when an episode is lost."""

import math

from actuated_characters.training.decorator import compiled
from actuated_characters.training.episode_types import Rules
from controller_node.planner.compiled.features import STEP_TIME
from msgs_config.arrays import FloatArray, SingleArray

_LOST_TURN = 1.2  # rad of the root off the reference's, at which an episode is lost
_LOST_HEIGHT = 0.3  # m of the centre of mass above or below the reference's
_COSTS = (15.0, 60.0, 300.0)  # at which a third of the reward is down to 1 / e
_PERTURBED = 0.5  # share of the reward that is left while the reference gives way
_EFFORT_COST = 0.002  # reward, of an action of one


@compiled
def is_lost(deviation: FloatArray, centre: int) -> bool:
    """Whether a deviation (f,) from the reference ends an episode."""
    turn = deviation[0] ** 2 + deviation[1] ** 2 + deviation[2] ** 2
    height = abs(deviation[centre + 2])
    return not (math.sqrt(turn) < _LOST_TURN and height < _LOST_HEIGHT)


@compiled
def reward_of(cost: float, gives_way: bool, action: SingleArray) -> float:
    """From 0 to 1, of a decision.

    It pays to hold the place: else it would be cheapest to have the reference always give way.
    """
    reward, effort = 0.0, 0.0
    for scale in _COSTS:
        reward += math.exp(-cost / scale) / len(_COSTS)
    if gives_way:
        reward *= _PERTURBED
    for i in range(len(action)):
        effort += action[i] * action[i]
    return reward - _EFFORT_COST * effort


@compiled
def cost_of(deviation: FloatArray, gives_way: bool, rules: Rules) -> float:
    """What a deviation costs: the squares of the residuals of `ResidualModel`, summed."""
    cost, weights, c = 0.0, rules.loose if gives_way else rules.weights, rules.scales.centre
    for i in range(len(deviation)):
        cost += (deviation[i] * weights[i]) ** 2
    if gives_way:
        for first in rules.feet:
            for i in range(2):
                step = deviation[c + i] + STEP_TIME * deviation[c + 3 + i]
                cost += _change(deviation[first + i], step, weights[first + i])
        for first in rules.hands:
            for i in range(3):
                cost += _change(deviation[first + i], deviation[c + i], weights[first + i])
    return cost


@compiled
def _change(deviation: float, by: float, weight: float) -> float:
    """How much more a deviation costs if it counts from elsewhere."""
    return weight * weight * ((deviation - by) ** 2 - deviation**2)
