"""Pins, sent to the simulator over ROS, and what it says of them."""

from collections.abc import Mapping

import numpy as np
from sensor_msgs.msg import MultiDOFJointState

from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.pins import PinArrays, PinRow, decode_pins, encode_pins
from msgs_config.messages.wrenches import decode_wrenches
from sim_node.physics.pins import Pin
from tests.support.physics import character, simulation
from tests.support.ros import Processes, ReceivedMessages, SimulatorClient, tick_of

CLOCK = TickClock(240)
HAND: PinRow = (0.3, -0.2, 1.3, 0.0, 0.0, -0.01, 90.0)
GONE: PinRow = (0.0,) * 7
NAN = float("nan")


def message(stamp_ns: int, **rows: PinRow) -> bytes:
    """Pins of links, which begin at a stamp."""
    return encode_pins(PinArrays.of_rows(stamp_ns, rows, ""))


def as_pin(link: str, row: PinRow, name: str = "humanoid") -> Pin:
    rows = [each.name for each in character(name).links]
    x, y, z, px, py, pz, force = row
    return Pin(rows.index(link), (x, y, z), (px, py, pz), force)


def told(inbox: ReceivedMessages) -> dict[int, dict[str, PinRow]]:
    """What was in force in the tick before each state."""
    return {tick: decode_pins(raw).rows for tick, raw in zip(inbox.ticks(), inbox.raw, strict=True)}


def answer_until(client: SimulatorClient, last_tick: int) -> None:
    state = client.states.last
    while tick_of(state) < last_tick:
        state = client.advance(state, {})


def assert_as_without_ros(
    client: SimulatorClient, ticks: int, changes: Mapping[int, list[Pin]]
) -> dict[int, list[list[float]]]:
    """The states are those of a simulation with these pins; returns the forces in each tick."""
    messages, forces = client.states.by_tick(), {}
    with simulation("humanoid") as run:
        for tick in range(1, ticks + 1):
            run.step([np.zeros(run.layout.size)], pins=[changes.get(tick, [])])
            assert list(messages[tick + 1].position) == run.state.position.tolist()
            forces[tick + 1] = [push.wrench.tolist() for push in run.simulated.pushes]
    return forces


def test_a_pin_holds_from_its_stamp_on_until_it_is_let_go_and_is_told_in_each_tick(
    processes: Processes, client: SimulatorClient
) -> None:
    pins = client.speak(topics.PIN)
    in_force, applied = client.listen(topics.APPLIED_PIN), client.listen(topics.APPLIED_WRENCH)
    processes.simulator("humanoid", max_ticks=60, wait_for_subscribers=1)
    client.first_state()
    client.spin_until(lambda: applied.messages, "what is applied")
    client.spin_until(pins.get_subscription_count, "a simulator that listens")
    between = CLOCK.stamp_ns(20) - 1_000_000  # two ticks

    pins.publish(message(CLOCK.stamp_ns(40), right_wrist=GONE))  # the order of sending is free
    pins.publish(message(between, right_wrist=HAND, left_wrist=HAND))
    pins.publish(message(CLOCK.stamp_ns(30), left_wrist=GONE))
    answer_until(client, 61)
    client.spin_until(lambda: 61 in applied.ticks(), "the last forces")

    both = {"right_wrist": HAND, "left_wrist": HAND}
    assert told(in_force) == {
        **dict.fromkeys(range(21, 31), both),
        **{tick: {"right_wrist": HAND} for tick in range(31, 41)},
    }
    right, left = as_pin("right_wrist", HAND), as_pin("left_wrist", HAND)
    changes = {
        20: [right, left],
        30: [as_pin("left_wrist", GONE)],
        40: [as_pin("right_wrist", GONE)],
    }
    forces = assert_as_without_ros(client, 60, changes)
    found = {
        tick: decode_wrenches(raw).wrenches.tolist()
        for tick, raw in zip(applied.ticks(), applied.raw, strict=True)
    }
    assert found == {1: [], **forces}
    client.reported(accepted_pins=3, rejected_pins=0, foreign_pins=0)


def changed(row: PinRow, number: int, value: float) -> PinRow:
    return (*row[:number], value, *row[number + 1 :])


REFUSED = {
    "an unknown link": (message(0, nose=HAND), "nose"),
    "a place that is none": (message(0, neck=changed(HAND, 1, NAN)), "the place of 'neck'"),
    "a point that is none": (message(0, neck=changed(HAND, 5, NAN)), "the point of 'neck'"),
    "one of two": (message(0, chest=HAND, neck=changed(HAND, 6, -1.0)), "on 'neck' is -1 N"),
    "no wrench": (MultiDOFJointState(joint_names=["chest"]), "1 links but 0 wrenches"),
    "empty": (message(0), "an empty pin"),
    "over": (message(CLOCK.stamp_ns(1), neck=HAND), "is over"),
    "no message": (b"\x00\x01\x00\x00\xff\xff\xff\xff", "no MultiDOFJointState"),
}


def test_a_wrong_pin_is_refused_whole_and_the_reason_said_once_and_counted(
    processes: Processes, client: SimulatorClient
) -> None:
    pins, in_force = client.speak(topics.PIN), client.listen(topics.APPLIED_PIN)
    simulator = processes.simulator("humanoid", max_ticks=30, wait_for_subscribers=1)
    state = client.first_state()
    client.spin_until(pins.get_subscription_count, "a simulator that listens")
    for _ in range(4):
        state = client.advance(state, {})

    for _ in range(3):
        for refused, _ in REFUSED.values():
            pins.publish(refused)
        state = client.advance(state, {})
    answer_until(client, 31)

    assert not in_force.raw
    assert_as_without_ros(client, 30, {})
    client.reported(rejected_pins=3 * len(REFUSED), accepted_pins=0)
    warnings = [line for line in simulator.stderr.splitlines() if "pin refused" in line]
    for _, reason in REFUSED.values():
        assert any(reason in warning for warning in warnings), reason
    assert len(warnings) <= len(REFUSED)


def test_a_reset_discards_pins_that_act_and_that_wait(
    processes: Processes, client: SimulatorClient
) -> None:
    pins, in_force = client.speak(topics.PIN), client.listen(topics.APPLIED_PIN)
    processes.simulator("humanoid", max_ticks=40, wait_for_subscribers=1)
    client.first_state()
    client.spin_until(pins.get_subscription_count, "a simulator that listens")
    pins.publish(message(CLOCK.stamp_ns(5), right_wrist=HAND))
    pins.publish(message(CLOCK.stamp_ns(25), left_wrist=HAND))
    answer_until(client, 15)

    assert client.reset().success
    answer_until(client, 41)

    assert sorted(told(in_force)) == list(range(6, 16))
