"""When a steered character steps, how fast, and where its feet are by that."""

import cmath
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from controller_node.references.steering import footsteps
from controller_node.references.steering.course import Course, Footprint
from controller_node.references.steering.footholds import Footholds
from controller_node.references.steering.footsteps import FootCycle
from controller_node.references.steering.gait import Gait
from controller_node.references.steering.velocity import (
    STOP,
    SteeringLimits,
    VelocityCommand,
    within,
)
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.geometry import fixed_order, rotations

_LEAST_PACE = 0.7  # of the slowest captured speed: steps that are slower are lifted as those
_EASE = 0.5  # of it: slower steps are as narrow as those
_AIM_TIME_CONSTANT = 0.1  # s, of a foot's aim that another command changes as it swings
_PACE_TIME = 0.4  # s in which the pace changes by the slowest captured speed, at least
_DECIDED = 0.5  # of a swing, from which on a foot keeps to the foothold that it has found
_HIGH, _TOES_UP = 0.1, 0.4  # m and rad: how much higher a foot swings over ground that it feels
_SINKS = 0.2  # m that the root sinks for each m from a foot to the other


class Stepping:
    """The steps of a gait.

    Where each foot of each cycle stands once, feet stay where they stand (see `footsteps`), and
    steps go on until all are where the character stands at ease; where it goes back, the cycle
    runs backward, from when no foot swings on. Else the gait's feet slide.
    """

    def __init__(
        self, gait: Gait, footholds: Footholds | None = None, *, is_high: bool = False
    ) -> None:
        """Step on the plane, or on what footholds there are; high if it may not be a plane."""
        self._gait, self._footholds, self._is_high = gait, footholds, is_high
        self._height = float(gait.at(0.0, 0.0)[0].position[2])  # m, of the root

    def standing(self) -> Course:
        """Standing at the origin."""
        cycles = enumerate(self._gait.foot_cycles(0.0))
        feet = tuple(self._on_foothold(row, cycle.middle) for row, cycle in cycles)
        return Course(feet=feet, targets=feet)

    def advanced(
        self, course: Course, wanted: VelocityCommand, limits: SteeringLimits, period: float
    ) -> Course:
        """A course with the phase, the pace and the feet of its tick; as yet of the tick before."""
        if not course.feet:
            speed = course.forward
            phase = (course.phase + self._gait.frequency(speed) * period) % 1.0
            return replace(course, phase=phase, pace=abs(speed))
        speed, at_ease = self._speed(course), self._at_ease(course)
        steps = course.is_moving or not all(
            footsteps.is_there(foot, self._on_foothold(row, place.moved_by(course.frame)))
            for row, (foot, place) in enumerate(zip(course.feet, at_ease, strict=True))
        )
        most = self._gait.speeds[1] / _PACE_TIME * period
        pace = course.pace + within((speed if steps else 0.0) - course.pace, most)
        if not steps:
            return replace(course, pace=pace)
        rate, cycles = self._gait.frequency(speed), self._gait.foot_cycles(pace)
        backward = course.is_backward
        if course.forward and not any(cycle.swung(course.phase, backward) for cycle in cycles):
            backward = course.forward < 0.0
        by = -rate * period if backward else rate * period
        phase = (course.phase + by) % 1.0
        there = replace(course, pace=pace, phase=phase, is_backward=backward)
        feet, targets = list(course.feet), list(course.targets)
        for row, (foot, cycle) in enumerate(zip(course.feet, cycles, strict=True)):
            was, now = (cycle.swung(each, backward) for each in (course.phase, phase))
            if was == now or (now == 0.0 and was < 0.5):
                continue  # it stands
            time = (cycle.to_middle(phase, backward) if now else 0.5 * cycle.duty) / rate
            target = self._where_it_stands(row, there, wanted, limits, time)
            target = self._on_foothold(row, target)
            if was:
                target = targets[row].towards(target, min(period / _AIM_TIME_CONSTANT, 1.0))
            if self._footholds is not None and max(was, now) >= _DECIDED:
                # Between two footholds there may be none.
                is_found = was >= _DECIDED
                target = targets[row] if is_found else self._on_foothold(row, target)
            targets[row] = target
            feet[row] = footsteps.swung_on(foot, target, was, now)
        return replace(there, feet=tuple(feet), targets=tuple(targets))

    def _on_foothold(self, foot: int, wanted: Footprint) -> Footprint:
        return wanted if self._footholds is None else self._footholds.nearest(foot, wanted)

    def _speed(self, course: Course) -> float:
        """The speed in m/s, as fast as whose cycle it steps."""
        least = _LEAST_PACE * self._gait.speeds[1]
        return max(abs(complex(course.forward, course.left)), least)

    def _where_it_stands(
        self,
        foot: int,
        course: Course,
        wanted: VelocityCommand,
        limits: SteeringLimits,
        time: float,
    ) -> Footprint:
        """Where a foot comes down, if the command stays, for a mid-stance `time` s from now.

        If the character will have stopped before the foot would be lifted again, it is where the
        foot stays.
        """
        stance = course.following(wanted, limits, time)
        if wanted.is_like(STOP):
            speed = self._speed(stance)
            left = 0.5 * self._gait.foot_cycles(speed)[foot].duty / self._gait.frequency(speed)
            if limits.time_to_stop(stance.forward, stance.left, stance.turn) < left:
                stance = stance.following(STOP, limits, left)
        return self._at_ease(stance)[foot].moved_by(stance.frame)

    def on_prints(self, feet: GeneralizedPosition, course: Course) -> GeneralizedPosition:
        """The gait's feet, places (3f,) in m and orientations (f, 4), carried to their prints."""
        stride, cycles = self._gait.stride(course.pace), self._gait.foot_cycles(course.pace)
        own = [cycle.print_at(course.phase, stride) for cycle in cycles]
        angles = [foot.heading - each.heading for foot, each in zip(course.feet, own, strict=True)]
        about_z = np.array([rotations.about_z(angle) for angle in angles])
        places = feet.position.copy()
        for row, (foot, each, angle) in enumerate(zip(course.feet, own, angles, strict=True)):
            x, y = places[3 * row : 3 * row + 2].tolist()
            place = foot.place + (complex(x, y) - each.place) * cmath.rect(1.0, angle)
            places[3 * row : 3 * row + 2] = place.real, place.imag
        placed = GeneralizedPosition(places, rotations.multiply(about_z, feet.orientations_xyzw))
        if self._is_high:
            shown = min(course.pace / (_LEAST_PACE * self._gait.speeds[1]), 1.0)
            _lift(placed, course, cycles, shown)
        if self._footholds is not None:
            self._put_on_ground(placed, course, cycles)
        return placed

    def _put_on_ground(
        self, feet: GeneralizedPosition, course: Course, cycles: Sequence[FootCycle]
    ) -> None:
        """Lift and tilt feet, which are on the plane z = 0, as the ground is at their prints."""
        pairs = zip(course.feet, course.targets, cycles, strict=True)
        for row, (foot, target, cycle) in enumerate(pairs):
            tilt = _tilt(foot.slope)
            swung = cycle.swung(course.phase, course.is_backward)
            above: FloatArray = np.array((0.0, 0.0, feet.position[3 * row + 2]))
            above = rotations.rotate(tilt, above)
            above[2] += foot.height + (footsteps.clearance(foot, target, swung) if swung else 0.0)
            feet.position[3 * row : 3 * row + 2] += above[:2]
            feet.position[3 * row + 2] = above[2]
            feet.orientations_xyzw[row] = rotations.multiply(tilt, feet.orientations_xyzw[row])

    def height(self, course: Course) -> float:
        """How high the ground is for the root, m: as its feet's, a bit lower between two heights.

        A leg whose foot stays a step below does not reach it else.
        """
        heights = [foot.height for foot in course.feet] or [0.0]
        mean = float(fixed_order.mean(np.array(heights)))
        return mean - _SINKS * (max(heights) - min(heights))

    def root(self, place: complex, course: Course) -> complex:
        """Where the root is in the character's own frame, of where the gait's is, m.

        It sways ahead as much less as the steps are shorter; and to the foot that stands, where the
        feet are farther apart than in a captured cycle, as a pendulum does that they keep upright.
        """
        if not course.feet or not course.pace:
            return place
        walk, back = self._gait.speeds[1], cmath.rect(1.0, -course.heading)
        ahead = place.real * min(abs(course.forward) / course.pace, 1.0)
        rate = self._gait.frequency(course.pace)
        left = 0.0
        for foot, captured, cycle in zip(
            course.feet,
            self._gait.foot_cycles(max(course.pace, walk)),
            self._gait.foot_cycles(course.pace),
            strict=True,
        ):
            farther = ((foot.place - course.frame.place) * back).imag - captured.middle.place.imag
            left += farther * footsteps.sway(cycle, course.phase, rate, self._height)
        shown = min(course.pace / (_LEAST_PACE * walk), 1.0)
        return complex(ahead, place.imag + shown * left)

    def _at_ease(self, course: Course) -> list[Footprint]:
        """Where the feet are at mid-stance, in the character's own frame."""
        walk, speed = self._gait.speeds[1], abs(course.forward)
        rate = self._gait.frequency(max(speed, _LEAST_PACE * walk))
        cycles = self._gait.foot_cycles(max(speed, _EASE * walk) if course.is_moving else 0.0)
        return [footsteps.at_ease(cycle.middle, course, rate, self._height) for cycle in cycles]


def _lift(
    feet: GeneralizedPosition, course: Course, cycles: Sequence[FootCycle], share: float
) -> None:
    """Have feet swing higher, and their toes up, by a share: over whatever there is."""
    for row, (foot, cycle) in enumerate(zip(course.feet, cycles, strict=True)):
        hump = share * footsteps.hump(cycle.swung(course.phase, course.is_backward))
        feet.position[3 * row + 2] += _HIGH * hump
        x, y = -math.sin(foot.heading), math.cos(foot.heading)  # to the left
        toes_up = rotations.exp(-_TOES_UP * hump * np.array((x, y, 0.0)))
        feet.orientations_xyzw[row] = rotations.multiply(toes_up, feet.orientations_xyzw[row])


def _tilt(slope: complex) -> FloatArray:
    """The turn xyzw (4,), by the shortest way, from upright to the normal of a slope."""
    upright = 1.0 / math.sqrt(1.0 + slope.real * slope.real + slope.imag * slope.imag)
    turn = np.array((upright * slope.imag, -upright * slope.real, 0.0, 1.0 + upright))
    return turn / math.sqrt(2.0 * (1.0 + upright))
