"""Lab 2: stable PD (slides 63 to 68; Tan, Liu and Turk 2011).

A humanoid follows captured motion at 240 Hz: by torques of its joints, and by a force and a torque
on its root. With gains that follow well, explicit PD is unstable here: it feeds back the state at
the beginning of each period. Stable PD takes the state at its end, as the equation of motion
foresees it.

Arrays have one entry for each of the n degrees of freedom: rad and N m; of the root's place, the
first three, m and N.

Fill in the function. Then: actuated_characters grade lab2 THIS_FILE
"""

import numpy as np


def stable_pd(
    error: np.ndarray,
    velocity: np.ndarray,
    reference_velocity: np.ndarray,
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    stiffness: np.ndarray,
    damping: np.ndarray,
    period: float,
) -> np.ndarray:
    """The efforts (n,) that are held over the period.

    error: (n,) reference at the period's end minus the position now
    velocity: (n,) now
    reference_velocity: (n,) at the period's end
    mass_matrix: M (n, n) now
    bias: C (n,) now: Coriolis, centrifugal and gravity
    stiffness, damping: Kp and Kd (n,)
    period: h, s

    At the period's end the position is about q + h v, and the velocity v + h a. So the efforts are
    f = Kp (error - h v) + Kd (reference_velocity - v - h a), and M a + C = f says what a is.
    """
    efforts: np.ndarray = stiffness * error + damping * (reference_velocity - velocity)
    return efforts
