"""The controller as a process of its own: what it answers, and what it does not."""

import json
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from controller_node.parameters import PARAMETERS, character_parameters
from msgs_config.arrays import FloatArray
from msgs_config.messages.cdr import split_stamp
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedReference, StampedState
from tests.support.physics import character, controller
from tests.support.ros import ControllerClient, Processes, joint_state, stamp_ns

CLOCK = TickClock(240)
NO_MESSAGE = b"\x00\x01\x00\x00\xff\xff\xff\xff\xff\xff\xff\xff"  # the text would be endless


def some_state(name: str, tick: int = 1, *, first: bool = True, seed: int = 1) -> StampedState:
    """A state near the rest pose; the first of an episode has no effort."""
    whole = character(name)
    rng = np.random.default_rng(seed)
    position = whole.rest_position + rng.uniform(-0.1, 0.1, whole.layout.size)
    velocity = rng.uniform(-0.5, 0.5, whole.layout.size)
    effort = None if first else np.zeros(whole.layout.size)
    return StampedState(CLOCK.stamp_ns(tick), position, velocity, effort)


def as_message(name: str, state: StampedState) -> JointState:
    effort = () if state.effort is None else list(state.effort)
    return joint_state(
        state.stamp_ns,
        character(name).layout.dof_names,
        list(state.position),
        list(state.velocity),
        effort,
    )


def expected_answer(
    name: str, state: StampedState, episode_ns: int | None = None, **parameters: object
) -> tuple[FloatArray, StampedReference]:
    """What the same controller answers without ROS."""
    start_ns = state.stamp_ns if episode_ns is None else episode_ns
    return controller(name, **parameters).compute_effort(state, start_ns)


# What it answers


def test_the_answer_echoes_the_stamp_and_is_that_of_the_controller_without_ros(
    processes: Processes, simulator: ControllerClient
) -> None:
    processes.controller("humanoid", reference="clip")
    state = some_state("humanoid", tick=7)

    torques = simulator.ask(as_message("humanoid", state))

    effort, _ = expected_answer("humanoid", state, reference="clip")
    assert stamp_ns(torques) == CLOCK.stamp_ns(7)
    assert list(torques.effort) == effort.tolist()


def test_the_reference_is_stamped_like_the_torques_that_it_led_to(
    processes: Processes, simulator: ControllerClient
) -> None:
    processes.controller("humanoid", reference="clip", clip="run")

    for tick in (1, 2, 3):
        state = some_state("humanoid", tick, first=tick == 1)
        simulator.ask(as_message("humanoid", state))
        reference = simulator.reference(as_message("humanoid", state))

        _, expected = expected_answer(
            "humanoid", state, CLOCK.stamp_ns(1), reference="clip", clip="run"
        )
        assert stamp_ns(reference) == state.stamp_ns
        assert tuple(reference.name) == character("humanoid").layout.dof_names
        assert list(reference.position) == expected.position.tolist()
        assert list(reference.velocity) == expected.velocity.tolist()


def test_a_state_that_comes_again_gets_the_same_answer_again(
    processes: Processes, simulator: ControllerClient
) -> None:
    processes.controller("humanoid")
    message = as_message("humanoid", some_state("humanoid"))
    simulator.ask(message)

    simulator.send(message, lambda: len(simulator.torques) >= 4 and len(simulator.references) >= 4)

    assert len(set(simulator.torques.raw)) == 1
    assert len(set(simulator.references.raw)) == 1


@pytest.mark.parametrize(
    ("name", "assistance", "first"),
    [("humanoid", True, 0), ("humanoid", False, 6), ("lift", True, 0)],
)
def test_all_joints_are_commanded_and_the_root_with_assistance_alone(
    processes: Processes, simulator: ControllerClient, name: str, assistance: bool, first: int
) -> None:
    processes.controller(name, root_assistance=assistance)

    torques = simulator.ask(as_message(name, some_state(name)))

    assert tuple(torques.name) == character(name).layout.dof_names[first:]
    assert len(torques.effort) == len(torques.name)


