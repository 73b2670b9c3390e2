"""A body on the way that it is told to go: what balance laws and ends of states look at."""

import math
from dataclasses import dataclass

from controller_node.behaviours.state_machine import laws
from controller_node.behaviours.state_machine.body import BodyState, Foot, in_frame, in_world
from controller_node.behaviours.state_machine.description import STEP, State
from controller_node.behaviours.state_machine.legs.leg import Leg
from controller_node.behaviours.state_machine.legs.stepping import sway_of_course
from controller_node.references.steering.course import Course
from msgs_config.geometry.scalars import Vector, add, subtract

_LEAST_HEIGHT = 0.3  # m, of the centre of mass, for the rate of the pendulum
_SUPPORTING_SHARE = 0.6  # share of a sole, from its middle, that bears a body that stands
_MAX_PREDICTED = 4.0  # units of the pendulum's time for which it is predicted at most


@dataclass(frozen=True, eq=False)
class Situation:
    """Lengths are along the heading (x), to its left (y) and up, from the stance sole, in m."""

    body: BodyState
    course: Course
    stance: str  # side of the stance foot
    swing: str
    mirror: float  # 1 where the swing foot is the left one, else -1
    rate: float  # 1/s, of the inverted pendulum
    centre: Vector  # m, the centre of mass
    velocity: Vector  # m/s, of the centre of mass
    other: Vector  # the swing sole

    @property
    def extrapolated(self) -> tuple[float, float]:
        """The extrapolated centre of mass."""
        x, y, _ = self.centre
        vx, vy, _ = self.velocity
        return (
            laws.extrapolated_centre(x, vx, self.rate),
            laws.extrapolated_centre(y, vy, self.rate),
        )

    def later(self, pressure: Vector, time: float) -> tuple[tuple[float, float], ...]:
        """Place and velocity of the centre of mass, along x and y, after a time on a pressure."""
        grown = math.exp(min(self.rate * max(time, 0.0), _MAX_PREDICTED))
        cosh, sinh = 0.5 * (grown + 1.0 / grown), 0.5 * (grown - 1.0 / grown)
        pairs = []
        for axis in (0, 1):
            away, speed = self.centre[axis] - pressure[axis], self.velocity[axis]
            place = pressure[axis] + away * cosh + speed / self.rate * sinh
            pairs.append((place, away * self.rate * sinh + speed * cosh))
        return tuple(pairs)

    def foot(self, side: str) -> Foot:
        """The foot of a side."""
        return self.body.feet[side]

    def lead(self, side: str) -> tuple[float, float]:
        """How far a leg is ahead of the root, rad, and how fast it goes there, rad/s."""
        foot, heading = self.body.feet[side], self.course.heading
        x, y, z, *_ = self.body.velocity.tolist()
        away = in_frame(heading, subtract(foot.sole, self.body.root))
        rate = in_frame(heading, subtract(foot.velocity, (x, y, z)))
        length = max(-away[2], _LEAST_HEIGHT)
        return math.atan2(away[0], length), rate[0] / length

    def local(self, point: Vector) -> Vector:
        """A point of the world, from the stance sole along the heading."""
        return in_frame(self.course.heading, subtract(point, self.foot(self.stance).sole))

    def world(self, point: Vector) -> Vector:
        """The inverse of `local`."""
        return add(self.foot(self.stance).sole, in_world(self.course.heading, point))


def situation_of(
    body: BodyState, course: Course, stance: str, swing: str, gravity: float
) -> Situation:
    """The situation of a body on a course, one of whose sides is the stance side."""
    sole, heading = body.feet[stance].sole, course.heading
    centre = in_frame(heading, subtract(body.centre, sole))
    other = in_frame(heading, subtract(body.feet[swing].sole, sole))
    return Situation(
        body=body,
        course=course,
        stance=stance,
        swing=swing,
        mirror=1.0 if swing == "left" else -1.0,
        rate=laws.pendulum_rate(max(centre[2], _LEAST_HEIGHT), gravity),
        centre=centre,
        velocity=in_frame(heading, body.centre_velocity),
        other=other,
    )


def quantity(name: str, at: Situation, state: State, time: float, legs: dict[str, Leg]) -> float:
    """A quantity of `QUANTITIES` in a situation, `time` s after its state began."""
    stance, swing = at.foot(at.stance), at.foot(at.swing)
    course = at.course
    if name == "time":
        return time
    if name == "progress":
        return time / state.duration
    if name == "stance_load":
        return stance.load
    if name == "swing_load":
        return swing.load
    if name == "load":
        return stance.load + swing.load
    if name == "height":
        return at.body.root[2] - min(stance.sole[2], swing.sole[2])
    if name == "climb":
        return at.velocity[2]
    if name == "speed":
        return at.velocity[0]
    if name == "motion":
        return math.sqrt(at.velocity[0] * at.velocity[0] + at.velocity[1] * at.velocity[1])
    if name == "command":
        return max(abs(course.forward), abs(course.left), abs(course.turn))
    if name == "command_ahead":
        return course.forward
    if name == "sway":
        return _sway(at, state, time)
    return _imbalance(at, legs[at.stance])


def _sway(at: Situation, state: State, time: float) -> float:
    """The extrapolated centre of mass from the stance sole towards the other, as of going ahead."""
    sway = at.extrapolated[1] * at.mirror
    if STEP in state.feet.values():
        sway -= sway_of_course(state, at.course, at.rate, at.mirror, time)
    return sway


def _imbalance(at: Situation, leg: Leg) -> float:
    """How far the extrapolated centre of mass is outside of the feet's rectangle."""
    x, y = at.extrapolated
    beyond = []
    for value, other, half in (
        (x, at.other[0], _SUPPORTING_SHARE * leg.half_length),
        (y, at.other[1], _SUPPORTING_SHARE * leg.half_width),
    ):
        beyond.append(max(min(0.0, other) - half - value, value - max(0.0, other) - half, 0.0))
    ahead, aside = beyond
    return math.sqrt(ahead * ahead + aside * aside)
