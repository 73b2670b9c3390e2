"""Commands that act late: what is foreseen, and a motion that a planner keeps all the same."""

from collections.abc import Mapping

import numpy as np
import pytest
from physics import character, simulation

from controller_node.parameters import make_controller
from controller_node.planner.contact_model import ContactModel
from controller_node.planner.late_commands import LateCommands
from experiment.loop import ticks_in_process
from experiment.plan import Plan, make_plan
from msgs_config.errors import ConfigurationError

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
MODEL = ContactModel(HUMANOID, period_s=1.0 / 240, gravity=9.81, friction=0.45)
JOINTS = LAYOUT.actuated_joint_names
QUICK = {"planner": "predictive", "plan.samples": 12, "plan.horizon": 0.3}


def walk(duration: float, **simulator: object) -> Plan:
    """A walk by joint torques alone."""
    return make_plan("humanoid", duration, {"reference": "clip", "clip": "walk"}, simulator, QUICK)


def test_a_position_comes_back_from_what_the_model_has_of_it() -> None:
    draw = np.random.default_rng(3)
    position = np.array(HUMANOID.rest_position) + 0.5 * draw.normal(size=LAYOUT.size)

    np.testing.assert_allclose(
        MODEL.message_position(MODEL.position_of(position)), position, atol=1e-12
    )


def test_in_the_air_the_state_is_foreseen_in_which_a_command_acts() -> None:
    delay, draw = 3, np.random.default_rng(4)
    late = LateCommands(HUMANOID, MODEL, delay)
    start = walk(0.1).reference.sample(0.3).configuration.position.copy()
    start[2] += 3.0  # m
    foreseen = {}
    with simulation(
        "humanoid",
        initial_position=start.tolist(),
        command_delay_ticks=delay,
        commanded_joints=JOINTS,
    ) as run:
        for tick in range(1, 30):
            state = run.state
            if tick in foreseen:
                position, velocity = foreseen[tick]
                np.testing.assert_allclose(position, state.position, atol=1e-6)
                np.testing.assert_allclose(velocity, state.velocity, atol=1e-5)
            effort = np.concatenate((np.zeros(6), 3.0 * draw.normal(size=LAYOUT.size - 6)))
            foreseen[tick + delay] = late.state_then(tick, state.position, state.velocity)
            late.send(tick, effort)
            run.advance(effort)

    assert max(abs(state.velocity)) > 1.0


def test_a_state_that_comes_again_is_answered_alike() -> None:
    plan = walk(0.1, command_delay_ticks=2)
    controller = make_controller(HUMANOID, plan.reference, plan.controller)
    states = [tick.state for tick in ticks_in_process(plan)][:8]

    for state in states:
        once, reference = controller.answer(state, states[0].stamp_ns)
        again, _ = controller.answer(state, states[0].stamp_ns)
        assert again.tobytes() == once.tobytes()
        assert reference.stamp_ns == state.stamp_ns


def test_what_diverges_is_not_foreseen() -> None:
    late = LateCommands(HUMANOID, MODEL, 1)
    position, nothing = np.array(HUMANOID.rest_position), np.zeros(LAYOUT.size)
    late.send(1, np.full(LAYOUT.size, 1e5))

    there, velocity = late.state_then(2, position, nothing)

    assert there.tobytes() == position.tobytes()
    assert velocity.tobytes() == nothing.tobytes()


def test_a_planner_that_is_told_of_a_delay_keeps_the_motion_with_it() -> None:
    plan = walk(0.4, command_delay_ticks=1)

    turns = []
    for number, tick in enumerate(ticks_in_process(plan)):
        assert tick.reference.stamp_ns == tick.state.stamp_ns
        desired = plan.reference.sample(number / 240).configuration.position
        np.testing.assert_allclose(tick.reference.position, desired, atol=1e-6)
        there = LAYOUT.configuration(tick.following.position)
        wanted = plan.reference.sample((number + 1) / 240).configuration
        turns.append(LAYOUT.norms(LAYOUT.difference(wanted, there))[2:].mean())

    assert len(turns) == 96
    assert np.mean(turns) < 0.25


REFUSED: dict[str, tuple[Mapping[str, object], Mapping[str, object], str]] = {
    "another delay": ({"command_delay_ticks": 2}, {"command_delay_ticks": 1}, "must be the same"),
    "all the horizon": ({"command_delay_ticks": 72}, {}, "it must be less than plan.horizon, 72"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_it_cannot_do_is_one_clear_line(case: str) -> None:
    simulator, controller, said = REFUSED[case]

    with pytest.raises(ConfigurationError, match="command_delay_ticks") as caught:
        plan = make_plan("humanoid", 0.1, {"reference": "hold"}, simulator, {**QUICK, **controller})
        list(ticks_in_process(plan))

    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
