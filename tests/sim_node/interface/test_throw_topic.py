"""Balls that are thrown, sent to the simulator over ROS, and what it says of them."""

from collections.abc import Mapping

import numpy as np
from rclpy.duration import Duration
from rclpy.publisher import Publisher
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker

from msgs_config.arrays import FloatArray
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.projectiles import decode_balls
from msgs_config.messages.throw import BOX_NUMBERS, NUMBERS, ProjectileThrow, natural_radius
from sim_node.physics.balls.throws import MOST_BALLS
from tests.sim_node.conftest import Join
from tests.support.physics import character, joint_simulation, simulation
from tests.support.ros import (
    PATIENCE,
    Processes,
    ReceivedMessages,
    SimulatorClient,
    joint_state,
    stamp_ns,
    tick_of,
)

CLOCK = TickClock(240)
AT_CHEST = ProjectileThrow(2.0, 0.1, (0.4, 0.02, 1.2), (-8.0, 0.0, 1.0))
FAR = ProjectileThrow(3.0, natural_radius(3.0), (5.0, 5.0, 0.4), (1.0, 0.0, 0.0))
BOX = ProjectileThrow(9.0, None, (1.0, 0.0, 0.1), (-3.0, 0.0, 0.0), (0.4, 0.3, 0.2), 0.3)


def throw_message(stamp: int, throw: ProjectileThrow) -> JointState:
    """A throw, stamped in ns."""
    return joint_state(stamp, throw.names, throw.numbers().tolist())


def numbers_message(stamp: int, other: Mapping[str, float]) -> JointState:
    """A throw of which some numbers are others, or more."""
    numbers = dict(zip(NUMBERS, FAR.numbers().tolist(), strict=True)) | dict(other)
    return joint_state(stamp, list(numbers), list(numbers.values()))


def told(inbox: ReceivedMessages) -> dict[int, list[tuple[float, ...]]]:
    """The numbers of what was thrown, by the tick of the state after it."""
    found: dict[int, list[tuple[float, ...]]] = {}
    for message in inbox.messages:
        assert tuple(message.name) == NUMBERS
        found.setdefault(tick_of(message), []).append(tuple(message.position))
    return found


def motions(inbox: ReceivedMessages) -> dict[int, FloatArray]:
    """Where the balls are, and how they move, by tick."""
    return {
        tick: decode_balls(raw).motion for tick, raw in zip(inbox.ticks(), inbox.raw, strict=True)
    }


def hear(client: SimulatorClient) -> tuple[ReceivedMessages, ReceivedMessages]:
    """What was thrown, and where the balls are."""
    return client.listen(topics.APPLIED_THROW), client.listen(topics.THROWN)


def send(client: SimulatorClient, publisher: Publisher, *messages: JointState | bytes) -> None:
    """Send throws; the simulator has them when this returns."""
    client.spin_until(publisher.get_subscription_count, "a simulator that listens")
    for message in messages:
        publisher.publish(message)
    assert publisher.wait_for_all_acked(Duration(seconds=PATIENCE))


def test_a_throw_begins_at_its_tick_and_does_what_it_does_without_ros(
    processes: Processes, client: SimulatorClient
) -> None:
    applied, thrown = hear(client)
    throws = client.speak(topics.THROW)
    processes.simulator("humanoid", max_ticks=60, wait_for_subscribers=1)
    between = CLOCK.stamp_ns(10) - 1_000_000  # two ticks

    send(
        client,
        throws,
        throw_message(between, AT_CHEST),
        numbers_message(CLOCK.stamp_ns(20), {}),
    )
    state = client.first_state()
    while tick_of(state) < 61:
        state = client.advance(state, {})
    client.spin_until(lambda: 61 in thrown.ticks(), "the last place of the balls")

    assert told(applied) == {
        11: [tuple(AT_CHEST.numbers().tolist())],
        21: [tuple(FAR.numbers().tolist())],
    }
    assert [message.joint_names for message in (thrown.messages[0], thrown.messages[-1])] == [
        ["ball_1"],
        ["ball_1", "ball_2"],
    ]
    where, states = motions(thrown), client.states.by_tick()
    assert sorted(where) == list(range(11, 62))
    with simulation("humanoid") as run:
        (simulated,) = run.characters
        for tick in range(1, 61):
            run.step([np.zeros(run.layout.size)], None, {10: [AT_CHEST], 20: [FAR]}.get(tick, ()))
            assert list(states[tick + 1].position) == simulated.state.position.tolist()
            assert list(states[tick + 1].velocity) == simulated.state.velocity.tolist()
            if tick >= 10:
                assert where[tick + 1].tobytes() == run.ball_motion().tobytes()
        assert abs(run.ball_motion()[0, 7]) < 6.0  # it has hit something


