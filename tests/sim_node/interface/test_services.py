"""The simulator's services, called over ROS: pause, single steps, and new episodes."""

import signal

import numpy as np
import pytest
from rclpy.task import Future
from sensor_msgs.msg import JointState

from msgs_config.character.layout import ROOT
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from sim_node.physics.wrenches import ExternalWrench
from tests.support.physics import simulation
from tests.support.ros import Processes, SimulatorClient, stamp_ns, tick_of, wrench_message

CLOCK = TickClock(240)
SOON = 0.05  # s, a republish period for tests that wait for repeated states
FOR_EVER = 1_000_000  # ticks


def wait_for_repeats(client: SimulatorClient, count: int = 3) -> None:
    """Wait until the last state has come again: time enough to go on, for who would go on."""
    enough = len(client.states) + count
    client.spin_until(lambda: len(client.states) >= enough, "repeated states")


def response_of(client: SimulatorClient, call: Future) -> tuple[bool, str]:
    client.spin_until(call.done, "the response")
    return call.result().success, call.result().message


def begin_steps(client: SimulatorClient) -> Future:
    """Call `~/step`, and wait until it has begun: the state is asked for again."""
    count = len(client.states)
    call = client.step()
    client.spin_until(lambda: len(client.states) > count, "the state again")
    return call


def set_step_count(client: SimulatorClient, count: int) -> None:
    assert client.set_parameter(topics.SIM_NODE, "step_count", count) == (True, "")


def until_reported(client: SimulatorClient, **expected: object) -> dict[str, str]:
    """Wait for a report that is newer than all that have come; its values."""
    client.diagnostics.messages.clear()
    return {item.key: item.value for item in client.reported(**expected).values}


# Single steps


def test_a_step_is_refused_unless_paused(processes: Processes, client: SimulatorClient) -> None:
    processes.simulator()
    state = client.first_state()

    done, reason = response_of(client, client.step())

    assert not done
    assert "not paused" in reason
    client.advance(state, {})


