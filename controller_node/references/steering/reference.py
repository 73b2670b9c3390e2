"""A character that goes where it is told to: walks and runs at commanded velocities."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller_node.references.base import ReferenceState
from controller_node.references.steering.course import Course
from controller_node.references.steering.footholds import Footholds, Ground
from controller_node.references.steering.gait import Gait
from controller_node.references.steering.legs import Legs
from controller_node.references.steering.stepping import Stepping
from controller_node.references.steering.velocity import (
    STOP,
    SteeringLimits,
    VelocityCommand,
    VelocityRegion,
)
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Character
from msgs_config.errors import MotionError
from msgs_config.geometry import rotations

_WINDOW = 1024  # ticks that are remembered: many more than a planner's horizon
_MAX_WAITING = 1000  # commands
_LONGEST_STOP = 10  # s that are looked ahead for a stop
_LEAN_SHARE_AHEAD = 0.5  # share of the full lean ahead


@dataclass(frozen=True)
class Steered:
    """What becomes of a reference by a command."""

    reference: "SteeredReference"
    command: VelocityCommand  # as it is taken: within the limits
    since: int  # the first tick at which the reference may be another one


class SteeredReference:
    """A gait at commanded velocities. It is immutable but for what it remembers of its course.

    Speed and turn rate follow the commands at the accelerations of the limits. The course is
    integrated tick by tick, from `start` on; before it the character is where it is then. It leans
    into bends, so that the ground's force on the feet goes through the root, and half as far as
    that would take ahead as it speeds up, and back as it slows down.
    """

    def __init__(
        self,
        character: Character,
        gait: Gait,
        limits: SteeringLimits,
        *,
        rate_hz: int,
        start: tuple[int, Course] | None = None,
        commands: Sequence[VelocityCommand] = (),
        footholds: Footholds | None = None,
        steps_high: bool = False,
    ) -> None:
        """Begin at a tick on a course, else standing; commands are in the order of their ticks.

        Without footholds the ground is the plane z = 0. Who steps high gets over edges that it does
        not know of.
        """
        self._character, self._gait = character, gait
        self._legs = Legs(character)
        self._stepping = Stepping(gait, footholds, is_high=steps_high)
        self._footholds, self._steps_high = footholds, steps_high
        self.limits = limits
        self._rate = rate_hz
        self._start = (0, self._stepping.standing()) if start is None else start
        self._commands = commands
        self._first, self._courses = self._start[0], [self._start[1]]
        self._poses: dict[int, GeneralizedPosition] = {}
        self._no_acceleration = np.zeros(character.layout.size)

    def __getstate__(self) -> dict[str, object]:
        """All but the poses, which follow from the course."""
        return vars(self) | {"_poses": {}}

    @property
    def repeat_ticks(self) -> int:
        """After how many ticks a command is to be given again, so that it does not time out."""
        return max(math.floor(0.5 * self.limits.timeout * self._rate), 1)

    def sample(self, time: float) -> ReferenceState:
        """The desired state at a tick, `time` s after the episode's first state."""
        tick = round(time * self._rate)
        here, next_one = self._pose(tick), self._pose(tick + 1)
        velocity = self._rate * self._character.layout.difference(here, next_one)
        return ReferenceState(here, velocity, self._no_acceleration)

    def steered(self, command: VelocityCommand, now: int) -> "Steered":
        """Take a command as well, instead of those of the same tick and of later ones.

        `now` is the present tick, before which the reference is not asked for any more.

        Raises:
            MotionError: a number is not finite, or too many commands are yet to begin.
        """
        if not all(map(math.isfinite, (command.forward, command.left, command.turn))):
            raise MotionError(
                f"cmd_vel: the velocity is {command.forward:g}, {command.left:g} m/s and "
                f"{command.turn:g} rad/s; it must be finite"
            )
        command = self.limits.clamped(command)
        in_force = max(self._row(now), 0)
        before = [each for each in self._commands[in_force:] if each.tick < command.tick]
        if len(before) > _MAX_WAITING:
            raise MotionError(f"cmd_vel: more than {_MAX_WAITING} are yet to begin")
        reference = SteeredReference(
            self._character,
            self._gait,
            self.limits,
            rate_hz=self._rate,
            start=(now, self.course(now)),
            commands=[*before, command],
            footholds=self._footholds,
            steps_high=self._steps_high,
        )
        since = self._end_of_likeness(command)
        if now >= self._first:
            reference._take_over(self, now, max(since, now))
        return Steered(reference, command, since)

    def within(self, region: VelocityRegion) -> "SteeredReference":
        """One that has no command yet, and takes them within a region."""
        return self._anew(self.limits.narrowed(region), self._footholds, self._steps_high)

    def over(self, ground: Ground | None) -> "SteeredReference":
        """One that has no command yet, and whose feet find their places on a ground.

        Where that is None, it is a plane but for edges that nobody knows of: it steps high.
        """
        footholds = None if ground is None else Footholds(self._character, ground)
        return self._anew(self.limits, footholds, steps_high=ground is None)

    def _anew(
        self, limits: SteeringLimits, footholds: Footholds | None, steps_high: bool
    ) -> "SteeredReference":
        return SteeredReference(
            self._character,
            self._gait,
            limits,
            rate_hz=self._rate,
            footholds=footholds,
            steps_high=steps_high,
        )

    def _take_over(self, other: "SteeredReference", first: int, last: int) -> None:
        """Remember what another one does, which is the same from one tick to another one."""
        begin = first - other._first
        self._first, self._courses = first, other._courses[begin : last + 1 - other._first]
        self._poses = {tick: pose for tick, pose in other._poses.items() if first <= tick <= last}

    def _end_of_likeness(self, command: VelocityCommand) -> int:
        """The first tick at which a command makes a difference."""
        row = self._row(command.tick)
        if row == len(self._commands) - 1 and command.is_like(self._wanted(command.tick)):
            last = self._commands[row].tick if row >= 0 else command.tick
            return max(last + math.floor(self.limits.timeout * self._rate), command.tick)
        return command.tick

    def course(self, tick: int) -> Course:
        """The motion over the ground at a tick."""
        first, begin = self._start
        if tick < self._first:
            self._first, self._courses = first, [begin]
        while len(self._courses) <= tick - self._first:
            self._courses.append(
                self._advanced(self._courses[-1], self._first + len(self._courses))
            )
            if len(self._courses) > 2 * _WINDOW:
                self._first, self._courses = self._first + _WINDOW, self._courses[_WINDOW:]
        return self._courses[max(tick - self._first, 0)]

    def standing_from(self, tick: int) -> int:
        """The first tick, from one on at which a stop is in force, at which it stands still.

        It steps on until its feet are where it stands at ease.
        """
        at, course = self._start  # apart from the course that is remembered
        last = tick + _LONGEST_STOP * self._rate
        while at < tick or (at < last and (course.is_moving or course.pace > 0.0)):
            at += 1
            course = self._advanced(course, at)
        return at

    def _advanced(self, course: Course, tick: int) -> Course:
        """The course at a tick, from that of the tick before."""
        period = 1.0 / self._rate
        wanted = self._wanted(tick - 1)
        moved = course.advanced(wanted, self.limits, period)
        return self._stepping.advanced(moved, wanted, self.limits, period)

    def _wanted(self, tick: int) -> VelocityCommand:
        """The command in force at a tick."""
        row = self._row(tick)
        if row < 0 or tick - self._commands[row].tick >= self.limits.timeout * self._rate:
            return STOP
        return self._commands[row]

    def _row(self, tick: int) -> int:
        """The last command's that is not after a tick; -1 if there is none."""
        return bisect_right(self._commands, tick, key=lambda command: command.tick) - 1

    def _pose(self, tick: int) -> GeneralizedPosition:
        if tick not in self._poses:
            if len(self._poses) > _WINDOW:
                self._poses.clear()
            self._poses[tick] = self._placed(self.course(tick))
        return self._poses[tick]

    def _placed(self, course: Course) -> GeneralizedPosition:
        """The gait's pose where a course is, leaning about the root, with its feet on their prints.

        Without prints the feet give way as it leans.
        """
        pose, feet = self._gait.at(course.pace, course.phase)
        position, turns = pose.position.copy(), pose.orientations_xyzw.copy()
        root = self._stepping.root(complex(*position[:2].tolist()), course)
        position[:2] = root.real, root.imag
        about_z = rotations.about_z(course.heading)
        lean, upright = _lean(course)
        position[:3] = rotations.rotate(about_z, position[:3])
        position[:3] = (position[0] + course.x, position[1] + course.y, upright * position[2])
        turns[0] = rotations.multiply(rotations.multiply(about_z, lean), turns[0])
        placed = GeneralizedPosition(position, turns)
        position[2] += self._stepping.height(course)
        if course.feet:
            self._legs.reach(placed, self._stepping.on_prints(feet, course))
        position[self._character.layout.rotation_entries] = rotations.log(turns)
        return placed


def _lean(course: Course) -> tuple[FloatArray, float]:
    """The turn xyzw (4,) of the root as it leans, and the cosine of its angle."""
    ahead, left = _LEAN_SHARE_AHEAD * course.lean.real, course.lean.imag
    upright = 1.0 / math.sqrt(1.0 + ahead * ahead + left * left)
    size = math.sqrt(2.0 * (1.0 + upright))
    turn = np.array((-upright * left, upright * ahead, 0.0, 1.0 + upright))
    return turn / size, upright
