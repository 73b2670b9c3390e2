"""Lab 3: balance by a virtual force (slide 73; Pratt et al. 2001, Hyon et al. 2007).

A humanoid stands on two feet. No hand holds it, and joint torques alone cannot move its centre of
mass: only the ground can, and it pushes back as the feet press. So choose a force that would draw
the centre of mass over the middle of the feet, and have the feet press the opposite on the ground.

Stable PD keeps the pose beside it; without balance the humanoid falls after a second. Axes of the
world: x forward, y to the left, z up.

Fill in the functions. Then: actuated_characters grade lab3 THIS_FILE
"""

import numpy as np


def virtual_force(offset: np.ndarray, velocity: np.ndarray, weight: float) -> np.ndarray:
    """The force (3,), N, that shall act on the centre of mass.

    offset: D (3,), m, from the centre of mass to the middle of the feet on the ground
    velocity: v (3,), m/s, of the centre of mass
    weight: m g, N

    Horizontally F = kp D - kd v, with some 1000 N/m and 600 N s/m. Vertically it carries the weight
    and brakes; the height is the business of the legs' PD.
    """
    return np.zeros(3)


def moment(arm: np.ndarray, force: np.ndarray) -> np.ndarray:
    """The moment (3,), N m, about the middle of the feet, of a force (3,), N.

    arm: (3,), m, from the middle of the feet to where the force acts
    """
    return np.zeros(3)


def joint_efforts(bias: np.ndarray, wrenches: np.ndarray, jacobians: np.ndarray) -> np.ndarray:
    """The efforts (n,), N m, by which the feet press so on the ground that it answers by wrenches.

    bias: C (n,) of M a + C = f + J^T w
    wrenches: w (2, 6), the ground's force, N, and moment, N m, on each sole
    jacobians: J (2, 6, n): a sole's velocity and angular velocity are J qd

    With these efforts the equation of motion shall have no acceleration: a = 0. The first six,
    which are the root's, are thrown away, for it has no motor.
    """
    return np.zeros(len(bias))
