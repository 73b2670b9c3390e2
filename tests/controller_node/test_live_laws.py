"""Laws and gains that change while a controller runs: from the next state on, or not at all."""

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from controller_node.control_laws import LAWS
from controller_node.effort_series import write_effort_series
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from tests.support.physics import character, controller
from tests.support.ros import ControllerClient, Processes, joint_state, stamp_ns

CLOCK = TickClock(240)
FIRST = CLOCK.stamp_ns(1)
NODE = "controller_node"
HUMANOID = character("humanoid").layout
PENDULUM = character("pendulum").layout
TARGET = character("pendulum").rest_position[0]  # rad
INTEGRAL = {"gains.chest.i": 30.0, "gains.left_knee.i": 20.0}


@pytest.fixture(scope="module")
def series(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A file of efforts for the humanoid: at each tick other ones."""
    file = tmp_path_factory.mktemp("series") / "efforts.csv"
    efforts = np.random.default_rng(1).uniform(-9.0, 9.0, (50, HUMANOID.size))
    write_effort_series(file, HUMANOID, np.arange(50) / 240.0, efforts)
    return str(file)


def some_state(name: str, tick: int) -> StampedState:
    """A state near the rest pose, another one at each tick."""
    whole, rng = character(name), np.random.default_rng(tick)
    position = whole.rest_position + rng.uniform(-0.2, 0.2, whole.layout.size)
    velocity = rng.uniform(-0.5, 0.5, whole.layout.size)
    effort = None if tick == 1 else np.zeros(whole.layout.size)
    return StampedState(CLOCK.stamp_ns(tick), position, velocity, effort)


def as_message(name: str, state: StampedState) -> JointState:
    effort = [] if state.effort is None else state.effort.tolist()
    position, velocity = state.position.tolist(), state.velocity.tolist()
    names = character(name).layout.dof_names
    return joint_state(state.stamp_ns, names, position, velocity, effort)


def answers(driver: Any, *ticks: int) -> FloatArray:
    """The humanoid's efforts (ticks, n) in some ticks."""
    return np.array(
        [driver.compute_effort(some_state("humanoid", tick), FIRST)[0] for tick in ticks]
    )


# Without ROS


def walker(law: str, series: str, **given: object) -> Any:
    clip = {"reference": "clip", "feedforward": series}
    return controller("humanoid", law=law, **clip, **INTEGRAL, **given)


@pytest.mark.slow
@pytest.mark.parametrize(("before", "after"), list(permutations(LAWS.names, 2)))
def test_another_law_answers_the_next_state_as_if_it_had_always_done(
    before: str, after: str, series: str
) -> None:
    """The integral of `pid` begins at zero, as in an episode's first state."""
    driver, other = walker(before, series), walker(after, series)
    answers(driver, 1, 2)

    driver.settings = other.settings

    expected = answers(other, 3, 4)
    found = answers(driver, 3, 4)
    assert found.tobytes() == expected.tobytes()
    assert found.tobytes() != answers(walker(before, series), 1, 2, 3, 4)[2:].tobytes()


def test_other_gains_leave_the_integral_that_has_grown(series: str) -> None:
    free: dict[str, object] = {"effort_limit.chest": 1e6, "effort_limit.left_knee": 1e6}  # it grows
    stronger = free | {"gain_scale.p": 2.0}
    driver, strong = walker("pid", series, **free), walker("pid", series, **stronger)
    answers(driver, 1, 2)
    answers(strong, 1, 2)

    driver.settings = strong.settings

    found = answers(driver, 3, 4)
    assert found.tobytes() == answers(strong, 3, 4).tobytes()
    assert found.tobytes() != answers(walker("pid", series, **stronger), 3, 4).tobytes()


def test_the_integral_begins_at_zero_when_the_law_was_another_one_meanwhile(series: str) -> None:
    driver = walker("pid", series)
    pid, pd = driver.settings, walker("pd", series).settings
    answers(driver, 1, 2)

    driver.settings = pd
    driver.settings = pid

    expected = answers(walker("pid", series), 3, 4)
    assert answers(driver, 3, 4).tobytes() == expected.tobytes()


def test_a_law_that_lacks_its_file_is_refused_and_the_one_before_goes_on() -> None:
    driver, untouched = controller("humanoid", law="pid"), controller("humanoid", law="pid")
    answers(driver, 1, 2)
    answers(untouched, 1, 2)
    wanted = replace(driver.settings, law="feedforward")

    with pytest.raises(ConfigurationError, match="'feedforward' needs the parameter"):
        driver.check(wanted)
    with pytest.raises(ConfigurationError, match="'feedforward' needs the parameter"):
        driver.settings = wanted

    assert driver.settings.law == "pid"
    assert answers(driver, 3, 4).tobytes() == answers(untouched, 3, 4).tobytes()


def test_looking_whether_settings_can_be_taken_changes_nothing(series: str) -> None:
    driver, untouched = walker("pid", series), walker("pid", series)
    answers(driver, 1, 2)
    answers(untouched, 1, 2)

    for law in LAWS.names:
        driver.check(walker(law, series).settings)

    assert answers(driver, 3, 4).tobytes() == answers(untouched, 3, 4).tobytes()


# Over the topics


def await_configuration(simulator: ControllerClient, **expected: object) -> dict[str, Any]:
    """The configuration that holds these values, once it has come.

    They must be all that have changed: an older one may have the last of them, too.
    """

    def found() -> dict[str, Any] | None:
        for message in reversed(simulator.configuration.messages):
            content: dict[str, Any] = json.loads(message.data)
            if content["parameters"].items() >= expected.items():
                return content
        return None

    return dict(simulator.spin_until(found, f"a configuration with {expected}"))


def test_laws_and_gains_of_a_hinge_are_their_closed_forms_from_the_next_state_on(
    processes: Processes, simulator: ControllerClient
) -> None:
    # Arrange: each change, and what then is the effort of an error, a velocity and an integral
    processes.controller("pendulum", law="zero")
    changes: list[tuple[str, object, Callable[[float, float, float], float]]] = [
        ("law", "p", lambda e, v, i: 50.0 * e),
        ("gains.hinge.p", 80.0, lambda e, v, i: 80.0 * e),
        ("law", "pd", lambda e, v, i: 80.0 * e - 5.0 * v),
        ("gains.hinge.d", 2.0, lambda e, v, i: 80.0 * e - 2.0 * v),
        ("gain_scale.p", 0.5, lambda e, v, i: 40.0 * e - 2.0 * v),
        ("gain_scale.d", 3.0, lambda e, v, i: 40.0 * e - 6.0 * v),
        ("gains.hinge.i", 1e3, lambda e, v, i: 40.0 * e - 6.0 * v),
        ("law", "pid", lambda e, v, i: 40.0 * e - 6.0 * v),  # the integral begins
        ("gains.hinge.p", 60.0, lambda e, v, i: 30.0 * e - 6.0 * v + 1e3 * i),
        ("gains.hinge.i", 2e3, lambda e, v, i: 30.0 * e - 6.0 * v + 2e3 * i),
        ("effort_limit.hinge", 0.01, lambda e, v, i: 0.01 * np.sign(30.0 * e - 6.0 * v + 2e3 * i)),
        ("law", "zero", lambda e, v, i: 0.0),
    ]
    assert list(simulator.ask(as_message("pendulum", some_state("pendulum", 1))).effort) == [0.0]
    integral, in_pid, in_force = 0.0, False, dict[str, object]()
    for tick, (name, value, law) in enumerate(changes, start=2):
        # Act
        taken, reason = simulator.set_parameter(NODE, name, value)
        state = some_state("pendulum", tick)
        torques = simulator.ask(as_message("pendulum", state))

        # Assert
        assert taken, reason
        error, velocity = TARGET - state.position[0], state.velocity[0]
        integral += in_pid * error * (state.stamp_ns - CLOCK.stamp_ns(tick - 1)) / 1e9
        in_pid = in_pid or value == "pid"
        expected = law(error, velocity, integral)
        assert torques.effort[0] == pytest.approx(expected, rel=1e-9, abs=1e-12), (name, value)
        in_force[name] = value
        content = await_configuration(simulator, **in_force)
        assert content["parameters_after_stamp_ns"] == CLOCK.stamp_ns(tick - 1)
        assert simulator.get_parameters(NODE, [name]) == [value]


def test_what_runs_the_humanoid_is_changed_step_by_step(
    processes: Processes, simulator: ControllerClient, series: str
) -> None:
    # Arrange
    fixed: dict[str, object] = {"reference": "clip", "feedforward": series}
    processes.controller("humanoid", **fixed)
    changes: list[tuple[str, object]] = [
        ("reference_velocity", "zero"),
        ("law", "computed_torque"),
        ("gains.chest.p", 700.0),
        ("gain_scale.d", 0.5),
        ("law", "feedforward"),
        ("reference_velocity", "clip"),
        ("law", "pd_gravity"),
        ("effort_limit.left_hip", 5.0),
        ("law", "stable_pd"),
    ]
    in_force, last = dict(fixed), np.empty(0)
    for tick in range(1, len(changes) + 2):
        state = some_state("humanoid", tick)

        # Act
        torques = simulator.ask(as_message("humanoid", state))
        reference = simulator.reference(as_message("humanoid", state))

        # Assert
        effort, wanted = controller("humanoid", **in_force).compute_effort(state, FIRST)
        assert list(torques.effort) == effort.tolist(), in_force
        assert list(reference.position) == wanted.position.tolist()
        assert list(reference.velocity) == wanted.velocity.tolist()
        still = in_force.get("reference_velocity") == "zero"
        assert (np.abs(reference.velocity).max() == 0.0) == still
        assert effort.tolist() != last.tolist()
        last = effort
        for name, value in changes[tick - 1 : tick]:
            assert simulator.set_parameter(NODE, name, value) == (True, "")
            in_force[name] = value
            content = await_configuration(simulator, **in_force)
            assert content["parameters_after_stamp_ns"] == state.stamp_ns


def test_a_change_before_the_first_answer_counts_from_the_beginning(
    processes: Processes, simulator: ControllerClient
) -> None:
    processes.controller("pendulum")
    assert await_configuration(simulator)["parameters_after_stamp_ns"] is None

    taken, _ = simulator.set_parameter(NODE, "law", "zero")

    assert taken
    assert await_configuration(simulator, law="zero")["parameters_after_stamp_ns"] is None
    torques = simulator.ask(as_message("pendulum", some_state("pendulum", 1)))
    assert list(torques.effort) == [0.0]


def test_a_state_that_was_answered_before_the_change_keeps_its_answer(
    processes: Processes, simulator: ControllerClient
) -> None:
    processes.controller("pendulum")
    state = as_message("pendulum", some_state("pendulum", 1))
    simulator.ask(state)

    simulator.set_parameter(NODE, "law", "zero")
    before = len(simulator.torques)
    simulator.send(state, lambda: len(simulator.torques) > before + 1)
    after = simulator.ask(as_message("pendulum", some_state("pendulum", 2)))

    again = {tuple(m.effort) for m in simulator.torques.messages if stamp_ns(m) == FIRST}
    assert len(again) == 1 and again != {(0.0,)}
    assert list(after.effort) == [0.0]


def test_changes_that_come_together_are_taken_all_or_none(
    processes: Processes, simulator: ControllerClient
) -> None:
    processes.controller("pendulum")
    simulator.ask(as_message("pendulum", some_state("pendulum", 1)))
    # the first one; only the last one would come later
    await_configuration(simulator, law="stable_pd")
    together: list[dict[str, object]] = [
        {"gains.hinge.p": 80.0, "law": "feedforward"},  # there is no file for it
        {"gains.hinge.p": 80.0, "gains.hinge.d": -1.0},
        {"law": "p", "gains.hinge.p": 90.0},
    ]

    results = []
    for changes in together:
        parameters = [Parameter(name, value=v).to_parameter_msg() for name, v in changes.items()]
        request = SetParametersAtomically.Request(parameters=parameters)
        service = f"{NODE}/set_parameters_atomically"
        results.append(simulator.call(SetParametersAtomically, service, request).result)
        if not results[-1].successful:
            values = simulator.get_parameters(NODE, ["law", "gains.hinge.p", "gains.hinge.d"])
            assert values == ["stable_pd", 50.0, 5.0]

    state = some_state("pendulum", 2)
    torques = simulator.ask(as_message("pendulum", state))
    assert [result.successful for result in results] == [False, False, True]
    assert "CSV file" in results[0].reason and "-1.0" in results[1].reason
    assert torques.effort[0] == pytest.approx(90.0 * (TARGET - state.position[0]), rel=1e-12)
    content = await_configuration(simulator, law="p")
    assert content["parameters"]["gains.hinge.p"] == 90.0
    assert content["parameters_after_stamp_ns"] == FIRST
    assert len(simulator.configuration) == 2  # the refused ones were not worth a message
