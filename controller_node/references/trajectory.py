"""Trajectories that replace the reference while it runs, without a jump.

The points are those of `trajectory_msgs/JointTrajectory`, and are interpolated as ros2_control's
`joint_trajectory_controller` does: linear between positions, cubic where there are velocities too,
quintic where there are accelerations.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller_node.references.base import Reference, ReferenceState
from controller_node.references.curve import Curve, Knots
from controller_node.references.limits import LARGEST_NUMBER, SHORTEST_TIME, JointLimits
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.character.model import Character
from msgs_config.errors import LayoutError, MotionError

_SAME_POSITION = 1e-3  # rad or m that a first point at time 0 may be away from the reference
_MOST_WAITING = 100  # trajectories
_MOST_POINTS = 10_000
_REST_SPEED = 1e-6  # rad/s or m/s


@dataclass(frozen=True)
class TrajectoryPoints:
    """p points of m degrees of freedom; units and frames are those of `joint_states`."""

    dof_names: tuple[str, ...]
    times: FloatArray  # (p,) s since the trajectory's start
    positions: FloatArray  # (p, m)
    velocities: FloatArray | None = None  # (p, m)
    accelerations: FloatArray | None = None  # (p, m)


def points_of_lists(
    dof_names: Sequence[str],
    times: Sequence[float],
    positions: Sequence[Sequence[float]],
    velocities: Sequence[Sequence[float]],
    accelerations: Sequence[Sequence[float]],
) -> TrajectoryPoints:
    """Points of the lists that a message holds, one a point; empty ones stand for nothing given.

    Raises:
        MotionError: the lists are of unequal length, or some points lack what others have.
    """
    width = len(dof_names)
    if not width:
        raise MotionError("trajectory: it names no degree of freedom")
    rows = _rows("positions", positions, width)
    if rows is None and len(positions):
        raise MotionError("trajectory: point 1 has no positions; every point needs them")
    return TrajectoryPoints(
        tuple(dof_names),
        np.array(times, dtype=float),
        np.zeros((0, width)) if rows is None else rows,
        _rows("velocities", velocities, width),
        _rows("accelerations", accelerations, width),
    )


def _rows(what: str, lists: Sequence[Sequence[float]], width: int) -> FloatArray | None:
    """An array (p, width), or None if every list is empty."""
    if not any(len(numbers) for numbers in lists):
        return None
    for number, numbers in enumerate(lists, start=1):
        if len(numbers) != width:
            raise MotionError(
                f"trajectory: point {number} has {len(numbers)} {what}; it must have {width}, one "
                "for each degree of freedom, or no point may have any"
            )
    return np.array(lists, dtype=float)


def _check(character: Character, points: TrajectoryPoints) -> None:
    """Raise MotionError if the character cannot follow the points; they are counted from 1."""
    if not points.times.size:
        raise MotionError("trajectory: it has no points; it must have one or more")
    if points.times.size > _MOST_POINTS:
        raise MotionError(
            f"trajectory: it has {points.times.size} points; it must have {_MOST_POINTS} or fewer"
        )
    try:
        indices = character.layout.indices(points.dof_names)
    except LayoutError as error:
        raise MotionError(f"trajectory: {error}") from error
    _check_numbers(points)
    _check_times(points.times)
    positions = np.zeros((len(points.times), character.layout.size))
    positions[:, indices] = points.positions
    limits = JointLimits(character)
    for row, column in np.argwhere(limits.excess(positions)[:, indices] > 0.0)[:1].tolist():
        raise _wrong(
            points,
            (row, column),
            "position",
            points.positions,
            f"within the joint's limits, {limits.text(int(indices[column]))}",
        )


def _check_numbers(points: TrajectoryPoints) -> None:
    if points.velocities is None and points.accelerations is not None:
        raise MotionError("trajectory: it has accelerations without velocities; it must have both")
    for what, array in (
        ("position", points.positions),
        ("velocity", points.velocities),
        ("acceleration", points.accelerations),
    ):
        if array is not None:
            for row, column in np.argwhere(~(np.abs(array) <= LARGEST_NUMBER))[:1].tolist():
                right = f"from {-LARGEST_NUMBER:g} to {LARGEST_NUMBER:g}"
                raise _wrong(points, (row, column), what, array, right)
    if points.velocities is not None:
        for (column,) in np.argwhere(np.abs(points.velocities[-1]) > _REST_SPEED)[:1].tolist():
            raise MotionError(
                f"trajectory: the last point's velocity of '{points.dof_names[column]}' is "
                f"{points.velocities[-1, column]:g}; it must be 0, for there the motion ends"
            )


def _wrong(
    points: TrajectoryPoints, place: tuple[int, int], what: str, array: FloatArray, right: str
) -> MotionError:
    row, column = place
    return MotionError(
        f"trajectory: point {row + 1}: {what} of '{points.dof_names[column]}' is "
        f"{array[row, column]:g}; it must be {right}"
    )


def _check_times(times: FloatArray) -> None:
    for number, time in enumerate(times.tolist(), start=1):
        if not 0.0 <= time <= LARGEST_NUMBER:
            raise MotionError(
                f"trajectory: point {number} is at {time:g} s; it must be from 0 to "
                f"{LARGEST_NUMBER:g} s after the start"
            )
    for row in np.flatnonzero(np.diff(times) < SHORTEST_TIME)[:1].tolist():
        raise MotionError(
            f"trajectory: point {row + 2} is at {times[row + 1]:g} s; it must be later than the "
            f"{times[row]:g} s of the point before"
        )
    if times[-1] < SHORTEST_TIME:
        raise MotionError(
            f"trajectory: its last point is at {times[-1]:g} s; it must be later than the start"
        )


@dataclass(frozen=True)
class TrajectoryReference:
    """A reference whose place trajectories take; `curve` is the present one, on episode time.

    Like everything that a new episode begins with, one without a curve is made for each episode.
    """

    character: Character
    before: Reference  # what holds until the present trajectory's start
    curve: Curve | None = None
    pending: int = 0  # trajectories that are yet to begin, the present one among them

    def sample(self, time: float) -> ReferenceState:
        """The desired state `time` seconds after the episode's first state."""
        if self.curve is None or time < self.curve.start:
            return self.before.sample(time)
        return self.curve.sample(time)

    def replaced(
        self, points: TrajectoryPoints, start: float, now: float | None = None
    ) -> "TrajectoryReference":
        """The reference that follows the points from `start` (s of the episode) on.

        A quintic leads from the reference as it moves at `start` to how the motion through the
        points begins, so that position, velocity and acceleration are continuous there. A first
        point at time 0 stands for the reference at `start`. What is not named comes to rest where
        it is at `start`, by the time of the first point that is to come. After the last point all
        is at rest.

        What was before `start` stays, but for what is over at the present time `now`, by
        default the start. Limits are those of the points: a quintic from a
        fast motion can swing beyond them.

        Raises:
            MotionError: the character cannot follow the points, the first one, at time 0, is not
                where the reference is, or too many trajectories are yet to begin.
        """
        _check(self.character, points)
        layout, there = self.character.layout, self.sample(start)
        knots = _knots(layout, points, start, there)
        if points.times[0] < SHORTEST_TIME:
            _check_first(self.character, points, knots, there)
            knots = knots[1:]
        curve = Curve(layout, _lead(layout, start, there, knots), knots)
        before, pending = self._until(start, start if now is None else now)
        if pending > _MOST_WAITING:
            raise MotionError(f"trajectory: more than {_MOST_WAITING} are yet to begin")
        return TrajectoryReference(self.character, before, curve, pending)

    def _until(self, start: float, now: float) -> tuple[Reference, int]:
        """The reference until a trajectory's start, and how many are yet to begin then."""
        if self.curve is None or start <= self.curve.start:
            return self.before, 1
        if now < self.curve.start:
            return self, self.pending + 1
        return self.curve, 1