def test_names_in_another_order_get_the_same_torques(
    processes: Processes, simulator: ControllerClient
) -> None:
    processes.controller("humanoid")
    state = some_state("humanoid")
    straight = as_message("humanoid", state)
    order = np.random.default_rng(2).permutation(len(straight.name))

    torques = simulator.ask(
        joint_state(
            state.stamp_ns,
            [straight.name[index] for index in order],
            state.position[order].tolist(),
            state.velocity[order].tolist(),
        )
    )

    assert list(torques.effort) == expected_answer("humanoid", state)[0].tolist()


def test_the_configuration_holds_the_parameters_in_force(
    processes: Processes, simulator: ControllerClient
) -> None:
    processes.controller("lift", gains__height__p=25.0)

    simulator.spin_until(lambda: simulator.configuration.messages, "configuration")

    content = json.loads(simulator.configuration.last.data, parse_constant=pytest.fail)
    names = {p.name for p in PARAMETERS + character_parameters(character("lift"))}
    assert set(content["parameters"]) == names - {"session"}  # which is of no influence
    assert content["parameters"]["gains.height.p"] == 25.0
    assert content["urdf"] == character("lift").loading.urdf_text


# Which episode a state belongs to


def test_who_joins_in_the_middle_learns_the_episode_from_the_latched_topic(
    processes: Processes, simulator: ControllerClient
) -> None:
    seconds, nanoseconds = split_stamp(CLOCK.stamp_ns(2400))
    episode = Header(frame_id="2")
    episode.stamp.sec, episode.stamp.nanosec = seconds, nanoseconds
    simulator.episodes.publish(episode)
    processes.controller("humanoid", reference="clip")
    state = some_state("humanoid", tick=2500, first=False)

    torques = simulator.ask(as_message("humanoid", state))

    effort, _ = expected_answer("humanoid", state, CLOCK.stamp_ns(2400), reference="clip")
    assert list(torques.effort) == effort.tolist()


def test_a_state_of_an_episode_that_it_does_not_know_waits_for_the_episode(
    processes: Processes, simulator: ControllerClient
) -> None:
    processes.controller("humanoid", reference="clip")
    first, middle = some_state("humanoid", 10), some_state("humanoid", 20, first=False)
    simulator.ask(as_message("humanoid", some_state("humanoid", 5)))  # it hears states by now

    simulator.states.publish(as_message("humanoid", some_state("humanoid", 4, first=False)))
    simulator.ask(as_message("humanoid", first))
    torques = simulator.ask(as_message("humanoid", middle))

    assert {stamp_ns(torque) for torque in simulator.torques.messages} == {
        CLOCK.stamp_ns(tick) for tick in (5, 10, 20)
    }
    effort, _ = expected_answer("humanoid", middle, first.stamp_ns, reference="clip")
    assert list(torques.effort) == effort.tolist()


# Gains that change while it runs


REFUSED: dict[str, tuple[str, Any]] = {
    "negative": ("gains.hinge.p", -1.0),
    "not a number": ("gains.hinge.d", float("nan")),
    "infinite": ("gain_scale.p", float("inf")),
    "of another type": ("gains.hinge.p", "much"),
    "unknown": ("gains.tail.p", 1.0),
    "fixed while it runs": ("rate", 480),
    "no law": ("law", "magic"),
    "a law without its file": ("law", "feedforward"),
}


def test_a_change_that_is_refused_leaves_the_old_value_in_force(
    processes: Processes, simulator: ControllerClient
) -> None:
    processes.controller("pendulum")
    before, after = some_state("pendulum", 1), some_state("pendulum", 2, first=False)
    simulator.ask(as_message("pendulum", before))

    answers = {
        why: simulator.set_parameter("controller_node", name, value)
        for why, (name, value) in REFUSED.items()
    }

    torques = simulator.ask(as_message("pendulum", after))
    assert {why: taken for why, (taken, _) in answers.items()} == dict.fromkeys(REFUSED, False)
    assert all(reason for _, reason in answers.values())
    assert "gains.hinge.p" in answers["negative"][1] and "-1.0" in answers["negative"][1]
    assert "CSV file" in answers["a law without its file"][1]
    values = simulator.get_parameters("controller_node", ["gains.hinge.p", "gains.hinge.d", "law"])
    assert values == [50.0, 5.0, "stable_pd"]
    effort, _ = expected_answer("pendulum", after, before.stamp_ns)
    assert list(torques.effort) == effort.tolist()


