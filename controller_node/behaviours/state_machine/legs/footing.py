"""Where the centre of pressure is to be, and where a foot is to go."""

import math
from dataclasses import dataclass

from controller_node.behaviours.state_machine import laws
from controller_node.behaviours.state_machine.body import Foot, in_frame, in_world
from controller_node.behaviours.state_machine.description import (
    CENTRE,
    STANCE,
    FootPlacement,
    State,
)
from controller_node.behaviours.state_machine.legs.leg import FootPose, Leg
from controller_node.behaviours.state_machine.legs.stepping import (
    landing_offset,
    least_beside,
    nominal_centre,
)
from controller_node.behaviours.state_machine.situation import Situation
from controller_node.behaviours.state_machine.support import FootContact
from controller_node.references.steering.velocity import within
from msgs_config.geometry.scalars import (
    Vector,
    about_z,
    add,
    cross,
    scale,
    subtract,
    yaw,
)

_NARROW = 1e-3  # m, between feet that stand in one place
_IN_BENDS = 0.6
"""Of `turn v / w^2`, by which a foot that reaches lands outward of a bend: the ground's force is
to turn the velocity with the heading. Tried: with 0 a run drifts outward, with 1 inward."""
_LEAST_SHARE = 0.03  # least share of the load on each of two feet


def contacts_of(
    state: State, at: Situation, time: float, legs: dict[str, Leg]
) -> list[FootContact]:
    """The feet that carry in a state, and their centres of pressure; `time` s after it began."""
    standing = [at.stance if role == STANCE else at.swing for role in state.standing]
    if not standing:
        return []
    limits = _limits(legs[standing[0]], state.bounds.sole)
    if len(standing) == 1:
        side = standing[0]
        wanted = _pressure_on_one(state, at, time)
        sole = at.local(at.foot(side).sole)
        inside = [sole[axis] + within(wanted[axis] - sole[axis], limits[axis]) for axis in (0, 1)]
        place = at.world((inside[0], inside[1], sole[2]))
        return [FootContact(side, legs[side], 1.0, place)]
    return _on_both(state, at, limits, legs)


def _limits(leg: Leg, sole: float) -> tuple[float, float]:
    return sole * leg.half_length, sole * leg.half_width


def _pressure_on_one(state: State, at: Situation, time: float) -> tuple[float, float]:
    """The centre of pressure that leads the extrapolated centre of mass back to its course."""
    wanted, nominal, there = (
        state.pressure,
        nominal_centre(state, at.course, at.rate, at.mirror, time),
        at.extrapolated,
    )
    x = wanted.ahead + wanted.gain * (there[0] - nominal.real)
    x += wanted.speed_gain * (at.velocity[0] - state.placement.pace * at.course.forward)
    y = -at.mirror * wanted.outward + wanted.side_gain * (there[1] - nominal.imag)
    return x, y


def _on_both(
    state: State, at: Situation, limits: tuple[float, float], legs: dict[str, Leg]
) -> list[FootContact]:
    """Both feet, with the load where the extrapolated centre of mass is led to a share of it."""
    wanted, other = state.pressure, at.other
    there = at.extrapolated
    goal = (wanted.share * other[0] + wanted.ahead, wanted.share * other[1])
    x = goal[0] + wanted.gain * (there[0] - goal[0])
    y = goal[1] + wanted.side_gain * (there[1] - goal[1])
    across = other[0] * other[0] + other[1] * other[1]
    share = (x * other[0] + y * other[1]) / max(across, _NARROW * _NARROW)
    share = min(max(share, _LEAST_SHARE), 1.0 - _LEAST_SHARE)
    rest = (
        within(x - share * other[0], limits[0]),
        within(y - share * other[1], limits[1]),
    )
    stance = at.world((rest[0], rest[1], 0.0))
    swing = at.world((other[0] + rest[0], other[1] + rest[1], other[2]))
    return [
        FootContact(at.stance, legs[at.stance], 1.0 - share, stance),
        FootContact(at.swing, legs[at.swing], share, swing),
    ]


def landing(state: State, at: Situation, time: float, pressure: Vector) -> tuple[float, float]:
    """Where the swing foot is to land; from the stance sole, as is the centre of pressure."""
    law, step_time, rate, course = state.placement, state.step_time, at.rate, at.course
    (x, vx), (y, vy) = at.later(pressure, step_time - time)
    forward = law.pace * course.forward
    if law.law == "extrapolated":
        offset = landing_offset(state, course, rate, -at.mirror)
        offset *= laws.turned(max(step_time - time, 0.0) * course.turn)
        x, y = x + vx / rate - offset.real, y + vy / rate - offset.imag
    elif law.law == "neutral":
        x += laws.neutral_placement(vx, forward, step_time, law.gain)
        y += laws.neutral_placement(vy, course.left, step_time, law.gain)
        y += at.mirror * 0.5 * law.width
    else:
        height = max(at.centre[2], _NARROW)
        gravity = rate * rate * height
        x += laws.pendulum_placement(vx, height, gravity) - law.gain * forward
        y += laws.pendulum_placement(vy, height, gravity) - law.gain * course.left
        y += at.mirror * 0.5 * law.width
    return reachable(law, x + law.ahead, y, at.mirror)


def reachable(law: FootPlacement, x: float, y: float, mirror: float) -> tuple[float, float]:
    """The nearest place at which the feet neither cross nor straddle."""
    beside = min(max(mirror * y, least_beside(law, x)), law.most_width)
    return min(max(x, -law.most_behind), law.most_ahead), mirror * beside