def test_balls_are_shown_where_they_are_until_a_reset(
    processes: Processes, client: SimulatorClient
) -> None:
    throws, shown = client.speak(topics.THROW), client.listen(topics.VISUALIZATION)
    _, thrown = hear(client)
    processes.simulator("pendulum", display_rate=240.0, wait_for_subscribers=1)
    send(client, throws, throw_message(CLOCK.stamp_ns(3), AT_CHEST))

    state = client.drive(client.first_state(), 9, np.random.default_rng(1))
    client.spin_until(lambda: markers_at(shown, tick_of(state)), "the last markers")
    client.spin_until(lambda: tick_of(state) in thrown.ticks(), "the last place of the ball")
    client.reset()
    again = client.spin_until(lambda: markers_at(shown, tick_of(state) + 1), "the next episode")

    before, last = markers_at(shown, 2), markers_at(shown, tick_of(state))
    *body, ball = last
    assert [m.id for m in before] == [m.id for m in body]
    until_reset = [m for tick in range(2, tick_of(state)) for m in markers_at(shown, tick)]
    assert {m.action for m in until_reset} == {Marker.ADD}  # a ball that comes deletes nothing
    assert (ball.header.frame_id, ball.action, ball.type) == ("world", Marker.ADD, Marker.SPHERE)
    assert ball.id not in {m.id for m in body}
    assert ball.color.a > 0.0
    diameters = [ball.scale.x, ball.scale.y, ball.scale.z]
    assert diameters == [2.0 * AT_CHEST.radius] * 3
    place = ball.pose.position
    assert [place.x, place.y, place.z] == motions(thrown)[tick_of(state)][0, :3].tolist()
    assert [(m.id, m.action) for m in again[len(body) :]] == [(ball.id, Marker.DELETE)]


def test_a_box_is_told_and_seen_as_one(processes: Processes, client: SimulatorClient) -> None:
    applied, thrown = hear(client)
    shown, throws = client.listen(topics.VISUALIZATION), client.speak(topics.THROW)
    processes.simulator("humanoid", max_ticks=40, display_rate=240, wait_for_subscribers=1)

    send(client, throws, throw_message(CLOCK.stamp_ns(3), FAR))
    send(client, throws, throw_message(CLOCK.stamp_ns(5), BOX))
    state = client.first_state()
    while tick_of(state) < 31:
        state = client.advance(state, {})
    client.spin_until(lambda: 31 in thrown.ticks(), "the last place of the box")
    client.spin_until(lambda: markers_at(shown, 31), "the box is seen")

    assert [tuple(message.name) for message in applied.messages] == [NUMBERS, BOX_NUMBERS]
    assert list(applied.messages[1].position) == BOX.numbers().tolist()
    assert thrown.messages[-1].joint_names == ["ball_1", "box_2"]
    *_, sphere, cube = markers_at(shown, 31)
    assert (sphere.type, cube.type) == (Marker.SPHERE, Marker.CUBE)
    assert (cube.scale.x, cube.scale.y, cube.scale.z) == BOX.size
    turn = cube.pose.orientation
    assert [turn.x, turn.y, turn.z, turn.w] == motions(thrown)[31][1, 3:7].tolist()
    with simulation("humanoid") as run:
        for tick in range(1, 31):
            thrown_now = {3: [FAR], 5: [BOX]}.get(tick, ())
            run.step([np.zeros(run.layout.size)], None, thrown_now)
        assert motions(thrown)[31].tobytes() == run.ball_motion().tobytes()


def markers_at(shown: ReceivedMessages, tick: int) -> list[Marker]:
    """The markers of a tick; none if they are not there."""
    found = [m.markers for m in shown.messages if tick_of(m.markers[0]) == tick]
    return list(found[-1]) if found else []


