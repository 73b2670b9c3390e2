"""Where a steered character goes over the ground, tick by tick."""

import cmath
import math
from dataclasses import dataclass, replace

from controller_node.references.steering.velocity import SteeringLimits, VelocityCommand, within

GRAVITY = 9.81  # m/s^2
_LEAN_TIME_CONSTANT = 0.15  # s, time constant of the lean
_LOOKS = 3  # steps of a look ahead


@dataclass(frozen=True)
class Footprint:
    """Where a foot stands on the ground, or would if it came down now."""

    place: complex  # m, x + 1j y
    heading: float  # rad, against how the foot faces at rest
    height: float = 0.0  # m, of the ground
    slope: complex = 0j  # m that the ground rises a m, along x + 1j along y

    def moved_by(self, other: "Footprint") -> "Footprint":
        """It, where it was said in the frame of another one."""
        turn = cmath.rect(1.0, other.heading)
        place = other.place + self.place * turn
        return Footprint(place, self.heading + other.heading, self.height, self.slope * turn)

    def towards(self, other: "Footprint", share: float) -> "Footprint":
        """Between it and another one, by the shorter turn."""
        turn = math.remainder(other.heading - self.heading, math.tau)
        return Footprint(
            self.place + share * (other.place - self.place),
            self.heading + share * turn,
            self.height + share * (other.height - self.height),
            self.slope + share * (other.slope - self.slope),
        )


@dataclass(frozen=True)
class Course:
    """The motion over the ground at a tick; velocities in the character's own frame."""

    x: float = 0.0  # m, world
    y: float = 0.0
    heading: float = 0.0  # rad
    forward: float = 0.0  # m/s
    left: float = 0.0  # m/s
    turn: float = 0.0  # rad/s
    phase: float = 0.0  # phase of the gait's cycle, from 0 to 1
    acceleration_ahead: float = 0.0  # m/s^2, smoothed; in the character's own frame
    acceleration_left: float = 0.0
    pace: float = 0.0  # m/s, the speed whose poses are shown
    is_backward: bool = False  # whether the cycle runs backward
    feet: tuple[Footprint, ...] = ()  # in the world
    targets: tuple[Footprint, ...] = ()  # where they come down next, or came down last

    @property
    def is_moving(self) -> bool:
        """Whether any velocity is left."""
        return self.forward != 0.0 or self.left != 0.0 or self.turn != 0.0

    @property
    def lean(self) -> complex:
        """How it leans for its acceleration: m ahead + 1j m to the left, a metre up.

        Then the force of the ground on the feet goes through what leans.
        """
        return complex(self.acceleration_ahead / GRAVITY, self.acceleration_left / GRAVITY)

    @property
    def frame(self) -> Footprint:
        """The character's own frame on the ground."""
        return Footprint(complex(self.x, self.y), self.heading)

    def following(self, wanted: VelocityCommand, limits: SteeringLimits, time: float) -> "Course":
        """The course `time` s later, but for what follows from the gait, if a command stays."""
        course = self
        for _ in range(_LOOKS):
            course = course.advanced(wanted, limits, time / _LOOKS)
        return course

    def advanced(self, wanted: VelocityCommand, limits: SteeringLimits, period: float) -> "Course":
        """A tick of so many seconds later, but for what follows from the gait."""
        forward = limits.approach(self.forward, wanted.forward, period)
        left = limits.approach(self.left, wanted.left, period)
        turn = self.turn + within(wanted.turn - self.turn, limits.turn_acceleration * period)
        turned = 0.5 * (self.turn + turn) * period
        middle = self.heading + 0.5 * turned
        cosine, sine = math.cos(middle), math.sin(middle)
        mean_forward, mean_left = 0.5 * (self.forward + forward), 0.5 * (self.left + left)
        ahead = (forward - self.forward) / period - turn * left
        leftward = (left - self.left) / period + turn * forward
        share = min(period / _LEAN_TIME_CONSTANT, 1.0)
        return replace(
            self,
            x=self.x + period * (cosine * mean_forward - sine * mean_left),
            y=self.y + period * (sine * mean_forward + cosine * mean_left),
            heading=math.remainder(self.heading + turned, math.tau),
            forward=forward,
            left=left,
            turn=turn,
            acceleration_ahead=self.acceleration_ahead + share * (ahead - self.acceleration_ahead),
            acceleration_left=self.acceleration_left + share * (leftward - self.acceleration_left),
        )