# States that it cannot use, and parameters


def test_a_state_that_it_cannot_read_is_ignored_with_one_warning(
    processes: Processes, simulator: ControllerClient
) -> None:
    node = processes.controller("pendulum")
    good = some_state("pendulum", 1)
    simulator.ask(as_message("pendulum", good))
    wrong = [
        joint_state(CLOCK.stamp_ns(2), ["tail"], [0.0], [0.0]),
        joint_state(CLOCK.stamp_ns(2), ["hinge", "tail"], [0.0, 0.0], [0.0, 0.0]),
        joint_state(CLOCK.stamp_ns(2), ["hinge"], [0.0, 0.0], [0.0]),
        joint_state(CLOCK.stamp_ns(2), ["hinge"]),
        joint_state(CLOCK.stamp_ns(2), []),
    ]

    for message in wrong * 3:
        simulator.states.publish(message)
    simulator.ask(as_message("pendulum", some_state("pendulum", 3, first=False)))

    assert CLOCK.stamp_ns(2) not in {stamp_ns(torque) for torque in simulator.torques.messages}
    warnings = [line for line in node.stderr.splitlines() if " ignored: " in line]
    assert sum("'tail'" in warning for warning in warnings) == 1
    assert len(warnings) == len(set(warnings))
    assert node.exit_code is None


def test_bytes_that_are_no_message_are_ignored_with_a_warning(
    processes: Processes, simulator: ControllerClient
) -> None:
    node = processes.controller("pendulum")
    simulator.ask(as_message("pendulum", some_state("pendulum", 1)))

    for publisher in (simulator.states, simulator.episodes):
        publisher.publish(NO_MESSAGE)
    simulator.ask(as_message("pendulum", some_state("pendulum", 2, first=False)))
    simulator.ask(as_message("pendulum", some_state("pendulum", 3, first=False)))

    assert node.exit_code is None
    assert " ignored: " in node.stderr


def test_a_state_whose_stamp_is_no_tick_is_ignored_and_said_once(
    processes: Processes, simulator: ControllerClient
) -> None:
    # Arrange
    node = processes.controller("pendulum", rate=100)
    state = as_message("pendulum", some_state("pendulum", 1))

    # Act
    simulator.send(state, lambda: "is no tick at 100 Hz" in node.stderr)
    for _ in range(10):
        simulator.states.publish(state)
    good = joint_state(10_000_000, ["hinge"], [0.5], [0.0])
    simulator.ask(good)

    # Assert
    assert node.stderr.count("4166666 ns is no tick") == 1
    assert next(map(stamp_ns, simulator.torques.messages)) == 10_000_000


WRONG: dict[str, tuple[dict[str, Any], list[str]]] = {
    "character": ({"character": "centaur"}, ["centaur", "humanoid"]),
    "clip": ({"character": "humanoid", "reference": "clip", "clip": "swim"}, ["swim", "walk"]),
    "clip of another character": (
        {"reference": "clip", "clip": "walk"},
        ["pendulum"],
    ),
    "gain": ({"gains__hinge__p": -5.0}, ["'gains.hinge.p'", "-5.0"]),
    "name": ({"gains__tail__p": 5.0}, ["'gains.tail.p'", "gains.hinge.p"]),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_parameter_ends_it_with_one_clear_line(processes: Processes, wrong: str) -> None:
    parameters, expected = WRONG[wrong]

    node = processes.controller(**({"character": "pendulum"} | parameters))

    assert node.wait() == 1
    (line,) = node.stderr.splitlines()
    assert line.startswith("error: ")
    assert all(part in line for part in expected)
