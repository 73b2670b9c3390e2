"""Feet that stay where they stand, and come down where the motion over the ground will need them.

A captured cycle goes straight ahead at its own speed. Elsewhere its feet would slide: in bends, to
the side, on the spot, at other speeds. So each foot has a footprint of its own. While the cycle has
the foot on the ground, the print stays; then it swings to where the character, at its present
velocity, will be at mid-stance. Told to stop, it swings to where the character will be as it
brakes, or will stand, if that is before the foot would be lifted again. At the cycle's own velocity
this is what the cycle does itself.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from controller_node.references.steering.course import GRAVITY, Course, Footprint
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations

_STANDING = 0.35  # share of the mean speed over the ground, below which a foot stands
_STRAY = 0.1  # share of a cycle in which a foot may do otherwise than once a cycle
_LIFT, _MOST_LIFT = 0.25, 0.04  # of a rise, and m: how far a foot is lifted over an edge
_DROP, _SOONER = 0.1, 0.3  # m of an edge down, and share of a swing: so much sooner it is ahead
_NEAR, _FACING = 0.01, 0.05  # m and rad from where it stands at ease, at which a foot is there


@dataclass(frozen=True)
class FootCycle:
    """When in a cycle a foot stands, and where at mid-stance."""

    touch_down: float  # phase, from 0 to 1
    duty: float  # share of the cycle for which it stands
    middle: Footprint  # against a point that moves evenly

    def since_touch_down(self, phase: float) -> float:
        """Phase since the last touch-down, from 0 to 1."""
        return (phase - self.touch_down) % 1.0

    def swung(self, phase: float, is_backward: bool) -> float:
        """How much of its swing is done, from 0 to 1; 0 while it stands."""
        share = (self.since_touch_down(phase) - self.duty) / (1.0 - self.duty)
        if share <= 0.0:
            return 0.0
        return 1.0 - share if is_backward else share

    def to_middle(self, phase: float, is_backward: bool) -> float:
        """Phase to the middle of the next stance, from within the swing before it."""
        since = self.since_touch_down(phase)
        return since - 0.5 * self.duty if is_backward else 1.0 + 0.5 * self.duty - since

    def print_at(self, phase: float, stride: float) -> Footprint:
        """The footprint in a frame that moves evenly ahead, by so many m a cycle."""
        ahead = 0.5 * self.duty - self.since_touch_down(phase) + eased(self.swung(phase, False))
        return Footprint(self.middle.place + stride * ahead, self.middle.heading)

    def towards(self, other: "FootCycle", share: float) -> "FootCycle":
        """Between it and another one."""
        later = math.remainder(other.touch_down - self.touch_down, 1.0)
        return FootCycle(
            (self.touch_down + share * later) % 1.0,
            self.duty + share * (other.duty - self.duty),
            self.middle.towards(other.middle, share),
        )


def eased(share: float) -> float:
    """From 0 to 1, slow at both ends."""
    return share * share * (3.0 - 2.0 * share)


def find_foot_cycle(
    places: FloatArray, turns_xyzw: FloatArray, stride: float, at_rest_xyzw: FloatArray
) -> FootCycle | None:
    """When a foot stands in a cycle along x; None unless it does once.

    Args:
        places: Of the foot (r + 1, 3) at equal steps of phase, m, in a frame that moves evenly.
        turns_xyzw: Its orientations (r + 1, 4).
        stride: Length of a cycle, m.
        at_rest_xyzw: Its orientation (4,) as the character rests, facing along x.
    """
    rows = len(places) - 1
    speeds = 1.0 + rows / stride * (places[1:, 0] - places[:-1, 0])
    stands = (speeds < _STANDING).tolist()
    runs = sorted(
        (_length(stands, row), row) for row in range(rows) if stands[row] and not stands[row - 1]
    )
    if not runs or stands.count(True) - runs[-1][0] > _STRAY * rows:
        return None
    length, first = runs[-1]
    row = (first + length // 2) % rows
    x, y, _ = places[row].tolist()
    facing = rotations.multiply(turns_xyzw[row], rotations.conjugate(at_rest_xyzw))
    return FootCycle(
        first / rows, length / rows, Footprint(complex(x, y), float(rotations.yaw(facing)))
    )


def _length(stands: Sequence[bool], first: int) -> int:
    """Rows from a first one on for which a foot stands."""
    return next(
        (more for more in range(len(stands)) if not stands[(first + more) % len(stands)]),
        len(stands),
    )


def at_ease(middle: Footprint, course: Course, frequency: float, height: float) -> Footprint:
    """Where a foot is at mid-stance, in the character's own frame.

    Off the middle of its cycle's stance by as much as brings the ground's force through the root,
    `height` m high, as a course's acceleration asks for; and farther out while going aside, so that
    feet do not meet: they are nearest as one comes down, half a cycle after the other one.
    """
    out = 1j * math.copysign(0.25 * abs(course.left) / frequency, middle.place.imag)
    return Footprint(middle.place + out - height * course.lean, middle.heading)


def sway(cycle: FootCycle, phase: float, frequency: float, height: float) -> float:
    """How far towards a foot that stands the root is, of its distance to that side, from 0 to 1.

    So moves a linear inverted pendulum, `height` m high, that goes to and fro between two feet and
    stands on each in turn (Kajita et al. 2001, "The 3D Linear Inverted Pendulum Mode").
    """
    since = cycle.since_touch_down(phase)
    if since >= cycle.duty:
        return 0.0
    rate, half = math.sqrt(GRAVITY / height), 0.5 * cycle.duty
    return 1.0 - math.cosh(rate * (since - half) / frequency) / math.cosh(rate * half / frequency)


def swung_on(foot: Footprint, target: Footprint, was: float, now: float) -> Footprint:
    """A foot that swings, a tick later on its way to where it comes down.

    Its height goes evenly with its way, but sinks over an edge while the foot is ahead already.

    Args:
        foot: Where it was.
        target: Where it comes down.
        was: How much of its swing was done, from 0 to 1.
        now: How much is; 0 once it has come down.
    """
    along, edge = _rise(foot, target)
    rest = 1.0 - eased(was)
    drop = -edge / rest if rest > 0.0 else 0.0
    in_time = 1.0 - _SOONER * min(max(drop, 0.0) / _DROP, 1.0)
    share = _swing_share(min(was / in_time, 1.0), min(now / in_time, 1.0))
    height = foot.height + share * along + _swing_share(was, now) * edge
    return replace(foot.towards(target, share), height=height)


def clearance(foot: Footprint, target: Footprint, swung: float) -> float:
    """How much higher than its print a foot swings over an edge, m.

    It rises early, and sinks late, when its heel is past the edge; over either it is lifted.

    Args:
        foot: Where it is.
        target: Where it comes down.
        swung: How much of its swing is done, from 0 to 1.
    """
    share = eased(swung)
    if share == 1.0:
        return 0.0
    rest, cube = 1.0 - share, share * share * share
    _, edge = _rise(foot, target)
    over = 1.0 - rest * rest * rest if edge > 0.0 else cube * cube * cube * cube
    rise = edge / rest
    return rise * (over - share) + min(_LIFT * abs(rise), _MOST_LIFT) * hump(swung)


def _rise(foot: Footprint, target: Footprint) -> tuple[float, float]:
    """How much higher a foot comes down than it is, m: what a slope rises, and what edges do."""
    slope = 0.5 * (foot.slope + target.slope)
    along = (slope.conjugate() * (target.place - foot.place)).real
    return along, target.height - foot.height - along


def _swing_share(was: float, now: float) -> float:
    """The share of the way that is left which a foot goes in a tick, of what of its swing is done.

    Both are from 0 to 1; `now` is 0 once it has come down.
    """
    left = 1.0 - eased(was)
    return 1.0 - (1.0 - eased(now)) / left if now > 0.0 and left > 0.0 else 1.0


def hump(swung: float) -> float:
    """From 0 at both ends of a swing to 1 amid it."""
    share = eased(swung)
    return 4.0 * share * (1.0 - share)


def is_there(foot: Footprint, target: Footprint) -> bool:
    """Whether a foot is where the character needs it if it does not move."""
    turn = math.remainder(target.heading - foot.heading, math.tau)
    return abs(target.place - foot.place) < _NEAR and abs(turn) < _FACING
