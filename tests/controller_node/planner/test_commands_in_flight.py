"""Commands that act late: what is foreseen, and a motion that a planner keeps all the same."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from controller_node.parameters import (
    check_world,
    make_controller,
    resolve_for,
)
from controller_node.planner.commands_in_flight import CommandsInFlight
from controller_node.planner.contact_model import ContactModel
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Values
from tests.support.physics import character, simulation

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
MODEL = ContactModel(HUMANOID, period_s=1.0 / 240, gravity=9.81, friction=0.45)
JOINTS = LAYOUT.actuated_joint_names
QUICK = {
    "planner": "predictive",
    "plan.samples": 12,
    "plan.rounds": 1,
    "plan.horizon": 0.3,
}


def walk(duration: float, **simulator: object) -> RunPlan:
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
    late = CommandsInFlight(HUMANOID, MODEL, delay)
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
        once, reference = controller.compute_effort(state, states[0].stamp_ns)
        again, _ = controller.compute_effort(state, states[0].stamp_ns)
        assert again.tobytes() == once.tobytes()
        assert reference.stamp_ns == state.stamp_ns


def test_a_plan_counts_from_the_state_that_was_told() -> None:
    plan = walk(0.1, command_delay_ticks=2)
    controller = make_controller(HUMANOID, plan.reference, plan.controller)
    (first, *_) = (tick.state for tick in ticks_in_process(plan))

    controller.compute_effort(first, first.stamp_ns)

    assert controller.outlook is not None
    np.testing.assert_allclose(controller.outlook.times, 0.05 * np.arange(1, 7) + 2 / 240)


def test_what_diverges_is_not_foreseen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    late = CommandsInFlight(HUMANOID, MODEL, 2)
    position, velocity = np.array(HUMANOID.rest_position), np.zeros(LAYOUT.size)
    velocity[20] = 2e3

    there, then = late.state_then(2, position, velocity)

    assert there.tobytes() == position.tobytes()
    assert then.tobytes() == velocity.tobytes()
    assert not list(tmp_path.iterdir())  # no log of MuJoCo's


def test_a_command_acts_within_the_limits_and_until_the_next_one() -> None:
    position, still = np.array(HUMANOID.rest_position), np.zeros(LAYOUT.size)
    position[2] += 3.0
    effort = np.concatenate((still[:6], np.full(LAYOUT.size - 6, 4.0)))

    def foreseen(*sent: tuple[int, FloatArray]) -> bytes:
        late = CommandsInFlight(HUMANOID, MODEL, 3)
        for tick, each in sent:
            late.send(tick, each)
        return late.state_then(10, position, still)[1].tobytes()

    foreseen_efforts = foreseen((7, effort), (8, effort), (9, effort))
    assert foreseen((7, effort)) == foreseen_efforts
    assert foreseen((5, 0.0 * effort), (6, effort)) == foreseen_efforts
    assert foreseen((8, effort)) != foreseen_efforts
    most = LAYOUT.clipped(1e6 * effort, HUMANOID.effort_limits())
    assert foreseen((7, 1e6 * effort)) == foreseen((7, most))


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


def test_a_simulator_with_another_delay_is_one_clear_line() -> None:
    named: dict[str, Any] = {**QUICK, "command_delay_ticks": 1}
    values = resolve_for(HUMANOID, named)

    with pytest.raises(ConfigurationError, match=r"counts with 'command_delay_ticks' 1, but .* 2;"):
        check_world(values, {"command_delay_ticks": 2})

    check_world(values, {"command_delay_ticks": 1})
    check_world(values, {})  # it does not say
    check_world(Values({**values, "planner": "none"}), {"command_delay_ticks": 2})


def test_a_delay_of_all_the_horizon_is_one_clear_line() -> None:
    with pytest.raises(ConfigurationError, match=r"^[^\n]* less than plan.horizon, 72 ticks$"):
        list(ticks_in_process(walk(0.1, command_delay_ticks=72)))
