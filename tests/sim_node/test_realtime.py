"""The simulator that goes on by the wall clock, and controllers that come and go.

The machine may be busy with other things: how fast something is has wide bounds here, and what is
exact is counted in ticks.
"""

import signal
import time
from collections.abc import Callable

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from tests.support.physics import character
from tests.support.ros import Process, Processes, SimulatorClient, stamp_ns, tick_of

CLOCK = TickClock(240)
HELD_TICKS = 13
TICKS = 150  # of a run in lockstep
SESSION = "/sim_node#000000000001"  # of two runs that are compared byte by byte
HELD = 0.0521  # s, a command timeout: 12 ticks are 0.05 s
SLOWLY = 0.25  # simulated over wall time, for tests that answer tick by tick


def wait_for_ticks(client: SimulatorClient, ticks: int) -> JointState:
    """The first state that is some ticks after the last one that has come."""
    client.spin_until(lambda: client.states.messages, "a state")
    goal = tick_of(client.states.last) + ticks
    client.spin_until(lambda: tick_of(client.states.last) >= goal, f"{ticks} more ticks")
    return client.states.last


def pace(client: SimulatorClient, wall_time: float) -> float:
    """Simulated time over wall time, from when states were published."""
    start = len(client.states)
    deadline = time.monotonic() + wall_time
    client.spin_until(lambda: time.monotonic() > deadline, "the time", 10.0 * wall_time)
    simulated = stamp_ns(client.states.last) - stamp_ns(client.states.messages[start])
    return simulated / (client.states.sent_ns[-1] - client.states.sent_ns[start])


def efforts(client: SimulatorClient) -> dict[int, float]:
    """The applied effort of a character of one joint, by the tick of the state that says it."""
    return {tick: sum(state.effort) for tick, state in client.states.by_tick().items()}


def number_reported(
    client: SimulatorClient, name: str, condition: Callable[[float], bool]
) -> float:
    """A number on /diagnostics, once it fulfils a condition."""

    def found() -> float | None:
        for message in client.diagnostics.messages:
            values = {item.key: item.value for item in message.status[0].values}
            if name in values and condition(float(values[name])):
                return float(values[name]) or None
        return None

    return float(client.spin_until(found, f"{name} reported"))


# The wall clock


