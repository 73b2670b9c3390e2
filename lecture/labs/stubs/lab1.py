"""Lab 1: a mass on a spring (slides 52 to 62 of "Actuating Simulated Characters").

A motor lifts a mass along a rail to a target height. Gravity, 9.81 m/s^2, pulls it down. 240
times a second the simulation asks your force, and holds it until the next time.

Fill in the functions. Then: actuated_characters grade lab1 THIS_FILE
"""


def pd_force(error: float, error_rate: float, stiffness: float, damping: float) -> float:
    """The force of PD control, N, upwards.

    error: target minus height, m
    error_rate: its derivative, m/s
    stiffness: kp, N/m
    damping: kd, N s/m

    Add no gravity: the mass shall rest below the target, by the steady-state error.
    """
    return 0.0


def critical_damping(stiffness: float, mass: float) -> float:
    """The damping kd, N s/m, with which the mass comes to rest soonest without overshoot.

    stiffness: kp, N/m
    mass: kg
    """
    return 1.0


def pid_force(
    error: float,
    error_rate: float,
    integral: float,
    stiffness: float,
    damping: float,
    integral_gain: float,
) -> float:
    """The force of PID control, N, upwards: the mass shall rest at the target itself.

    integral: of the error over time, m s
    integral_gain: ki, N/(m s)
    the others: as above
    """
    return 0.0


def largest_stiffness(damping: float, mass: float, period: float) -> float:
    """The stiffness kp, N/m, beyond which pd_force is unstable.

    damping: kd, N s/m
    mass: kg
    period: how long each force is held, s

    Write one step of the simulation, v' = v + h f / m and x' = x + h v', as a matrix of (x, v).
    It is stable while both of its eigenvalues are inside the unit circle.
    """
    return 100.0