@dataclass(frozen=True)
class SwingFoot:
    """A foot on its way, from where it left."""

    start: Vector  # m, of the sole, world
    start_yaw: float  # rad, world

    @classmethod
    def leaving(cls, foot: Foot) -> "SwingFoot":
        """A foot that leaves now."""
        return cls(foot.sole, yaw(foot.turn))

    def pose(self, state: State, at: Situation, time: float, goal: tuple[float, float]) -> FootPose:
        """Its pose `time` s after the state began, on its way to a place from the stance sole."""
        law, share = state.placement, time / state.duration
        moved = laws.smooth_step(share)
        stance = at.foot(at.stance).sole
        end = at.world((goal[0], goal[1], 0.0))
        low = self.start[2] + moved * (stance[2] - law.depth - self.start[2])
        low += law.clearance * laws.clearance(share)
        low -= law.descent * max(time - state.duration, 0.0)
        place = [self.start[axis] + moved * (end[axis] - self.start[axis]) for axis in (0, 1)]
        away = self._way_around(at, law, goal) * laws.clearance(moved)
        aside = in_world(at.course.heading, (0.0, at.mirror * away, 0.0))
        place = [place[axis] + aside[axis] for axis in (0, 1)]
        turn = self._yaw(at, moved, max(state.step_time - time, 0.0) + 0.5 * state.step_time)
        return FootPose((place[0], place[1], low), about_z(turn))

    def _way_around(self, at: Situation, law: FootPlacement, goal: tuple[float, float]) -> float:
        """How far from the straight way it goes at its middle, m, to pass the stance leg."""
        x, y, _ = at.local(self.start)
        share = x / (x - goal[0]) if x * goal[0] < 0.0 else 0.0
        if not 0.0 < share < 1.0:
            return 0.0
        beside = at.mirror * (y + share * (goal[1] - y))
        return max(law.least_width - beside, 0.0) / max(laws.clearance(share), 0.5)

    def _yaw(self, at: Situation, moved: float, rest: float) -> float:
        """The way that the foot faces, rad, on its way to the heading `rest` s from now.

        That is the middle of the time that it will stand: its hip then turns to either side.
        """
        there = at.course.heading + rest * at.course.turn
        return _turned(self.start_yaw, there, moved)


@dataclass(frozen=True)
class Origin:
    """What a foot that reaches goes ahead of: its hip, or the centre of mass at its height."""

    place: Vector  # m, world
    velocity: Vector  # m/s
    beside: float  # m, to the left: where the foot goes from here


def origin_of(placement: FootPlacement, at: Situation, leg: Leg) -> Origin:
    """The origin of the foot of a leg."""
    body, heading = at.body, at.course.heading
    hip = leg.hip(body.root, body.root_xyzw)
    x, y, z, *_ = body.velocity.tolist()
    velocity = add((x, y, z), cross(body.spin, subtract(hip, body.root)))
    if placement.origin != CENTRE:
        return Origin(hip, velocity, 0.0)
    _, left, _ = in_frame(heading, subtract(hip, body.centre))
    vx, vy, _ = body.centre_velocity
    place = (body.centre[0], body.centre[1], hip[2])
    return Origin(place, (vx, vy, velocity[2]), math.copysign(0.5 * placement.width, left))


@dataclass(frozen=True)
class ReachingFoot:
    """A foot that goes to a place below its origin, from where it was and as it moved."""

    start: Vector  # m, of the sole, from the origin, world axes
    velocity: Vector  # m/s, of the foot from the origin
    start_yaw: float  # rad, world

    @classmethod
    def leaving(cls, foot: Foot, origin: Origin) -> "ReachingFoot":
        """A foot that leaves now."""
        velocity = subtract(foot.velocity, origin.velocity)
        return cls(subtract(foot.sole, origin.place), velocity, yaw(foot.turn))

    def pose(
        self, state: State, at: Situation, time: float, origin: Origin, later: float
    ) -> FootPose:
        """Its pose `time + later` s after the state began; the origin is that of `time`."""
        law, course = state.placement, at.course
        share = (time + later) / state.duration
        moved, carried = laws.smooth_step(share), law.carry * laws.carried_on(share)
        stance_time = law.stance_time or state.duration
        (vx, vy, _), forward = at.velocity, law.pace * course.forward
        ahead = law.ahead + laws.neutral_placement(vx, forward, stance_time, law.gain)
        side = origin.beside + laws.neutral_placement(vy, course.left, stance_time, law.gain)
        side -= _IN_BENDS * course.turn * vx / (at.rate * at.rate)
        goal = in_world(course.heading, (ahead, side, -law.length))
        place = add(scale(1.0 - moved, self.start), scale(moved, goal))
        place = add(place, scale(state.duration * carried, self.velocity))
        back = later - law.retract * state.duration * laws.led_back(share)
        place = add(place, scale(back, origin.velocity))
        raised = law.clearance * laws.clearance(share)
        raised -= law.descent * max(time + later - state.duration, 0.0)
        turn = about_z(_turned(self.start_yaw, course.heading, moved))
        return FootPose(add(add(origin.place, place), (0.0, 0.0, raised)), turn)


def _turned(start: float, end: float, moved: float) -> float:
    """A share of the shorter way from one heading to another, rad."""
    return start + moved * math.remainder(end - start, math.tau)
