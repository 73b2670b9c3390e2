"""Pushes from outside, sent to the simulator over ROS, and what it says of them."""

from collections.abc import Sequence

import numpy as np
import pytest
from sensor_msgs.msg import MultiDOFJointState

from msgs_config.character.layout import ROOT
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from sim_node.physics.wrenches import ExternalWrench
from tests.support.physics import character, simulation
from tests.support.ros import Processes, ReceivedMessages, SimulatorClient, tick_of, wrench_message

SESSION = "/sim_node#000000000001"  # of two runs that are compared byte by byte
CLOCK = TickClock(240)
THREE_TICKS = 3.0 / 240.0  # s

Told = list[tuple[str, tuple[float, ...], tuple[float, ...]]]


def told(message: MultiDOFJointState) -> Told:
    """Link, wrench and point of each push in a message."""
    wrenches = [(w.force, w.torque) for w in message.wrench]
    points = [t.translation for t in message.transforms]
    return [
        (name, (f.x, f.y, f.z, t.x, t.y, t.z), (p.x, p.y, p.z))
        for name, (f, t), p in zip(message.joint_names, wrenches, points, strict=True)
    ]


def centre_of(name: str, link: str) -> tuple[float, ...]:
    """A link's centre of mass, m in its frame."""
    return next(one.inertial_pose.position for one in character(name).links if one.name == link)


def row_of(name: str, link: str) -> int:
    return [one.name for one in character(name).links].index(link)


def assert_as_without_ros(
    client: SimulatorClient,
    name: str,
    ticks: int,
    pushes: Sequence[ExternalWrench],
    **parameters: object,
) -> None:
    """The first states are, to the bit, those of a simulation without ROS that is pushed alike."""
    messages = client.states.by_tick()
    with simulation(name, **parameters) as run:
        for tick in range(1, ticks + 1):
            state = run.advance(
                np.zeros(run.layout.size), *(push for push in pushes if push.acts_at(tick))
            )
            assert list(messages[tick + 1].position) == state.position.tolist()
            assert list(messages[tick + 1].velocity) == state.velocity.tolist()


def answer_until(
    client: SimulatorClient, applied: ReceivedMessages, last_tick: int
) -> dict[int, Told]:
    """Command zero until a state, and give what was applied before each."""
    state = client.states.last
    while tick_of(state) < last_tick:
        state = client.advance(state, {})
    client.spin_until(lambda: last_tick in applied.ticks(), "the last push")
    return {tick: told(message) for tick, message in applied.by_tick().items()}


# When they act


