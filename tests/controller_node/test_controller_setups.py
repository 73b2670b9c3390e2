"""The controller in force and the one for the next episode, without ROS."""

import numpy as np
import pytest

from controller_node.controller_setups import ControllerSetups
from controller_node.parameters import PARAMETERS, character_parameters
from msgs_config.errors import ActuatedCharactersError, ConfigurationError
from msgs_config.messages.state import StampedState
from msgs_config.parameters import Parameter, Values, resolve
from tests.support.physics import character, controller

HUMANOID = character("humanoid")
DECLARED: list[Parameter] = PARAMETERS + character_parameters(HUMANOID)
WALK: dict[str, object] = {"reference": "clip", "clip": "walk"}


def setups(**given: object) -> ControllerSetups:
    return ControllerSetups(HUMANOID, DECLARED, resolve(DECLARED, WALK | given))


def changed(made: ControllerSetups, **values: object) -> Values:
    """The values in force and coming, of which some are others."""
    latest = (made.upcoming or made.in_force).values
    return resolve(DECLARED, latest | values)


def effort_of(made: ControllerSetups) -> bytes:
    """What the controller in force answers to a first state, to the bit."""
    state = StampedState(10**9, np.array(HUMANOID.rest_position), np.zeros(34), None)
    effort, reference = made.in_force.controller.compute_effort(state, 10**9)
    return effort.tobytes() + reference.position.tobytes()


def expected(**given: object) -> bytes:
    state = StampedState(10**9, np.array(HUMANOID.rest_position), np.zeros(34), None)
    effort, reference = controller("humanoid", **WALK | given).compute_effort(state, 10**9)
    return effort.tobytes() + reference.position.tobytes()


def test_what_is_for_the_next_episode_waits_for_it() -> None:
    made = setups()

    made.take(changed(made, clip="run", gravity=1.62))

    assert made.in_force.values["clip"] == "walk"
    assert effort_of(made) == expected()
    assert made.begin_episode()
    assert made.in_force.values["clip"] == "run" and made.upcoming is None
    assert effort_of(made) == expected(clip="run", gravity=1.62)
    assert not made.begin_episode()


def test_what_is_for_the_next_episode_does_not_touch_this_one() -> None:
    """Its planner, for one, would seek another plan, and no replay would know when."""
    made = setups()
    settings = made.in_force.controller.settings

    made.take(changed(made, clip="run"))

    assert made.in_force.controller.settings is settings


def test_live_values_count_at_once_and_in_the_next_episode_too() -> None:
    made = setups()

    made.take(changed(made, clip="run"))
    coming = made.upcoming
    made.take(changed(made, **{"gain_scale.p": 0.5}))

    assert made.upcoming is coming  # which is not built again
    assert effort_of(made) == expected(**{"gain_scale.p": 0.5})
    assert made.begin_episode()
    assert effort_of(made) == expected(clip="run", **{"gain_scale.p": 0.5})


def test_what_is_set_back_changes_nothing() -> None:
    made = setups()

    made.take(changed(made, clip="run"))
    assert made.first_state is not made.in_force.first_state
    made.take(changed(made, clip="walk"))

    assert made.first_state is made.in_force.first_state
    assert not made.begin_episode()


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"clip": "limbo"}, "limbo"),
        ({"behaviour": "reactive", "library": ["limbo"]}, "limbo"),
        ({"feedforward": "nowhere.csv"}, "nowhere.csv"),
        ({"behaviour": "reactive", "limp.threshold": 1.0}, "limp.threshold"),
        ({"clip": "run", "law": "feedforward"}, "feedforward"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line_and_changes_nothing(
    values: dict[str, object], words: str
) -> None:
    made = setups()

    with pytest.raises(ActuatedCharactersError, match=words) as error:
        made.check(changed(made, **values))

    assert "\n" not in str(error.value)
    assert made.upcoming is None and made.in_force.values["clip"] == "walk"
    assert effort_of(made) == expected()


def test_the_root_is_driven_only_in_runs_that_began_so() -> None:
    assisted = setups()
    assisted.take(changed(assisted, root_assistance=False))
    assert assisted.begin_episode() and not assisted.in_force.drives_root
    assisted.take(changed(assisted, root_assistance=True))
    assert assisted.begin_episode() and assisted.in_force.drives_root

    alone = setups(root_assistance=False)
    for _ in range(2):
        with pytest.raises(ConfigurationError, match=r"'commanded_joints'.*'root_assistance'"):
            alone.check(changed(alone, root_assistance=True))
