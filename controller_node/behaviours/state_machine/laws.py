"""The laws of balance, as pure functions of lengths in m, times in s, speeds in m/s, angles in rad.

Distances are along one horizontal axis: the way that the character faces (x), or to its left (y).
"""

import math

PLACEMENT_LAWS = ("extrapolated", "neutral", "pendulum")
"""Where a foot goes: Hof 2008; Raibert 1986 and Hodgins et al. 1995; Coros et al. 2010."""


def feedback_angle(
    nominal: float,  # rad
    distance: float,  # m, from the stance ankle to the centre of mass, along the axis
    speed: float,  # m/s, of the centre of mass, along the axis
    distance_gain: float,  # rad/m
    speed_gain: float,  # rad s/m
) -> float:
    """The angle of a swing hip that steps to where the body goes: `theta_0 + c_d d + c_v v`.

    The angle is that of the leg in the world, positive towards the axis: forwards in the sagittal
    plane, to the left in the coronal plane. With positive gains a body that is too fast steps
    farther. Source: Yin, Loken and van de Panne 2007, "SIMBICON", equation 1.
    """
    return nominal + distance_gain * distance + speed_gain * speed


def stance_hip_torque(torso: float, swing_hip: float) -> float:
    """The torque of a stance hip, N m: what turns the torso, less what the swing hip does to it.

    `torso` is the torque on the torso that is wanted, `swing_hip` that of the torso on the swing
    leg; the stance hip's is that of the torso on the stance leg: `-torso - swing_hip`.
    Source: Yin, Loken and van de Panne 2007, section 3.2.
    """
    return -torso - swing_hip


def neutral_placement(
    speed: float,  # m/s
    wanted: float,  # m/s
    stance_time: float,  # s
    gain: float,  # s
) -> float:
    """Where a foot is to land ahead of the hip, m: `x = v t_s / 2 + k (v - v_d)`.

    Half of what the body moves while the foot stands keeps its speed; farther ahead slows it down.
    Sources: Raibert 1986, "Legged Robots That Balance", equation 2.4; Hodgins et al. 1995,
    "Animating Human Athletics", section 4.1.
    """
    return 0.5 * speed * stance_time + gain * (speed - wanted)


def pendulum_placement(speed: float, height: float, gravity: float) -> float:
    """Where a foot is to land ahead of the centre of mass so that the body comes to rest on it, m.

    `x = v sqrt(h / g + v^2 / (4 g^2))`, h the height of the centre of mass.
    Source: Coros, Beaudoin and van de Panne 2010, "Generalized Biped Walking Control", equation 2.
    """
    return speed * math.sqrt(height / gravity + speed * speed / (4.0 * gravity * gravity))


def pendulum_rate(height: float, gravity: float) -> float:
    """The rate `w = sqrt(g / h)` in 1/s at which an inverted pendulum of a height in m falls."""
    return math.sqrt(gravity / height)


def extrapolated_centre(position: float, velocity: float, rate: float) -> float:
    """The extrapolated centre of mass `x + v / w`, m: on a foot there the body comes to rest.

    Source: Hof 2008, "The 'extrapolated center of mass' concept suggests a simple control of
    balance in walking"; it is the capture point of Pratt et al. 2006.
    """
    return position + velocity / rate


def extrapolated_later(centre: float, support: float, rate: float, time: float) -> float:
    """The extrapolated centre of mass after a time in s on a point of support, which it leaves.

    `p + (x - p) exp(w t)`. Source: Hof 2008, equation 5.
    """
    return support + (centre - support) * math.exp(rate * time)


def offset_of_velocity(
    velocity: complex,  # m/s: ahead + 1j * to the left
    turn: float,  # rad/s, to the left
    step_time: float,  # s
    rate: float,  # 1/s
) -> complex:
    """How far off a foot the extrapolated centre of mass is as it lands, m, to go on like that.

    Axes are ahead (real) and to the left (imaginary) of the heading at that moment. Each step turns
    the heading by `r = exp(i omega T)` and goes `s`, the chord of the body's way; the offset `c`
    is that of the next step as well, turned with it: `c exp(w T) - r c = s`, so
    `c = s / (exp(w T) - r)`. Without a turn it is `v T / (exp(w T) - 1)`.
    Source: Hof 2008, equations 5 and 14, in axes that turn.
    """
    angle = turn * step_time
    chord = velocity * step_time * _sinc(0.5 * angle) * turned(0.5 * angle)
    return chord / (math.exp(rate * step_time) - turned(angle))


def offset_of_width(width: float, turn: float, step_time: float, rate: float) -> complex:
    """How far inside of a foot the extrapolated centre of mass is as it lands, m, by a step width.

    Axes and source as of `offset_of_velocity`, for a right foot; a left one has the other sign. The
    feet are beside the heading of the middle of their time on the ground: `d exp(w T) + r d = s`.
    Without a turn it is `i w / (exp(w T) + 1)`: Hof 2008, equation 17.
    """
    angle = turn * step_time
    apart = 1j * width * math.cos(0.5 * angle) * turned(angle)
    return apart / (math.exp(rate * step_time) + turned(angle))


def turned(angle: float) -> complex:
    """What turns a horizontal direction, as a complex number, by an angle in rad to the left."""
    return complex(math.cos(angle), math.sin(angle))


def _sinc(angle: float) -> float:
    return math.sin(angle) / angle if abs(angle) > 1e-6 else 1.0


def arrival_acceleration(way: float, speed: float, last_speed: float, time: float) -> float:
    """The acceleration now of the cubic that goes a way in m in a time, from a speed to another.

    `6 x / t^2 - (4 v + 2 v_1) / t`: Hermite's polynomial, with the least mean square of
    accelerations.
    """
    return 6.0 * way / (time * time) - (4.0 * speed + 2.0 * last_speed) / time


def smooth_step(share: float) -> float:
    """From 0 at 0 to 1 at 1 with no speed and no acceleration at either end.

    `10 s^3 - 15 s^4 + 6 s^5`. Source: Flash and Hogan 1985, the movement of minimum jerk.
    """
    s = min(max(share, 0.0), 1.0)
    return s * s * s * (10.0 + s * (-15.0 + 6.0 * s))


def carried_on(share: float) -> float:
    """What a first velocity adds to a movement, from 0 with slope 1 to 0 with slope 0 at 1.

    `s - 6 s^3 + 8 s^4 - 3 s^5`, without acceleration at either end: beside `smooth_step`, Hermite's
    other polynomial of the fifth degree.
    """
    s = min(max(share, 0.0), 1.0)
    return s * (1.0 + s * s * (-6.0 + s * (8.0 - 3.0 * s)))


def led_back(share: float) -> float:
    """What a last velocity adds to a movement, from 0 with slope 0 to 0 with slope 1 at 1, and on.

    `-4 s^3 + 7 s^4 - 3 s^5`: `carried_on` from the other end, with its sign. A foot that is led
    back like this meets the ground at the ground's speed.
    """
    s = max(share, 0.0)
    return s - 1.0 if s > 1.0 else s * s * s * (-4.0 + s * (7.0 - 3.0 * s))


def clearance(share: float) -> float:
    """The height of a swing foot, from 0 over 1 at the middle back to 0: `16 s^2 (1 - s)^2`."""
    s = min(max(share, 0.0), 1.0)
    return 16.0 * s * s * (1.0 - s) * (1.0 - s)
