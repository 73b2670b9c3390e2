"""One round of the search for a better plan: samples, Gauss-Newton steps, the best of all."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from controller_node.planner.search import gauss_newton
from msgs_config.arrays import FloatArray
from msgs_config.geometry import fixed_order

_DAMPINGS = (3.0, 0.3)  # lambda of the steps
_SHARE_OF_SAMPLES = 0.9  # share of the samples; the worst say little of where costs are low
_MIN_SAMPLES = 4  # samples that a step can be found from


@dataclass(frozen=True)
class LeastSquaresProblem:
    """What is to be made small: `|residuals(deviations(x))|^2 + penalty |x|^2`."""

    deviations: Callable[[FloatArray], FloatArray]
    """Of places (s, d) the deviations (s, m), not finite where a place leads to nothing."""
    residuals: Callable[[FloatArray], FloatArray]
    """Of deviations (s, m) the residuals (s, m); linear."""
    penalty: float
    largest: float  # the largest size of an entry of x


@dataclass(frozen=True)
class Found:
    """What a round has led to."""

    place: FloatArray  # (d,) the best x
    cost: float
    deviations: FloatArray  # (2, m) that the best x leads to, and the best of the others
    sensitivities: FloatArray | None  # (d, m) of the deviations


def improve(
    problem: LeastSquaresProblem, place: FloatArray, draws: FloatArray, known: FloatArray | None
) -> Found:
    """Look around a place (d,) for a better one.

    Args:
        problem: What is to be made small.
        place: Where to look around.
        draws: Standard normal numbers (s, d): where the samples are, from there.
        known: Sensitivities (d, m) of before.
    """
    places = _within(problem, np.concatenate((place[np.newaxis], place + draws)))
    deviations = problem.deviations(places)
    costs = _costs(problem, places, deviations)
    elites = _best(costs[1:]) + 1
    if not np.isfinite(costs[0]) or len(elites) < _MIN_SAMPLES:
        return _found(places, costs, deviations, known)
    distances, changes = places[elites] - places[0], deviations[elites] - deviations[0]
    residuals = problem.residuals(deviations[0])
    sensitivities = gauss_newton.corrected_sensitivities(known, distances, changes)
    steps = [
        *_ensemble_steps(problem, places[0], distances, residuals, problem.residuals(changes)),
        *gauss_newton.sensitivity_steps(
            problem.residuals(sensitivities), residuals, places[0], problem.penalty, _DAMPINGS
        ),
    ]
    stepped = _within(problem, places[0] + np.array(steps))
    of_steps = problem.deviations(stepped)
    more = _costs(problem, stepped, of_steps)
    return _found(
        np.concatenate((places, stepped)),
        np.concatenate((costs, more)),
        np.concatenate((deviations, of_steps)),
        sensitivities,
    )


def _ensemble_steps(
    problem: LeastSquaresProblem,
    place: FloatArray,
    distances: FloatArray,
    residuals: FloatArray,
    changes: FloatArray,
) -> list[FloatArray]:
    root = math.sqrt(problem.penalty)
    whole = np.concatenate((changes, root * distances), axis=1)
    here = np.concatenate((residuals, root * place))
    return gauss_newton.ensemble_steps(distances, whole, here, _DAMPINGS)


def _within(problem: LeastSquaresProblem, places: FloatArray) -> FloatArray:
    return np.clip(places, -problem.largest, problem.largest)


def _costs(problem: LeastSquaresProblem, places: FloatArray, deviations: FloatArray) -> FloatArray:
    """The costs (s,); infinite of what leads to nothing."""
    residuals = problem.residuals(deviations)
    large = fixed_order.dot(places, places)
    costs = fixed_order.dot(residuals, residuals) + problem.penalty * large
    return np.where(np.isfinite(costs), costs, np.inf)


def _best(costs: FloatArray) -> FloatArray:
    """The samples but the worst, in their order; of equal ones the first."""
    best = np.argsort(costs, kind="stable")[: round(_SHARE_OF_SAMPLES * len(costs))]
    return np.sort(best[np.isfinite(costs[best])])


def _found(
    places: FloatArray,
    costs: FloatArray,
    deviations: FloatArray,
    sensitivities: FloatArray | None,
) -> Found:
    best = np.argsort(costs, kind="stable")[:2]
    return Found(places[best[0]], float(costs[best[0]]), deviations[best], sensitivities)
