"""What a trial asks of a character, judged by states that are made up."""

from dataclasses import dataclass

import numpy as np
import pytest

from actuated_characters.trial.goal import Goal, judge, read_goal
from controller_node.references.base import ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError
from msgs_config.mappings import MappingReader
from tests.support import physics

HUMANOID, PENDULUM = physics.character("humanoid"), physics.character("pendulum")
RATE = 100.0  # Hz
REST = np.array(HUMANOID.rest_position)


@dataclass(frozen=True)
class Still:
    """A reference that stays in one position."""

    position: FloatArray

    def sample(self, time: float) -> ReferenceState:
        del time
        zero = np.zeros(HUMANOID.layout.size)
        return ReferenceState(HUMANOID.layout.configuration(self.position), zero, zero)


def lying() -> FloatArray:
    """The rest pose, turned to the back and let down."""
    position = REST.copy()
    position[2], position[3:6] = 0.1, 0.0
    return position


def states(*parts: tuple[FloatArray, int]) -> FloatArray:
    return np.concatenate([np.tile(position, (count, 1)) for position, count in parts])


def test_who_stands_has_survived() -> None:
    judged = judge(Goal(), HUMANOID, states((REST, 101)), RATE, Still(REST))

    assert judged.has_survived
    assert judged.travelled == 0.0
    assert judged.why == "It did what it should for 1 s."


def test_who_lies_for_three_tenths_of_a_second_fell_when_that_began() -> None:
    position = states((REST, 50), (lying(), 51))

    judged = judge(Goal(), HUMANOID, position, RATE, Still(REST))

    assert judged.failed_at == pytest.approx(0.5)
    assert "fell at 0.5 s" in judged.why
    assert judge(Goal(), HUMANOID, position[:79], RATE, Still(REST)).has_survived


def test_where_the_reference_of_the_trial_lies_it_may_lie() -> None:
    position = states((lying(), 101))

    assert judge(Goal("reference"), HUMANOID, position, RATE, Still(lying())).has_survived
    assert not judge(Goal("reference"), HUMANOID, position, RATE, Still(REST)).has_survived
    assert not judge(Goal(), HUMANOID, position, RATE, Still(lying())).has_survived
    assert judge(Goal("any"), HUMANOID, position, RATE, Still(REST)).has_survived


def test_the_joints_error_is_the_mean_distance_from_the_reference_of_the_trial() -> None:
    moved = REST.copy()
    knee = HUMANOID.layout.dof_names.index("left_knee")
    moved[knee] -= 0.6
    joints = sum(joint.name != "root" for joint in HUMANOID.layout.joints)

    judged = judge(Goal(joint_error=0.02), HUMANOID, states((moved, 11)), RATE, Still(REST))

    assert judged.joint_error == pytest.approx(0.6 / joints)
    assert not judged.has_survived
    assert "0.02 rad" in judged.why
    assert (
        judge(Goal(joint_error=0.06), HUMANOID, states((moved, 11)), RATE, Still(REST)).failed_at
        is None
    )


def test_the_way_along_the_ground() -> None:
    there = REST.copy()
    there[:2] += 0.3, 0.4
    position = states((REST, 5), (there, 6))

    assert judge(Goal(travels=(0.4, 0.6)), HUMANOID, position, RATE, Still(REST)).has_survived
    far = judge(Goal(travels=(1.0, 2.0)), HUMANOID, position, RATE, Still(REST))
    assert far.why == "It went 0.5 m, which should be 1 to 2 m."
    assert far.travelled == pytest.approx(0.5)


def test_where_it_ends() -> None:
    position = np.linspace(0.0, 1.0, 11)[:, np.newaxis]

    def at(least: float, largest: float) -> bool:
        goal = Goal(at_end={"hinge": (least, largest)})
        return judge(goal, PENDULUM, position, RATE, Still(REST)).has_survived

    assert at(0.9, 1.1)
    assert not at(0.0, 0.9)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"posture": "lying"}, "goal.posture is 'lying'; it must be 'upright' or 'reference'"),
        ({"travels": [2, 1]}, "goal.travels is a list; it must be [LEAST, LARGEST]"),
        ({"at_end": {"hinge": 1.0}}, "goal.at_end.hinge is 1.0"),
        ({"joint_error": -1}, "goal.joint_error is -1; it must be a finite number"),
        ({"jonts": 1}, "goal.jonts"),
    ],
)
def test_a_mistake_is_one_line(given: dict[str, object], words: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        read_goal(MappingReader("set.yaml", given, ConfigurationError, "goal."))

    assert words in str(error.value)


def test_a_goal_must_fit_the_character() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'hinge'"):
        Goal(at_end={"hing": (0, 1)}).check(PENDULUM.layout)
    with pytest.raises(ConfigurationError, match="base is fixed"):
        Goal(travels=(0, 1)).check(PENDULUM.layout)