def test_a_push_without_a_stamp_acts_from_the_next_tick_and_is_held_for_its_duration(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator("humanoid", wrench_duration=THREE_TICKS, wait_for_subscribers=1)
    applied = client.listen(topics.APPLIED_WRENCH)
    client.first_state()
    client.spin_until(lambda: applied.messages, "what is applied")  # it knows that we listen
    push = (200.0, -50.0, 10.0, 1.0, 2.0, 3.0)

    client.wrenches.publish(wrench_message(0, [("chest", push)]))
    pushed = answer_until(client, applied, 20)

    first = min(tick for tick, content in pushed.items() if content)  # the state after the push
    expected = ("chest", push, centre_of("humanoid", "chest"))
    assert first <= 10
    assert pushed == {
        tick: [expected] if first <= tick < first + 3 else [] for tick in range(1, 21)
    }
    acts = ExternalWrench(
        row_of("humanoid", "chest"), np.array(push), np.array(expected[2]), first - 1, 3
    )
    assert_as_without_ros(client, "humanoid", 19, [acts])


@pytest.mark.parametrize("early_ns", [0, 1_000_000], ids=["of a tick", "between two ticks"])
def test_a_push_with_a_future_stamp_acts_from_exactly_that_tick(
    processes: Processes, client: SimulatorClient, early_ns: int
) -> None:
    processes.simulator(wrench_duration=THREE_TICKS, wait_for_subscribers=1)
    applied = client.listen(topics.APPLIED_WRENCH)
    client.first_state()
    client.spin_until(lambda: applied.messages, "what is applied")
    (_, *_, link) = [link.name for link in character("pendulum").links]
    push = (5.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    client.wrenches.publish(wrench_message(CLOCK.stamp_ns(15) - early_ns, [(link, push)]))
    pushed = answer_until(client, applied, 25)

    assert [tick for tick, content in pushed.items() if content] == [16, 17, 18]
    centre = np.array(centre_of("pendulum", link))
    acts = ExternalWrench(row_of("pendulum", link), np.array(push), centre, 15, 3)
    assert_as_without_ros(client, "pendulum", 24, [acts])


def test_the_duration_can_be_changed_and_pushes_that_overlap_add_up(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator("humanoid", wrench_duration=THREE_TICKS, wait_for_subscribers=1)
    applied = client.listen(topics.APPLIED_WRENCH)
    state = client.first_state()
    client.spin_until(lambda: applied.messages, "what is applied")
    one, other = [("neck", (9.0, 0, 0, 0, 0, 0))], [("neck", (0, 8.0, 0, 0, 0, 0))]

    client.wrenches.publish(wrench_message(CLOCK.stamp_ns(20), one))
    client.drive(state, 10, np.random.default_rng(1))  # the simulator has it
    client.set_parameter(topics.SIM_NODE, "wrench_duration", 5.0 / 240.0)
    client.wrenches.publish(wrench_message(CLOCK.stamp_ns(21), other))
    pushed = answer_until(client, applied, 30)

    forces = {tick: [wrench[:2] for _, wrench, _ in content] for tick, content in pushed.items()}
    assert [len(forces[tick]) for tick in range(20, 29)] == [0, 1, 2, 2, 1, 1, 1, 0, 0]
    assert forces[21] == [(9.0, 0.0)]
    assert forces[23] == [(9.0, 0.0), (0.0, 8.0)]
    assert forces[26] == [(0.0, 8.0)]


# Where they act


def test_several_links_are_pushed_at_once_where_the_message_says(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator("humanoid", wrench_duration=THREE_TICKS, wait_for_subscribers=1)
    applied = client.listen(topics.APPLIED_WRENCH)
    client.first_state()
    rng = np.random.default_rng(1)
    links = ["left_wrist", "chest", "right_knee"]
    wrenches, points = rng.uniform(-50.0, 50.0, (3, 6)), rng.uniform(-0.2, 0.2, (3, 3))

    client.wrenches.publish(
        wrench_message(
            CLOCK.stamp_ns(12), list(zip(links, wrenches.tolist(), strict=True)), points.tolist()
        )
    )
    pushed = answer_until(client, applied, 30)

    expected = [
        (link, tuple(wrench.tolist()), tuple(point.tolist()))
        for link, wrench, point in zip(links, wrenches, points, strict=True)
    ]
    assert [pushed[tick] for tick in (12, 13, 14, 15, 16)] == [[], *[expected] * 3, []]
    acts = [
        ExternalWrench(row_of("humanoid", link), wrench, point, 12, 3)
        for link, wrench, point in zip(links, wrenches, points, strict=True)
    ]
    assert_as_without_ros(client, "humanoid", 29, acts)


# What is not taken


REFUSED: dict[str, tuple[MultiDOFJointState | bytes, str]] = {
    "unknown link": (wrench_message(0, [("chest", [1.0] * 6), ("tail", [1.0] * 6)]), "'tail'"),
    "a past stamp": (wrench_message(CLOCK.stamp_ns(2), [("chest", [1.0] * 6)]), "is over"),
    "before all time": (wrench_message(-5, [("chest", [1.0] * 6)]), "is over"),
    "not a number": (
        wrench_message(0, [("chest", [1.0] * 6), ("neck", [float("nan")] * 6)]),
        "wrench on 'neck' is not finite",
    ),
    "an infinite torque": (
        wrench_message(0, [("neck", [0.0] * 5 + [float("inf")])]),
        "wrench on 'neck' is not finite",
    ),
    "an infinite point": (
        wrench_message(0, [("neck", [1.0] * 6)], [[0.0, float("-inf"), 0.0]]),
        "point on 'neck' is not finite",
    ),
    "fewer points": (
        wrench_message(0, [("chest", [1.0] * 6), ("neck", [1.0] * 6)], [[0.0] * 3]),
        "2 links but 1 transforms",
    ),
    "more points": (wrench_message(0, [("chest", [1.0] * 6)], [[0.0] * 3] * 2), "but 2 transforms"),
    "no wrench": (MultiDOFJointState(joint_names=["chest"]), "1 links but 0 wrenches"),
    "empty": (wrench_message(0, []), "an empty push"),
    "no message": (b"\x00\x01\x00\x00\xff\xff\xff\xff", "no MultiDOFJointState"),
}


def test_a_wrong_push_is_refused_whole_and_the_reason_said_once_and_counted(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator("humanoid", max_ticks=60, wait_for_subscribers=1)
    applied = client.listen(topics.APPLIED_WRENCH)
    state = client.first_state()
    for _ in range(4):
        state = client.advance(state, {})

    for _ in range(3):
        for message, _ in REFUSED.values():
            client.wrenches.publish(message)
        state = client.advance(state, {})
    pushed = answer_until(client, applied, 61)

    assert {len(content) for content in pushed.values()} == {0}
    assert_as_without_ros(client, "humanoid", 60, [])
    client.reported(rejected_pushes=3 * len(REFUSED), accepted_pushes=0)
    warnings = [line for line in simulator.stderr.splitlines() if "push refused" in line]
    for _, reason in REFUSED.values():
        assert any(reason in warning for warning in warnings), reason
    assert len(warnings) <= len(REFUSED)


def test_a_push_that_is_always_too_late_is_told_once(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(max_ticks=30)
    state = client.advance(client.first_state(), {})
    (_, *_, link) = [link.name for link in character("pendulum").links]

    for _ in range(29):
        late = wrench_message(CLOCK.stamp_ns(tick_of(state) - 1), [(link, [1.0] * 6)])
        client.wrenches.publish(late)
        state = client.advance(state, {})

    assert simulator.wait() == 0
    assert simulator.stderr.count("is over") == 1


# Repeats


def test_two_runs_with_the_same_stamped_pushes_are_the_same_to_the_byte(
    processes: Processes, client: SimulatorClient
) -> None:
    applied = client.listen(topics.APPLIED_WRENCH)
    contacts = client.listen(topics.CONTACTS)
    inboxes = (client.states, applied, contacts)

    runs = []
    for _ in range(2):
        simulator = processes.simulator(
            "humanoid",
            session=SESSION,
            commanded_joints=_every_joint(),
            max_ticks=150,
            wait_for_subscribers=2,
        )
        client.spin_until(client.wrenches.get_subscription_count, "a simulator that listens")
        for tick, force in ((30, 400.0), (60, -300.0), (61, 200.0)):
            push = [("chest", (force, force, 0.0, 0.0, 0.0, 0.0))]
            client.wrenches.publish(wrench_message(CLOCK.stamp_ns(tick), push))
        controller = processes.controller("humanoid", reference="clip")
        assert simulator.wait() == 0
        for inbox in inboxes:
            client.spin_until(lambda inbox=inbox: 151 in inbox.ticks(), "the last tick")
        controller.end()
        client.spin_until(lambda: not client.wrenches.get_subscription_count(), "its end")
        runs.append([dict(zip(inbox.ticks(), inbox.raw, strict=True)) for inbox in inboxes])
        for inbox in inboxes:
            inbox.messages.clear()
            inbox.raw.clear()

    assert runs[0] == runs[1]
    states, pushes, touches = runs[0]
    assert list(states) == list(range(1, 152))
    assert set(pushes) >= set(range(10, 152))
    assert set(touches) >= set(range(10, 152))
    assert len(set(pushes.values())) == len(pushes)  # each with its own stamp


def _every_joint() -> list[str]:
    return [ROOT, *character("humanoid").layout.actuated_joint_names]