def test_steps_are_answered_when_they_are_done_however_long_their_commands_take(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator(republish_period=SOON)
    state = client.first_state()
    client.pause(True)
    set_step_count(client, 3)

    call = begin_steps(client)
    for tick in (1, 2, 3):
        assert tick_of(state) == tick
        wait_for_repeats(client)  # a slow controller
        assert not call.done()
        state = client.advance(state, {"hinge": 0.5 * tick})

    assert response_of(client, call) == (True, "3 ticks done")
    assert list(state.effort) == [1.5]
    client.command(stamp_ns(state), {"hinge": 9.0})
    until_reported(client, paused=True, tick=4)  # and no further


def test_the_number_of_steps_is_a_live_parameter(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator(step_count=2, wait_for_subscribers=2)
    processes.controller()
    client.first_state()
    client.pause(True)
    start = int(until_reported(client, paused=True)["tick"])

    first = response_of(client, client.step())
    set_step_count(client, 50)
    second = response_of(client, client.step())

    assert (first, second) == ((True, "2 ticks done"), (True, "50 ticks done"))
    until_reported(client, paused=True, tick=start + 52)
    client.state(start + 52)
    assert max(client.states.ticks()) == start + 52


MODES = {
    "lockstep": {},
    "lockstep in time with the wall clock": {"real_time_factor": 1.0},
    "realtime": {"mode": "realtime"},
}


@pytest.mark.parametrize("mode", MODES)
def test_parameters_and_services_are_answered_while_steps_are_not_done(
    processes: Processes, client: SimulatorClient, mode: str
) -> None:
    processes.simulator(step_count=FOR_EVER, wait_for_subscribers=1, **MODES[mode])
    client.first_state()
    client.pause(True)
    if mode != "realtime":
        processes.controller()
    call = client.step()
    client.state(tick_of(client.states.last) + 50)  # the steps have begun

    (gravity,) = client.get_parameters(topics.SIM_NODE, ["gravity"])
    again = response_of(client, client.step())
    assert not call.done()
    resumed = client.pause(False)

    assert gravity == 9.81
    assert not again[0]
    assert "steps of another call are not done" in again[1]
    assert resumed.message == "running"
    assert response_of(client, call) == (False, "resumed before")
    client.state(tick_of(client.states.last) + 50)


def test_a_pause_and_a_reset_end_steps_that_are_not_done(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator(step_count=10)
    state = client.first_state()
    client.pause(True)

    paused = begin_steps(client)
    state = client.advance(state, {})
    client.pause(True)
    reset = begin_steps(client)
    client.advance(state, {})
    client.reset()

    assert response_of(client, paused) == (False, "paused before")
    assert response_of(client, reset) == (False, "reset before")
    client.command(stamp_ns(client.state(4)), {"hinge": 1.0})
    until_reported(client, paused=True, tick=4, episode=2)  # what was paused stays so


def test_steps_are_answered_when_the_simulation_ends(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(step_count=10)
    state = client.first_state()
    client.pause(True)
    call = begin_steps(client)
    client.advance(state, {})

    simulator.send(signal.SIGTERM)

    done, reason = response_of(client, call)
    assert not done
    assert "ends" in reason
    assert simulator.wait() == 0


def test_the_last_of_steps_is_answered_where_the_run_ends_with_it(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(step_count=2, max_ticks=2)
    state = client.first_state()
    client.pause(True)
    call = begin_steps(client)

    client.advance(client.advance(state, {}), {})

    assert response_of(client, call) == (True, "2 ticks done")
    assert simulator.wait() == 0


# New episodes


def expected_states(
    first_tick: int, ticks: int, seed: int, *pushes: ExternalWrench, **parameters: object
) -> list[StampedState]:
    """The states of a fresh simulation of the humanoid under the client's random commands."""
    rng = np.random.default_rng(seed)
    run = simulation("humanoid", **parameters)
    with run:
        motors = [not name.startswith(f"{ROOT}_") for name in run.layout.dof_names]
        states = [run.state]
        for tick in range(first_tick, first_tick + ticks):
            effort = np.zeros(run.layout.size)
            effort[motors] = rng.uniform(-20.0, 20.0, sum(motors))
            states.append(run.advance(effort, *(push for push in pushes if push.acts_at(tick))))
    return states


def assert_same_states(messages: list[JointState], states: list[StampedState]) -> None:
    """Equal to the bit, but for the stamps."""
    assert len(messages) == len(states)
    for message, state in zip(messages, states, strict=True):
        effort = [] if state.effort is None else state.effort.tolist()
        assert list(message.effort) == effort
        assert list(message.position) == state.position.tolist()
        assert list(message.velocity) == state.velocity.tolist()


def test_an_episode_after_a_reset_is_that_of_a_fresh_simulator_to_the_bit(
    processes: Processes, client: SimulatorClient
) -> None:
    parameters = {"command_delay_ticks": 1, "wrench_duration": 0.02}
    processes.simulator("humanoid", **parameters)
    state = client.first_state()
    client.wrenches.publish(wrench_message(0, [("chest", (300.0, 50.0, 0.0, 0.0, 0.0, 5.0))]))
    state = client.drive(state, 120, np.random.default_rng(1))  # it lies on the ground by then

    response = client.reset()

    assert (response.success, response.message) == (True, "a new episode")
    first = client.state(122)
    assert list(first.effort) == []
    client.spin_until(lambda: len(client.episodes) == 2, "the new episode")
    assert tick_of(client.episodes.last) == 122
    assert client.episodes.last.frame_id == f"2 {first.header.frame_id}"
    client.command(stamp_ns(state), {"left_elbow": 50.0})  # answers the episode before
    client.drive(first, 100, np.random.default_rng(2))
    until_reported(client, stale=1, episode=2, conflict=0)
    messages = client.states.by_tick()
    assert_same_states(
        [messages[tick] for tick in range(122, 223)],
        expected_states(122, 100, 2, command_delay_ticks=1),
    )


def test_pushes_that_wait_are_forgotten_by_a_reset(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator("humanoid")
    applied = client.listen(topics.APPLIED_WRENCH)
    state = client.first_state()
    push = [("chest", (100.0, 0.0, 0.0, 0.0, 0.0, 0.0))]
    client.wrenches.publish(wrench_message(CLOCK.stamp_ns(8), push))  # is known to the simulator
    state = client.drive(state, 3, np.random.default_rng(1))
    client.spin_until(lambda: applied.messages, "that somebody listens")
    client.pause(True)
    for tick in (0, 9):
        client.wrenches.publish(wrench_message(CLOCK.stamp_ns(tick), push))  # waits on the topic

    client.reset()
    client.pause(False)
    client.drive(client.state(5), 20, np.random.default_rng(2))

    client.spin_until(lambda: applied.ticks()[-1] == 25, "all ticks")
    assert {tuple(message.joint_names) for message in applied.messages} == {()}
    messages = client.states.by_tick()
    assert_same_states([messages[tick] for tick in range(5, 26)], expected_states(5, 20, 2))


def test_a_reset_helps_after_a_divergence(processes: Processes, client: SimulatorClient) -> None:
    processes.simulator(speed_limit=0.1)
    client.command(stamp_ns(client.first_state()), {"hinge": 100.0})
    until_reported(client, paused=True)
    stepped, resumed = response_of(client, client.step()), client.pause(False)

    response = client.reset()

    for success, message in (stepped, (resumed.success, resumed.message)):
        assert not success and "'hinge'" in message
    assert response.success
    assert "paused" in response.message
    until_reported(client, paused=True, episode=2, tick=2)
    status = client.diagnostics.last.status[0]
    assert (status.level, status.message) == (status.OK, "running")
    assert client.pause(False).success
    first = client.state(2)  # no stamp is left out, or a recording would miss it
    assert list(first.position) == [0.5]
    assert list(client.advance(first, {"hinge": 0.5}).effort) == [0.5]


def test_a_reset_before_the_beginning_makes_the_second_episode_the_first_to_be_seen(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator(wait_for_subscribers=2)
    client.reset()

    client.listen(topics.JOINT_STATES)

    state = client.state(2)
    client.spin_until(lambda: client.episodes.messages, "the episode")
    assert tick_of(client.episodes.last) == 2
    assert client.episodes.last.frame_id == f"2 {state.header.frame_id}"
    assert list(client.advance(state, {"hinge": 0.5}).effort) == [0.5]


def test_the_last_tick_of_a_run_counts_from_its_first_not_from_a_reset(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(max_ticks=4)
    client.advance(client.first_state(), {})

    client.reset()
    client.advance(client.advance(client.state(3), {}), {})

    assert simulator.wait() == 0
    assert max(client.states.ticks()) == 5
