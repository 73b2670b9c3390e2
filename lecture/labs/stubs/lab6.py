"""Lab 6: a planner that samples (model predictive control by samples; Williams et al. 2017).

A pendulum hangs from a motor that is too weak to lift it at once: it must swing. Ten times a second
the planner tries 64 plans in a model, for 1.5 s each, takes a mean in which cheap ones weigh most,
and applies the torque of its first 0.1 s. Then it plans again from the state that follows.

A plan has a torque for each of k knots, 0.1 s apart, as a share of the motor's limit: -1 to 1.

Fill in the functions. Then: actuated_characters grade lab6 THIS_FILE
"""

import numpy as np


def propose(plan: np.ndarray, noise: np.ndarray, sigma: float) -> np.ndarray:
    """Plans (s, k) to be tried around a plan, each within -1 and 1.

    plan: (k,)
    noise: (s, k) random numbers, evenly distributed from -1 to 1
    sigma: how much of the noise is added
    """
    return np.zeros(noise.shape)


def cost(angles: np.ndarray, velocities: np.ndarray, torques: np.ndarray) -> np.ndarray:
    """What each of s plans costs (s,).

    angles: (s, k), rad, at the end of each knot; the pendulum hangs at 0 and is upright at pi,
        -pi, 3 pi, ...
    velocities: (s, k), rad/s
    torques: (s, k), shares of the limit

    It shall be upright, and at rest there. A swing towards it has to be worth its while, too:
    what is the energy of the pendulum, and what would it be upright? Costs of about 1 for 1.5 s are
    of the size of the temperature.
    """
    return np.zeros(len(angles))


def combine(plans: np.ndarray, costs: np.ndarray, temperature: float) -> np.ndarray:
    """The mean plan (k,), with the weights exp(-cost / temperature).

    plans: (s, k)
    costs: (s,), maybe large: only their differences count

    Mind that exp of a large number is infinite or zero.
    """
    return np.zeros(plans.shape[1])


def shift(plan: np.ndarray) -> np.ndarray:
    """The plan (k,) with which the next search begins, one knot later; its last knot is held."""
    return plan
