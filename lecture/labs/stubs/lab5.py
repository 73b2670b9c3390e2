"""Lab 5: a hop by SAMCON, sampling-based control (slide 71; Liu, Yin, van de Panne et al. 2010).

A leg with a trunk stays in its plane. Motors are at ankle, knee and hip; only the ground holds the
foot. It shall hop 0.25 m forward in 2.4 s. Stable PD that follows the reference's angles alone
falls over, as its ankle is too soft: other targets must be found, by trying many.

The motion is cut into windows of 1/15 s. In each of them 300 samples are simulated, each with its
own targets around the reference's angles at the window's end. The first begin all in the same
state; those of later windows in the states of 60 survivors, five in each. In the end the path to
the best sample is traced back, and its targets are replayed from the first state on: that must stay
within 0.3 m of the reference. Search and replay both clear what the engine remembers of contacts as
each window begins, so that the replay has the states of the search.

Fill in the functions. Then: actuated_characters grade lab5 THIS_FILE
"""

import numpy as np


def draw(reference: np.ndarray, numbers: np.ndarray, spread: float) -> np.ndarray:
    """Targets (s, 3), rad, of the samples of a window, evenly distributed around the reference.

    reference: (3,), rad, ankle, knee and hip at the window's end
    numbers: (s, 3) random numbers, evenly distributed from 0 to 1
    spread: rad, how far a target may be from the reference, to either side
    """
    return np.tile(reference, (len(numbers), 1))


def cost(
    joints: np.ndarray, foot: np.ndarray, centre: np.ndarray, centre_velocity: np.ndarray
) -> np.ndarray:
    """What each of s samples costs (s,), by its state minus the reference's at the window's end.

    joints: (s, 3), rad, ankle, knee and hip; positive angles lean forward
    foot: (s, 3), x and z in m, pitch in rad
    centre: (s, 2), m, x and z of the centre of mass
    centre_velocity: (s, 2), m/s

    No error costs least, and errors of each of the four cost more as they grow. How much each
    counts is yours; squares do. It falls where the centre of mass is lost: let 0.1 m of it cost
    about as much as 0.3 rad of a joint, and as 0.3 m/s. The trunk's pitch, the sum of the foot's
    and the joints' angles, is worth a term of its own, some times that of a joint.
    """
    return np.zeros(len(joints))


def survivors(costs: np.ndarray, count: float) -> np.ndarray:
    """The numbers (count,) of the samples, counted from 0, from whose states the next ones go on.

    costs: (s,)
    count: how many survive

    Only the best would soon be all alike, and what is cheap now may fall later. So: sort by cost;
    the cheapest 40 % are good, g = int(0.4 s) in number; survivor k = 0, 1, ... is the good one of
    rank k g / count, rounded down. The best one has rank 0.
    """
    return np.zeros(int(count))


def path(parents: np.ndarray, costs: np.ndarray) -> np.ndarray:
    """The number (w,) of the sample in each of w windows that led to the best one of the last.

    parents: (w, s) whole numbers, as floats; in row k the number of the sample of window k - 1 from
        whose state each sample of window k went on; row 0 is all zeros
    costs: (s,) of the last window's samples
    """
    return np.zeros(len(parents))
