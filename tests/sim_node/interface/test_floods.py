"""Senders that are too many or too fast, or that go and come back."""

import re
import signal

import pytest
from rclpy.serialization import serialize_message

from msgs_config.bus.once_logger import MOST_LOGGED
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from tests.sim_node.conftest import Join
from tests.support.ros import (
    ControllerClient,
    Processes,
    SimulatorClient,
    assert_quiet,
    joint_state,
    stamp_ns,
    tick_of,
    wait_until,
    wrench_message,
)

CLOCK = TickClock(240)
LONG = 120.0  # s that a node may take for all that a flood has left it

pytestmark = pytest.mark.slow


def test_a_flood_while_it_waits_takes_a_bounded_memory(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator()
    state = client.first_state()
    many = [("rod", [0.0] * 6)] * 150  # 10 kB
    push = bytes(serialize_message(wrench_message(0, many)))
    stale = bytes(serialize_message(joint_state(1, ["hinge"] * 500, effort=[0.0] * 500)))
    before = simulator.peak_memory

    for publisher, raw in ((client.wrenches, push), (client.torques, stale)):
        for count in range(20_000):
            publisher.publish(raw)
            if count % 1000 == 0:
                client.get_parameters(topics.SIM_NODE, ["gravity"])  # it takes what has come

    # 200 MB of pushes; the middleware and the node keep 5000 of them each
    assert simulator.peak_memory < before + 150.0
    client.command(stamp_ns(state), {"hinge": 0.5})  # behind 5000 commands of 500 names
    assert list(client.state(2, LONG).effort) == [0.5]
    assert_quiet(simulator)


def test_two_controllers_of_one_joint_in_real_time_are_told_once_and_the_last_counts(
    processes: Processes, client: SimulatorClient, join: Join
) -> None:
    intruder = join("intruder")
    simulator = processes.simulator(mode="realtime", real_time_factor=0.25, wait_for_subscribers=2)
    client.first_state()
    intruder.first_state()

    while len(client.states.by_tick()) < 60:
        state = client.state(tick_of(client.states.last) + 1)
        client.command(stamp_ns(state), {"hinge": 1.0})
        intruder.command(stamp_ns(state), {"hinge": 2.0})

    applied = {sum(state.effort) for state in client.states.messages}
    assert {1.0, 2.0} >= applied - {0.0}
    assert applied & {1.0, 2.0}
    wait_until(lambda: "two different commands" in simulator.stderr, "the warning")
    assert simulator.stderr.count("two different commands for 'hinge'") == 1
    assert "/intruder" in simulator.stderr and "/test_client" in simulator.stderr


def test_two_controllers_of_one_name_are_told_apart(
    processes: Processes, client: SimulatorClient, join: Join
) -> None:
    twin = join("test_client")
    simulator = processes.simulator(on_fault="abort", wait_for_subscribers=2)
    state = client.first_state()
    twin.first_state()

    for effort, sender in enumerate((client, twin), start=1):
        sender.command(stamp_ns(state), {"hinge": float(effort)})

    assert simulator.wait() == 1
    (line,) = [each for each in simulator.stderr.splitlines() if "two different" in each]
    told = re.search(r"2 nodes /test_client \(GIDs ([0-9a-f.]+) and ([0-9a-f.]+)\)", line)
    assert told is not None, line
    assert told[1] != told[2]


def test_commands_at_ten_times_the_rate_change_nothing_in_lockstep(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator()
    state = client.first_state()

    for tick in range(1, 101):
        effort = 0.01 * tick
        for _ in range(10):
            client.command(stamp_ns(state), {"hinge": effort})
        state = client.state(tick + 1)
        assert list(state.effort) == [effort]

    client.diagnostics.messages.clear()
    client.command(stamp_ns(state), {"hinge": 0.0})  # the last of them: all before were counted
    client.state(102)
    client.reported(tick=102, accepted=101, conflict=0, rejected=0)
    assert_quiet(simulator)


def test_commands_at_ten_times_the_rate_do_not_stop_the_world_in_real_time(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(mode="realtime", wait_for_subscribers=1)
    state = client.first_state()

    for burst in range(100):
        for _ in range(10):
            client.command(0, {"hinge": 0.01 * burst})
        state = client.state(tick_of(client.states.last) + 1)
    (gravity,) = client.get_parameters(topics.SIM_NODE, ["gravity"])
    client.spin_until(lambda: list(client.states.last.effort) == [0.99], "the last command")

    assert gravity == 9.81
    assert tick_of(state) >= 100
    client.diagnostics.messages.clear()
    client.reported(accepted=1000, rejected=0)
    assert_quiet(simulator)


def test_a_controller_lives_through_simulators_that_come_and_go(
    processes: Processes, client: SimulatorClient
) -> None:
    node = processes.controller("humanoid", reference="clip", root_assistance=False)
    runs = []

    for killed in (False, True, False):
        simulator = processes.simulator(
            "humanoid", max_ticks=0 if killed else 120, wait_for_subscribers=2
        )
        client.spin_until(lambda: 121 in client.states.ticks(), "the last state")
        if killed:
            simulator.send(signal.SIGKILL)
            simulator.wait()
        else:
            assert simulator.wait() == 0
        states = client.states.by_tick()
        numbers = [(states[tick].position, states[tick].velocity) for tick in range(1, 122)]
        runs.append([(position.tobytes(), speed.tobytes()) for position, speed in numbers])
        client.states.messages.clear()
        client.states.raw.clear()

    assert all(run == runs[0] for run in runs)
    assert node.exit_code is None
    assert_quiet(node)


def test_a_simulator_says_when_it_only_counts_further_warnings(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator()
    state = client.first_state()

    for number in range(MOST_LOGGED + 20):
        client.command(stamp_ns(state), {f"unknown_{number}": 0.0})
        client.get_parameters(topics.SIM_NODE, ["gravity"])  # it takes what has come
    client.reported(rejected=MOST_LOGGED + 20, unlogged_warnings=20)
    client.command(stamp_ns(state) * 2, {"hinge": 0.0})  # of another kind
    client.reported(future=1, unlogged_warnings=20)

    assert "unknown_99'" in simulator.stderr and "unknown_100'" not in simulator.stderr
    assert simulator.stderr.count("further ones are not logged, but counted") == 1
    assert "the stamp must be that of the state" in simulator.stderr
    assert list(client.advance(state, {"hinge": 0.5}).effort) == [0.5]


def test_a_controller_says_when_it_only_counts_further_warnings(
    processes: Processes, simulator: ControllerClient
) -> None:
    node = processes.controller("pendulum")
    diagnostics = simulator.listen(topics.DIAGNOSTICS)
    simulator.ask(joint_state(CLOCK.stamp_ns(1), ["hinge"], [0.0], [0.0]))

    for number in range(MOST_LOGGED + 20):
        strange = joint_state(
            CLOCK.stamp_ns(2), ["hinge", f"x_{number}"], [0.0] * 2, [0.0] * 2, [0.0] * 2
        )
        simulator.states.publish(strange)
    simulator.spin_until(
        lambda: any(
            ("unlogged_warnings", "20") in {(item.key, item.value) for item in status.values}
            for message in diagnostics.messages
            for status in message.status
        ),
        "the count",
    )

    assert node.stderr.count("further ones are not logged, but counted") == 1
    assert simulator.ask(joint_state(CLOCK.stamp_ns(2), ["hinge"], [0.1], [0.0], [0.0]))
