"""The action FollowJointTrajectory, by messages with its fields, on a bus without ROS."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from controller_node.interface import trajectory_goals
from controller_node.node import ControllerNode
from msgs_config.bus.in_process import Bus, InProcessExecutor
from msgs_config.bus.node import Answer
from msgs_config.messages import topics, typed
from msgs_config.messages.clock import TickClock
from msgs_config.messages.joint_state import JointStateDecoder, JointStateEncoder
from tests.support.interface_types import PlayedGoal, control_message

SUCCESSFUL, INVALID_GOAL, INVALID_JOINTS, OLD, PATH, GOAL = 0, -1, -2, -3, -4, -5
REST = 0.5  # rad, of the pendulum
CLOCK = TickClock(240)


class Stand:
    """A controller of a pendulum, whose states a test makes."""

    def __init__(self) -> None:
        bus = Bus(write=lambda *_: None)
        self.place = bus.node(topics.CONTROLLER_NODE, {"character": "pendulum"})
        simulator = bus.node("simulator", {})
        self._torques = simulator.subscription(topics.JOINT_TORQUES)
        self._states = simulator.publisher(topics.JOINT_STATES)
        self._references = simulator.subscription(topics.REFERENCE.of(topics.CONTROLLER_NODE))
        self.accepted = simulator.subscription(topics.ACTIVE_TRAJECTORY.of(topics.CONTROLLER_NODE))
        self.node = ControllerNode(self.place)
        self._turns = self.node.turns(False, InProcessExecutor())  # type: ignore[arg-type]
        self.tick, self.reference = 0, REST
        self.answer_states(1)

    def answer_states(self, count: int, away: float = 0.0) -> None:
        """States that are where the reference was a tick before, or `away` from there (rad)."""
        encoder = JointStateEncoder(["hinge"])
        for _ in range(count):
            self.tick += 1
            effort = () if self.tick == 1 else (np.zeros(1),)
            state = np.array([self.reference + away])
            self._states.publish(
                encoder.encode(CLOCK.stamp_ns(self.tick), state, np.zeros(1), *effort)
            )
            while self._torques.take() is None:
                next(self._turns)
            raw = self._references.take()
            self.reference = float(JointStateDecoder().decode(raw).position[0])

    def send(self, **fields: Any) -> tuple[PlayedGoal, Answer]:
        given = {"trajectory": trajectory([(0.5, 0.8)]), **fields}
        goal = PlayedGoal(
            control_message("FollowGoal", **given),
            control_message("FollowResult"),
            lambda: control_message("FollowFeedback"),
        )
        return goal, self.place.goal_handlers["follow_joint_trajectory"](goal)


def trajectory(points: list[tuple[float, float]], joint: str = "hinge", stamp_ns: int = 0) -> Any:
    made = [
        typed.new(
            "trajectory_msgs/msg/JointTrajectoryPoint",
            positions=np.array([position]),
            time_from_start=duration(time),
        )
        for time, position in points
    ]
    return typed.stamped(typed.JOINT_TRAJECTORY, stamp_ns, joint_names=[joint], points=made)


def duration(seconds: float) -> Any:
    whole = int(seconds)
    return typed.new(
        "builtin_interfaces/msg/Duration", sec=whole, nanosec=round((seconds - whole) * 1e9)
    )


def tolerance(position: float = 0.0, velocity: float = 0.0, name: str = "hinge") -> list[Any]:
    return [control_message("JointTolerance", name=name, position=position, velocity=velocity)]


@pytest.fixture
def stand(monkeypatch: pytest.MonkeyPatch) -> Iterator[Stand]:
    monkeypatch.setattr(trajectory_goals, "find_spec", lambda name: name)
    made = Stand()
    yield made
    made.node.destroy_node()


def test_a_goal_is_reached_at_the_time_of_its_last_point(stand: Stand) -> None:
    goal, answer = stand.send(goal_tolerance=tolerance(0.05), path_tolerance=tolerance(0.05))

    stand.answer_states(120)  # the first of them begins it: half a second is over at the 121st
    assert not answer.is_given
    stand.answer_states(1)

    assert answer.is_given and answer.success
    assert (goal.result.error_code, goal.result.error_string) == (SUCCESSFUL, "")
    assert stand.reference == pytest.approx(0.8, abs=1e-9)
    assert stand.accepted.take() is not None  # a replay has it


def test_feedback_has_what_is_wanted_and_what_is_there(stand: Stand) -> None:
    goal, _ = stand.send()

    stand.answer_states(60, away=-0.01)

    last = goal.told[-1]
    assert len(goal.told) == 5  # 20 a second
    assert last.joint_names == ["hinge"]
    assert last.error.positions[0] == pytest.approx(
        last.desired.positions[0] - last.actual.positions[0]
    )
    since = last.desired.time_from_start
    assert since.sec + since.nanosec * 1e-9 == pytest.approx(0.2, abs=1e-6)


def test_leaving_the_path_aborts_it(stand: Stand) -> None:
    goal, answer = stand.send(path_tolerance=tolerance(0.05))
    stand.answer_states(10)
    assert not answer.is_given

    stand.answer_states(1, away=-0.2)

    assert answer.is_given and not answer.success
    assert goal.result.error_code == PATH
    assert "'hinge'" in goal.result.error_string and "0.05" in goal.result.error_string


def test_the_goal_has_the_time_of_its_patience_to_be_reached(stand: Stand) -> None:
    late, answer = stand.send(goal_tolerance=tolerance(0.05), goal_time_tolerance=duration(0.1))
    stand.answer_states(130, away=-0.1)
    assert not answer.is_given
    stand.answer_states(1)
    assert late.result.error_code == SUCCESSFUL and answer.success

    never, answer = stand.send(goal_tolerance=tolerance(0.05), goal_time_tolerance=duration(0.1))
    stand.answer_states(150, away=-0.1)
    assert answer.is_given and never.result.error_code == GOAL


def test_velocities_are_judged_where_they_have_a_tolerance(stand: Stand) -> None:
    goal, _ = stand.send(path_tolerance=tolerance(velocity=0.1))

    stand.answer_states(60)  # the states of this test stand still: 0.6 rad/s are wanted

    assert goal.result.error_code == PATH and "velocity" in goal.result.error_string


@pytest.mark.parametrize(
    ("fields", "code", "says"),
    [
        ({"trajectory": trajectory([(0.5, 0.8)], joint="elbow")}, INVALID_JOINTS, "elbow"),
        ({"trajectory": trajectory([])}, INVALID_GOAL, "no points"),
        ({"trajectory": trajectory([(0.5, np.nan)])}, INVALID_GOAL, "nan"),
        ({"trajectory": trajectory([(0.5, 0.8)], stamp_ns=1)}, OLD, "over"),
    ],
)
def test_a_goal_that_cannot_be_is_refused(
    stand: Stand, fields: dict[str, Any], code: int, says: str
) -> None:
    before = stand.reference

    goal, answer = stand.send(**fields)
    stand.answer_states(5)

    assert answer.is_given and not answer.success
    assert goal.result.error_code == code and says in goal.result.error_string
    assert stand.reference == before


@pytest.mark.parametrize(
    "wrong", [tolerance(-0.5), tolerance(np.nan), tolerance(0.1, name="elbow")]
)
def test_tolerances_that_cannot_be_are_refused(stand: Stand, wrong: list[Any]) -> None:
    goal, _ = stand.send(path_tolerance=wrong)
    stand.answer_states(2)

    assert goal.result.error_code == INVALID_GOAL and "path_tolerance" in goal.result.error_string


def test_a_new_goal_takes_the_place_of_the_one_before(stand: Stand) -> None:
    first, first_answer = stand.send()
    stand.answer_states(20)

    _, second_answer = stand.send(trajectory=trajectory([(0.2, 0.3)]))
    stand.answer_states(60)

    assert first_answer.is_given and "another goal" in first.result.error_string
    assert second_answer.success and stand.reference == pytest.approx(0.3, abs=1e-9)


def test_a_goal_that_is_cancelled_comes_to_rest(stand: Stand) -> None:
    goal, answer = stand.send()
    stand.answer_states(40)
    wanted = stand.reference

    goal.is_cancelled = True
    stand.answer_states(100)

    assert answer.is_given and not answer.success
    assert abs(stand.reference - wanted) < 0.1
    rest = stand.reference
    stand.answer_states(20)
    assert stand.reference == rest


def test_with_a_stamp_it_begins_then(stand: Stand) -> None:
    start = CLOCK.stamp_ns(stand.tick + 49)
    _, answer = stand.send(trajectory=trajectory([(0.5, 0.8)], stamp_ns=start))

    stand.answer_states(48)
    assert stand.reference == REST
    stand.answer_states(121)

    assert answer.success


def test_without_the_package_there_is_none() -> None:
    place = Bus(write=lambda *_: None).node(topics.CONTROLLER_NODE, {"character": "pendulum"})
    node = ControllerNode(place)

    assert place.goal_handlers == {}
    node.destroy_node()