def _knots(
    layout: JointLayout, points: TrajectoryPoints, start: float, now: ReferenceState
) -> Knots:
    """The points for the whole layout on episode time; what is not named stays where it is now."""
    indices, still = layout.indices(points.dof_names), np.zeros((len(points.times), layout.size))

    def filled(base: FloatArray, array: FloatArray) -> FloatArray:
        base = base.copy()
        base[:, indices] = array
        return base

    return Knots(
        start + points.times,
        layout.configuration(filled(still + now.configuration.position, points.positions)),
        None if points.velocities is None else filled(still, points.velocities),
        None if points.accelerations is None else filled(still, points.accelerations),
    )


def _check_first(
    character: Character, points: TrajectoryPoints, knots: Knots, now: ReferenceState
) -> None:
    """A first point at time 0 must be where the reference is."""
    layout, unit = character.layout, JointLimits(character).unit
    indices = layout.indices(points.dof_names)
    whole = knots.configurations
    first = GeneralizedPosition(whole.position[0], whole.orientations_xyzw[0])
    away = np.abs(layout.difference(now.configuration, first)[indices])
    if away.max() > _SAME_POSITION:
        column = int(away.argmax())
        raise MotionError(
            f"trajectory: point 1 is at time 0, but '{points.dof_names[column]}' is "
            f"{away[column]:.3g} {unit(int(indices[column]))} away from where the reference is; "
            f"it must be within {_SAME_POSITION:g}, or come later"
        )


def _lead(layout: JointLayout, start: float, now: ReferenceState, knots: Knots) -> Knots:
    """The knots of the quintic from the state at `start` to the beginning of the motion."""
    begin = Curve(layout, knots).sample(float(knots.times[0]))  # a curve of one knot is at rest
    velocity = begin.velocity if knots.velocities is None else knots.velocities[0]
    acceleration = begin.acceleration if knots.accelerations is None else knots.accelerations[0]
    present, first = now.configuration, knots.configurations
    return Knots(
        np.array([start, knots.times[0]]),
        GeneralizedPosition(
            np.array([present.position, first.position[0]]),
            np.array([present.orientations_xyzw, first.orientations_xyzw[0]]),
        ),
        np.array([now.velocity, velocity]),
        np.array([now.acceleration, acceleration]),
    )
