"""The action `FollowJointTrajectory` of `control_msgs`: a trajectory, with tolerances. No ROS."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from importlib.util import find_spec
from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.bus.node import Answer, BusNode, Goal
from msgs_config.bus.stamped_subscription import PastStampError
from msgs_config.character.layout import JointLayout
from msgs_config.errors import LayoutError, MotionError
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.state import StampedReference, StampedState

PACKAGE = "control_msgs"
_ACTION, _TYPE = "follow_joint_trajectory", f"{PACKAGE}/action/FollowJointTrajectory"
_NO_LIMIT = -1.0  # a tolerance of a joint that may be anywhere
_FEEDBACK_PERIOD_NS = NANOSECONDS_PER_SECOND // 20  # of simulated time


class ErrorCode(IntEnum):
    """The result's `error_code`."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


@dataclass(frozen=True)
class Tolerances:
    """How far entries may be away from the reference; infinite where nothing is said."""

    position: FloatArray  # (m,) rad or m
    velocity: FloatArray  # (m,) rad/s or m/s

    @classmethod
    def of(cls, what: str, given: Sequence[Any], names: Sequence[str]) -> "Tolerances":
        """Those of a list of `JointTolerance`; 0 leaves the default, none, and -1 is none, too.

        Raises:
            MotionError: a name is none of the trajectory's, or a number cannot be.
        """
        position, velocity = np.full(len(names), np.inf), np.full(len(names), np.inf)
        for each in given:
            if each.name not in names:
                raise MotionError(f"{what}: '{each.name}' is not among the trajectory's joints")
            entry = list(names).index(each.name)
            for array, number in ((position, each.position), (velocity, each.velocity)):
                if not (number >= 0.0 or number == _NO_LIMIT):  # a NaN neither
                    raise MotionError(
                        f"{what} of '{each.name}' is {number:g}; it must be 0 or more, or -1"
                    )
                if number > 0.0:
                    array[entry] = number
        return cls(position, velocity)

    def violation(self, names: Sequence[str], error: FloatArray, velocity_error: FloatArray) -> str:
        """Which entry is beyond them, by how much; empty if none is."""
        for what, limits, errors in (
            ("position", self.position, error),
            ("velocity", self.velocity, velocity_error),
        ):
            beyond = np.abs(errors) > limits
            if beyond.any():
                entry = int(np.argmax(beyond))
                return (
                    f"the {what} of '{names[entry]}' is {errors[entry]:.4g} away; its tolerance is "
                    f"{limits[entry]:g}"
                )
        return ""


class TrajectoryGoal:
    """A goal that is pursued: judged at each state from its start on."""

    def __init__(self, goal: Goal, layout: JointLayout, start_ns: int) -> None:
        """Of a trajectory that was accepted, and begins at a stamp.

        Raises:
            MotionError: a tolerance cannot be.
        """
        request = goal.request
        self.goal, self.answer, self._layout = goal, Answer(), layout
        self.names = tuple(request.trajectory.joint_names)
        self._entries: IntArray = layout.indices(self.names)
        self._path = Tolerances.of("path_tolerance", request.path_tolerance, self.names)
        self._end = Tolerances.of("goal_tolerance", request.goal_tolerance, self.names)
        times = [_nanoseconds(point.time_from_start) for point in request.trajectory.points]
        self._start_ns, self._times_ns = start_ns, np.array(times, dtype=np.int64) + start_ns
        self._patience_ns = _nanoseconds(request.goal_time_tolerance)
        self._feedback_at_ns = start_ns

    def judge(self, state: StampedState, reference: StampedReference) -> None:
        """Give the answer if it is over, else tell how far it is, 20 times a simulated second."""
        if state.stamp_ns < self._start_ns:
            return
        error, velocity_error = self._errors(state, reference)
        over_ns = state.stamp_ns - int(self._times_ns[-1])
        if over_ns < 0:
            if violation := self._path.violation(self.names, error, velocity_error):
                self.finish(ErrorCode.PATH_TOLERANCE_VIOLATED, violation)
                return
        elif not (violation := self._end.violation(self.names, error, velocity_error)):
            self.finish(ErrorCode.SUCCESSFUL, "")
            return
        elif over_ns >= self._patience_ns:
            self.finish(ErrorCode.GOAL_TOLERANCE_VIOLATED, violation)
            return
        if state.stamp_ns >= self._feedback_at_ns:
            self._feedback_at_ns = state.stamp_ns + _FEEDBACK_PERIOD_NS
            self._tell(state, reference, error, velocity_error)

    def _errors(
        self, state: StampedState, reference: StampedReference
    ) -> tuple[FloatArray, FloatArray]:
        """Reference against state (m,) of the named entries, and likewise of the velocities."""
        is_at, wanted = map(self._layout.configuration, (state.position, reference.position))
        away = self._layout.difference(is_at, wanted)
        return away[self._entries], (reference.velocity - state.velocity)[self._entries]

    def finish(self, code: ErrorCode, sentence: str) -> None:
        """End it with a result."""
        self.goal.result.error_code = int(code)
        self.goal.result.error_string = sentence
        self.answer.give(code == ErrorCode.SUCCESSFUL, sentence)

    def _tell(
        self,
        state: StampedState,
        reference: StampedReference,
        error: FloatArray,
        velocity_error: FloatArray,
    ) -> None:
        message, entries = self.goal.feedback, self._entries
        stamp = message.header.stamp
        stamp.sec, stamp.nanosec = divmod(state.stamp_ns, NANOSECONDS_PER_SECOND)
        message.joint_names = list(self.names)
        for point, positions, velocities in (
            (message.desired, reference.position[entries], reference.velocity[entries]),
            (message.actual, state.position[entries], state.velocity[entries]),
            (message.error, error, velocity_error),
        ):
            point.positions, point.velocities = positions.tolist(), velocities.tolist()
            since = point.time_from_start
            since.sec, since.nanosec = divmod(
                state.stamp_ns - self._start_ns, NANOSECONDS_PER_SECOND
            )
        if hasattr(message, "index"):  # control_msgs of Jazzy's first releases lack it
            message.index = int(np.searchsorted(self._times_ns, state.stamp_ns))
        self.goal.publish(message)