def test_it_goes_on_without_any_command_at_the_pace_of_the_wall_clock(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(mode="realtime")

    wait_for_ticks(client, 10)

    assert 0.4 < pace(client, 1.5) < 1.1
    assert set(efforts(client).values()) == {0.0}
    assert "waiting for commands" not in simulator.stderr


def test_the_real_time_factor_is_live(processes: Processes, client: SimulatorClient) -> None:
    processes.simulator(mode="realtime", real_time_factor=0.5)
    wait_for_ticks(client, 10)

    paces = {}
    for factor in (0.1, 3.0):
        assert client.set_parameter(topics.SIM_NODE, "real_time_factor", factor) == (True, "")
        wait_for_ticks(client, 10)
        paces[factor] = pace(client, 1.0)

    assert 0.03 < paces[0.1] < 0.13
    assert 1.0 < paces[3.0] < 3.5


def test_lockstep_too_can_be_paced(processes: Processes, client: SimulatorClient) -> None:
    processes.simulator(real_time_factor=0.5, wait_for_subscribers=1)
    processes.controller()

    wait_for_ticks(client, 10)
    slow = pace(client, 1.0)
    client.set_parameter(topics.SIM_NODE, "real_time_factor", 0.0)  # as fast as it can
    wait_for_ticks(client, 100)

    assert 0.1 < slow < 0.6
    ticks = sorted(client.states.by_tick())
    assert ticks == list(range(ticks[0], ticks[-1] + 1))


def test_deadlines_that_were_missed_are_reported(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator(mode="realtime", rate=100_000)  # 10 us a tick: nobody can

    missed = number_reported(client, "missed_deadlines", lambda count: count > 0)

    assert missed > 0
    assert number_reported(client, "late_us_p50", lambda late: late > 0.0) > 0.0


def test_after_an_interruption_it_does_not_hurry_to_catch_up(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(mode="realtime")
    wait_for_ticks(client, 10)

    simulator.send(signal.SIGSTOP)
    deadline = time.monotonic() + 2.0
    client.spin_until(lambda: time.monotonic() > deadline, "the time")
    at, since_ns = len(client.states), time.time_ns()
    simulator.send(signal.SIGCONT)
    wait_for_ticks(client, 120)

    ticks = tick_of(client.states.last) - tick_of(client.states.messages[at])
    wall_time = (client.states.sent_ns[-1] - since_ns) / 1e9
    assert ticks < 240 * (wall_time + 0.2)  # but for a tenth of a second


# Commands


@pytest.mark.parametrize("stamped", [True, False], ids=["stamped", "unset stamp"])
@pytest.mark.parametrize("delay", [0, 5])
def test_a_command_is_held_and_then_zero_is_applied(
    processes: Processes, client: SimulatorClient, stamped: bool, delay: int
) -> None:
    processes.simulator(
        mode="realtime",
        real_time_factor=SLOWLY,
        command_timeout=HELD,
        command_delay_ticks=delay,
        wait_for_subscribers=1,
    )
    client.first_state()
    wait_for_ticks(client, 5)

    answered = stamp_ns(client.states.last) if stamped else 0
    client.command(answered, {"hinge": 1.5})
    wait_for_ticks(client, 80)

    commanded = sorted(tick for tick, effort in efforts(client).items() if effort)
    assert commanded
    assert commanded == list(range(commanded[0], commanded[-1] + 1))
    assert {efforts(client)[tick] for tick in commanded} == {1.5}
    if stamped:  # from when it came, which is not known, to when the state is too old
        assert commanded[-1] == round(answered * 240e-9) + HELD_TICKS + delay
    else:
        assert len(commanded) == HELD_TICKS
    status = client.reported(accepted=1, command_timeouts=1, command_age_ms="none")
    assert status.level == status.OK


def test_the_command_timeout_is_live(processes: Processes, client: SimulatorClient) -> None:
    processes.simulator(mode="realtime", real_time_factor=SLOWLY, wait_for_subscribers=1)
    client.first_state()

    assert client.set_parameter(topics.SIM_NODE, "command_timeout", HELD)[0]
    client.command(0, {"hinge": 1.0})
    wait_for_ticks(client, 40)
    taken, reason = client.set_parameter(topics.SIM_NODE, "command_timeout", 0.0)
    assert client.set_parameter(topics.SIM_NODE, "command_timeout", 0.002)[0]
    client.command(0, {"hinge": 2.0})
    wait_for_ticks(client, 40)

    applied = list(efforts(client).values())
    assert applied.count(1.0) == HELD_TICKS
    assert applied.count(2.0) == 1
    assert not taken
    assert "command_timeout" in reason


def test_commands_that_are_too_old_or_from_the_future_are_dropped_and_counted(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(mode="realtime", command_timeout=HELD, wait_for_subscribers=1)
    client.first_state()
    state = wait_for_ticks(client, 30)

    client.command(CLOCK.stamp_ns(1), {"hinge": 1.0})
    client.command(-1, {"hinge": 2.0})
    for ahead in range(20):
        client.command(stamp_ns(state) + 10**12 + ahead, {"hinge": 3.0})

    client.reported(accepted=0, stale=2, future=20)
    assert set(efforts(client).values()) == {0.0}
    assert simulator.stderr.count("dropped") == 1


def test_a_reset_forgets_the_command_and_makes_older_replies_stale(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator(
        mode="realtime", real_time_factor=SLOWLY, command_timeout=100.0, wait_for_subscribers=1
    )
    client.first_state()
    client.command(0, {"hinge": 1.0})
    client.spin_until(lambda: any(client.states.last.effort), "that it is applied")

    client.reset()
    client.spin_until(lambda: len(client.episodes) == 2, "the new episode")
    old = CLOCK.stamp_ns(tick_of(client.episodes.last) - 1)
    client.command(old, {"hinge": 2.0})
    wait_for_ticks(client, 30)

    first = tick_of(client.episodes.last)
    assert {effort for tick, effort in efforts(client).items() if tick >= first} == {0.0}
    client.reported(episode=2, accepted=1, stale=1)


# The controller


@pytest.mark.parametrize("name", ["pendulum", "franka_panda"])
def test_the_controller_drives_a_character_in_real_time(
    processes: Processes, client: SimulatorClient, name: str
) -> None:
    processes.simulator(name, mode="realtime", real_time_factor=0.5, wait_for_subscribers=2)
    processes.controller(name)

    wait_for_ticks(client, 360)

    rest = np.array(character(name).rest_position)
    assert np.abs(np.array(client.states.last.position) - rest).max() < 0.2
    assert np.abs(client.states.last.effort).max() > 0.0
    number_reported(client, "accepted", lambda count: count > 100)


def kill(process: Process) -> None:
    process.send(signal.SIGKILL)
    process.wait()


@pytest.mark.slow
def test_in_real_time_a_controller_that_is_killed_can_be_replaced(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator(mode="realtime", wait_for_subscribers=2)
    first = processes.controller()
    client.spin_until(lambda: client.states.messages and any(client.states.last.effort), "efforts")

    kill(first)
    client.spin_until(lambda: not any(client.states.last.effort), "no effort any more")
    number_reported(client, "command_timeouts", lambda count: count >= 1)
    processes.controller()

    client.spin_until(lambda: any(client.states.last.effort), "efforts again")
    client.spin_until(
        lambda: (
            abs(client.states.last.position[0] - 0.5) < 0.1
            and abs(client.states.last.velocity[0]) < 0.1
        ),
        "that it hangs where it should",
    )


@pytest.mark.slow
def test_in_lockstep_a_controller_that_is_killed_and_replaced_changes_nothing(
    processes: Processes, client: SimulatorClient
) -> None:
    def run(*, disturbed: bool) -> dict[int, bytes]:
        simulator = processes.simulator(
            "humanoid",
            session=SESSION,
            real_time_factor=1.0 if disturbed else 0.0,
            max_ticks=TICKS,
            wait_for_subscribers=2,
        )
        controller = start()
        if disturbed:
            client.spin_until(
                lambda: client.states.messages and tick_of(client.states.last) > TICKS // 2,
                "half of the ticks",
            )
            kill(controller)
            controller = start()
        client.spin_until(lambda: TICKS + 1 in client.states.ticks()[-2:], "the last state")
        assert simulator.wait() == 0
        controller.end()
        states = dict(zip(client.states.ticks(), client.states.raw, strict=True))
        client.states.messages.clear()
        client.states.raw.clear()
        return states

    def start() -> Process:
        return processes.controller("humanoid", reference="clip", root_assistance=False)

    undisturbed, disturbed = run(disturbed=False), run(disturbed=True)

    assert list(undisturbed) == list(range(1, TICKS + 2))
    assert disturbed == undisturbed