REFUSED: dict[str, tuple[JointState | bytes, str]] = {
    "a past stamp": (numbers_message(CLOCK.stamp_ns(2), {}), "is over"),
    "before all time": (numbers_message(-5, {}), "is over"),
    "an unknown number": (numbers_message(0, {"target": 1.0}), "unknown number 'target'"),
    "nothing": (JointState(), "'mass' is missing"),
    "fewer values": (joint_state(0, NUMBERS, [1.0] * 7), "8 names but 7 numbers"),
    "not a number": (numbers_message(0, {"vy": float("nan")}), "vy is nan; it must be finite"),
    "no mass": (numbers_message(0, {"mass": -1.0}), "mass is -1; it must be 0.001 to 10000"),
    "a ball and a box": (numbers_message(0, {"size_x": 0.1}), "unknown number 'radius'"),
    "too large": (numbers_message(0, {"radius": 9.0}), "radius is 9; it must be 0.005 to 5"),
    "too fast": (numbers_message(0, {"vz": 5e3}), "at most 1000 m/s"),
    "no message": (b"\x00\x01\x00\x00\xff\xff\xff\xff", "no JointState"),
}


def test_a_wrong_throw_is_refused_whole_and_the_reason_said_once_and_counted(
    processes: Processes, client: SimulatorClient
) -> None:
    applied, thrown = hear(client)
    throws = client.speak(topics.THROW)
    simulator = processes.simulator(max_ticks=30, wait_for_subscribers=1)
    state = client.first_state()
    for _ in range(4):
        state = client.advance(state, {})

    for _ in range(3):
        send(client, throws, *(message for message, _ in REFUSED.values()))
        state = client.advance(state, {})
    later = [numbers_message(CLOCK.stamp_ns(1000 + tick), {}) for tick in range(MOST_BALLS + 5)]
    send(client, throws, *later)  # more than a tick takes
    while tick_of(state) < 31:
        state = client.advance(state, {})

    client.reported(rejected_throws=3 * len(REFUSED) + 5, accepted_throws=MOST_BALLS)
    assert applied.messages == [] and thrown.messages == []
    warnings = [line for line in simulator.stderr.splitlines() if "throw refused" in line]
    reasons = [reason for _, reason in REFUSED.values()] + [f"at most {MOST_BALLS} balls"]
    for reason in reasons:
        assert any(reason in warning for warning in warnings), reason
    assert len(warnings) <= len(reasons)


def test_the_balls_of_a_world_of_several_are_nobodys(processes: Processes, join: Join) -> None:
    placed = [0.0, 3.0, 0.0, 0.0]
    given = {"characters": ["left", "right"], "left.placement": placed}
    clients = [join(f"at_{name}", name) for name in ("left", "right")]
    throws, (_, thrown) = clients[0].speak(topics.THROW), hear(clients[0])
    processes.simulator(
        "humanoid", characters=["left", "right"], left__placement=placed, wait_for_subscribers=1
    )
    send(clients[0], throws, throw_message(CLOCK.stamp_ns(3), AT_CHEST))
    states = [client.first_state() for client in clients]
    for _ in range(19):
        for client, state in zip(clients, states, strict=True):
            client.command(stamp_ns(state), dict.fromkeys(state.name[6:], 0.0))
        states = [client.state(tick_of(states[0]) + 1) for client in clients]
    clients[0].spin_until(lambda: 20 in thrown.ticks(), "the last place of the ball")

    nothing = np.zeros(character("humanoid").layout.size)
    with joint_simulation({"character": "humanoid", **given}) as run:
        for tick in range(1, 20):
            run.step([nothing, nothing], None, [AT_CHEST] if tick == 3 else ())
        assert motions(thrown)[20].tobytes() == run.ball_motion().tobytes()
        for state, simulated in zip(states, run.characters, strict=True):
            assert list(state.position) == simulated.state.position.tolist()
    assert run.balls == (AT_CHEST,)


def test_who_joins_late_gets_the_contacts_with_the_state(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator("humanoid", republish_period=0.05, wait_for_subscribers=1)
    state = client.first_state()
    for _ in range(3):
        state = client.advance(state, {})
    tick = tick_of(state)

    contacts = client.listen(topics.CONTACTS)  # nobody has watched what touched until then
    client.spin_until(lambda: tick in contacts.ticks(), "the contacts of a state that waits")
    again = sum(tick_of(message) == tick for message in client.states.messages)
    state = client.advance(state, {})
    client.spin_until(lambda: tick + 1 in contacts.ticks(), "those of the next one")
    before = len(contacts.messages)
    client.spin_until(lambda: len(contacts.messages) > before + 1, "the same once more")

    assert again >= 1
    assert contacts.raw[-1] == contacts.raw[-2]
    assert tick_of(contacts.messages[-1]) == tick + 1