class TrajectoryGoals:
    """Takes goals, of which the newest is pursued, and judges it after each answer.

    A goal counts as a message on `~/joint_trajectory` that came between the same two states does;
    with a stamp it begins at that, and repeats.
    """

    def __init__(
        self,
        node: BusNode,
        layout: JointLayout,
        accept: Callable[[Any], int],
        stop: Callable[[tuple[str, ...]], object],
    ) -> None:
        """Offer the action where its package is installed.

        `accept` has a trajectory tracked and gives the stamp of its start, or raises MotionError or
        LayoutError; `stop` brings the named entries to rest.
        """
        self._layout, self._accept, self._stop = layout, accept, stop
        self._waiting: list[tuple[Goal, Answer]] = []
        self._pursued: TrajectoryGoal | None = None
        if find_spec(PACKAGE) is not None:
            node.offer_action(_ACTION, _TYPE, self.pursue)

    def pursue(self, goal: Goal) -> Answer:
        """Take a goal, which counts from the next answered state on."""
        answer = Answer()
        self._waiting.append((goal, answer))
        return answer

    def take(self) -> None:
        """Have those that wait tracked, before the answer to a state."""
        waiting, self._waiting = self._waiting, []
        for goal, answer in waiting:
            self._begin(goal, answer)
        if self._pursued is not None and self._pursued.goal.is_cancelled:
            self._stop(self._pursued.names)
            self._end("cancelled")

    def _begin(self, goal: Goal, answer: Answer) -> None:
        request, code = goal.request, ErrorCode.INVALID_GOAL
        try:
            if request.multi_dof_trajectory.points or request.multi_dof_trajectory.joint_names:
                raise MotionError("'multi_dof_trajectory' is not taken; it must be empty")
            names = tuple(request.trajectory.joint_names)
            code = ErrorCode.INVALID_JOINTS
            self._layout.indices(names)
            code = ErrorCode.INVALID_GOAL
            for what in ("path_tolerance", "goal_tolerance"):
                Tolerances.of(what, getattr(request, what), names)
            begun = TrajectoryGoal(goal, self._layout, self._accept(request.trajectory))
        except PastStampError as error:
            code, sentence = ErrorCode.OLD_HEADER_TIMESTAMP, str(error)
        except (MotionError, LayoutError) as error:
            sentence = str(error)
        else:
            self._end("another goal has taken its place")
            self._pursued = begun
            begun.answer.when_given(lambda: answer.give(begun.answer.success))
            return
        goal.result.error_code, goal.result.error_string = int(code), sentence
        answer.give(False, sentence)

    def judge(self, state: StampedState, reference: StampedReference) -> None:
        """Judge the goal that is pursued, by an answered state."""
        if self._pursued is not None:
            self._pursued.judge(state, reference)
            if self._pursued.answer.is_given:
                self._pursued = None

    def begin_episode(self) -> None:
        """End the goal that is pursued: an episode's end discards its trajectory."""
        self._end("the episode has ended")

    def replaced(self) -> None:
        """End the goal that is pursued: a message on `~/joint_trajectory` has taken its place."""
        self._end("another trajectory has taken its place")

    def _end(self, sentence: str) -> None:
        if self._pursued is not None:
            self._pursued.finish(ErrorCode.INVALID_GOAL, sentence)
            self._pursued = None


def _nanoseconds(duration: Any) -> int:
    return int(duration.sec) * NANOSECONDS_PER_SECOND + int(duration.nanosec)
