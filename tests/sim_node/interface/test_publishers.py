"""What the simulator publishes beside the states, checked against them and by other means."""

import itertools
import json

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import ShapeType
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from tests.sim_node.conftest import Join
from tests.support.description import parse
from tests.support.physics import FLOATING_TURNED_FRAMES, character, simulation
from tests.support.ros import (
    Processes,
    ReceivedMessages,
    SimulatorClient,
    stamp_ns,
    tick_of,
    wrench_message,
)

CLOCK = TickClock(240)
SOON = 0.05  # s, a republish period for tests that wait for repeated states
STEADY = 1e-9  # of numbers of order one that are computed in two ways


def turn_matrix(rotation_vector: FloatArray) -> FloatArray:
    """The rotation matrix (3, 3), by Rodrigues' formula."""
    angle = float(np.linalg.norm(rotation_vector))
    x, y, z = rotation_vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix: FloatArray = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return matrix


def quaternion_matrix(x: float, y: float, z: float, w: float) -> FloatArray:
    """The rotation matrix (3, 3) of a quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def vector(message: object) -> FloatArray:
    """A Point or a Vector3."""
    return np.array([getattr(message, axis) for axis in "xyz"])


def orientation(message: object) -> FloatArray:
    return np.array([getattr(message, axis) for axis in "xyzw"])


# Odometry


def test_odometry_is_the_base_link_its_twist_in_its_own_frame(
    processes: Processes, client: SimulatorClient
) -> None:
    whole = character(FLOATING_TURNED_FRAMES)
    rng = np.random.default_rng(1)
    velocity = rng.uniform(-2.0, 2.0, whole.layout.size)
    position = np.array(whole.rest_position)
    position[:6] += rng.uniform(-1.0, 1.0, 6)
    odometry = client.listen(topics.ODOM)
    processes.simulator(
        FLOATING_TURNED_FRAMES,
        initial_position=position.tolist(),
        initial_velocity=velocity.tolist(),
        wait_for_subscribers=1,
    )

    client.drive(client.first_state(), 30, rng)
    client.spin_until(lambda: 31 in odometry.ticks(), "odometry")

    states = client.states.by_tick()
    assert set(odometry.ticks()) >= set(range(10, 32))
    for message in odometry.messages:
        state = states[tick_of(message)]
        assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
        turn = turn_matrix(np.array(state.position[3:6]))
        pose, twist = message.pose.pose, message.twist.twist
        np.testing.assert_allclose(vector(pose.position), state.position[:3], atol=STEADY)
        np.testing.assert_allclose(
            quaternion_matrix(*orientation(pose.orientation)), turn, atol=STEADY
        )
        np.testing.assert_allclose(
            turn @ vector(twist.linear), np.array(state.velocity[:3]), atol=STEADY
        )
        np.testing.assert_allclose(vector(twist.angular), state.velocity[3:6], atol=STEADY)


def test_odometry_of_a_fixed_base_stands_still_where_it_was_placed(
    processes: Processes, client: SimulatorClient
) -> None:
    odometry = client.listen(topics.ODOM)
    processes.simulator(placement=[1.0, 2.0, 3.0, 0.5], wait_for_subscribers=1)

    client.drive(client.first_state(), 10, np.random.default_rng(1))
    client.spin_until(lambda: 11 in odometry.ticks(), "odometry")

    pose, twist = odometry.last.pose.pose, odometry.last.twist.twist
    np.testing.assert_allclose(vector(pose.position), (1.0, 2.0, 3.0), atol=STEADY)
    quarter = (0.0, 0.0, np.sin(0.25), np.cos(0.25))
    np.testing.assert_allclose(orientation(pose.orientation), quarter, atol=STEADY)
    assert not any((*vector(twist.linear), *vector(twist.angular)))


def test_odometry_of_a_y_up_model_is_of_a_base_that_is_z_up_and_looks_along_x(
    processes: Processes, client: SimulatorClient
) -> None:
    odometry = client.listen(topics.ODOM)
    velocity = [1.0, 2.0, 3.0, *(0.0,) * 31]
    velocity[3:6] = 0.1, 0.2, 0.3  # about the model's x, y and z, which point forward, up, right
    processes.simulator("humanoid", initial_velocity=velocity, wait_for_subscribers=1)

    client.first_state()
    first = client.spin_until(lambda: odometry.messages and odometry.messages[0], "odometry")

    assert (first.header.frame_id, first.child_frame_id) == ("odom", "base_link")
    np.testing.assert_allclose(orientation(first.pose.pose.orientation), (0, 0, 0, 1), atol=1e-9)
    np.testing.assert_allclose(vector(first.twist.twist.linear), (1.0, 2.0, 3.0), atol=1e-9)
    np.testing.assert_allclose(vector(first.twist.twist.angular), (0.1, -0.3, 0.2), atol=1e-9)
    for covariance in (first.pose.covariance, first.twist.covariance):
        matrix = np.array(covariance).reshape(6, 6)
        assert (np.diag(matrix) > 0.0).all() and (np.diag(matrix) < 1e-6).all()
        assert not matrix[~np.eye(6, dtype=bool)].any()


def test_the_frames_of_the_odometry_have_the_names_that_are_given(
    processes: Processes, client: SimulatorClient
) -> None:
    odometry = client.listen(topics.ODOM)
    processes.simulator(odom_frame="map", base_frame="torso", wait_for_subscribers=1)

    client.first_state()
    message = client.spin_until(lambda: odometry.messages and odometry.last, "odometry")

    assert (message.header.frame_id, message.child_frame_id) == ("map", "torso")


# Contacts, and what a tick consists of


def test_contacts_name_the_links_that_touch_and_carry_the_weight(
    processes: Processes, client: SimulatorClient
) -> None:
    contacts = client.listen(topics.CONTACTS)
    processes.simulator("humanoid", wait_for_subscribers=2)
    processes.controller("humanoid", root_assistance=False)
    client.state(60)

    client.spin_until(lambda: 60 in contacts.ticks(), "contacts")

    whole = character("humanoid")
    by_tick = contacts.by_tick()
    settled = [by_tick[tick] for tick in range(20, 60)]
    assert {name for message in settled for name in message.joint_names} == {
        "left_ankle",
        "right_ankle",
    }
    assert {message.header.frame_id for message in settled} == {client.state(1).header.frame_id}
    forces = [sum(vector(wrench.force) for wrench in message.wrench) for message in settled]
    weight = whole.mass * 9.81
    assert np.mean(forces, axis=0)[2] == pytest.approx(weight, rel=0.2)


@pytest.mark.parametrize("substeps", [1, 2])
def test_contacts_carry_the_whole_wrench_on_each_link(
    processes: Processes, client: SimulatorClient, substeps: int
) -> None:
    contacts = client.listen(topics.CONTACTS)
    processes.simulator("humanoid", substeps=substeps, wait_for_subscribers=1)

    client.drive(client.first_state(), 60, np.random.default_rng(3))
    client.spin_until(lambda: 61 in contacts.ticks(), "contacts")

    names = [link.name for link in character("humanoid").links]
    by_tick, rng, largest = contacts.by_tick(), np.random.default_rng(3), 0.0
    with simulation("humanoid", substeps=substeps) as run:
        run.watches_contacts = True
        for tick in range(2, 62):
            effort = np.zeros(run.layout.size)
            effort[6:] = rng.uniform(-20.0, 20.0, run.layout.size - 6)
            run.advance(effort)
            if tick not in by_tick:  # before the simulator knew of the listener
                continue
            expected = run.simulated.contacts
            assert expected is not None
            rows = [names.index(name) for name in by_tick[tick].joint_names]
            assert rows == np.flatnonzero(expected.touching).tolist()
            for row, wrench in zip(rows, by_tick[tick].wrench, strict=True):
                assert vector(wrench.force).tolist() == expected.wrenches[row, :3].tolist()
                assert vector(wrench.torque).tolist() == expected.wrenches[row, 3:].tolist()
                largest = max(largest, float(np.abs(vector(wrench.torque)).max()))
    assert largest > 1.0


def clock_ticks(client: SimulatorClient) -> list[int]:
    times = [message.clock for message in client.clock.messages]
    return [round((time.sec + 1e-9 * time.nanosec) * 240) for time in times]


def test_a_tick_is_published_in_the_order_clock_contacts_pushes_state(
    processes: Processes, client: SimulatorClient
) -> None:
    inboxes = [client.listen(topics.CONTACTS), client.listen(topics.APPLIED_WRENCH), client.states]
    processes.simulator("humanoid", wait_for_subscribers=1)

    rng, state = np.random.default_rng(1), client.first_state()
    while not all(inbox.messages for inbox in (client.clock, *inboxes)):  # discovered one by one
        state = client.drive(state, 1, rng)
    first = tick_of(state) + 1
    last = tick_of(client.drive(state, 20, rng))
    for inbox in inboxes:
        client.spin_until(lambda inbox=inbox: last in inbox.ticks(), "all of a tick")
    client.spin_until(lambda: last in clock_ticks(client), "its time")

    sent = [dict(zip(inbox.ticks(), inbox.sent_ns, strict=True)) for inbox in inboxes]
    clock = dict(zip(clock_ticks(client), client.clock.sent_ns, strict=True))
    for tick in range(first, last + 1):  # every one of them
        times = [clock[tick], *(of_topic[tick] for of_topic in sent)]
        assert times == sorted(times)
    stamps = [{stamp_ns(m) for m in inbox.messages if tick_of(m) >= first} for inbox in inboxes]
    assert stamps[0] == stamps[1] == stamps[2]


# What is shown


@pytest.mark.parametrize(("name", "joint"), [("pendulum", "hinge"), ("humanoid", "chest_pitch")])
def test_the_robot_description_is_latched_and_has_joint_states(
    processes: Processes, client: SimulatorClient, name: str, joint: str
) -> None:
    positions = client.listen(topics.DESCRIPTION_JOINT_STATES)
    processes.simulator(name, wait_for_subscribers=1)
    client.first_state()
    descriptions = client.listen(topics.ROBOT_DESCRIPTION)

    client.spin_until(lambda: descriptions.messages and positions.messages, "the description")

    robot = parse(descriptions.last.data)
    moving = {name for name, each in robot.joint_map.items() if each.type != "fixed"}
    assert joint in moving
    assert set(positions.last.name) == moving
    assert len(positions.last.position) == len(moving)


TYPES = {
    ShapeType.BOX: [Marker.CUBE],
    ShapeType.SPHERE: [Marker.SPHERE],
    ShapeType.CYLINDER: [Marker.CYLINDER],
    ShapeType.CAPSULE: [Marker.CYLINDER, Marker.SPHERE, Marker.SPHERE],
    ShapeType.MESH: [Marker.MESH_RESOURCE],
}


@pytest.mark.parametrize("name", ["pendulum", "humanoid", "franka_panda"])
def test_markers_are_the_shapes_of_the_links_where_the_other_engine_has_them(
    processes: Processes, client: SimulatorClient, name: str
) -> None:
    markers = client.listen(topics.VISUALIZATION)
    processes.simulator(name, republish_period=SOON, wait_for_subscribers=1)
    whole = character(name)

    state = client.drive(client.first_state(), 40, np.random.default_rng(1))
    shown = client.spin_until(lambda: _of_stamp(markers, state), "markers of the last state")

    shapes = [(row, shape) for row, link in enumerate(whole.links) for shape in link.shapes]
    assert [m.type for m in shown] == [t for _, shape in shapes for t in TYPES[shape.type]]
    assert len({(m.ns, m.id) for m in shown}) == len(shown)
    assert {(m.header.frame_id, m.action) for m in shown} == {("world", Marker.ADD)}
    assert all(m.color.a > 0.0 and min(vector(m.scale)) > 0.0 for m in shown)
    model = DynamicsModel(whole)
    model.update(np.array(state.position), np.array(state.velocity))
    origins, turns = model.link_poses()
    firsts = itertools.accumulate((len(TYPES[shape.type]) for _, shape in shapes), initial=0)
    for (row, shape), first in zip(shapes, firsts, strict=False):
        axes = quaternion_matrix(*turns[row])
        place = origins[row] + axes @ np.array(shape.pose.position)
        turn = axes @ quaternion_matrix(*shape.pose.orientation_xyzw)
        pose = shown[first].pose
        np.testing.assert_allclose(vector(pose.position), place, atol=1e-6)
        np.testing.assert_allclose(
            quaternion_matrix(*orientation(pose.orientation)), turn, atol=1e-6
        )
        if shape.type is ShapeType.CAPSULE:
            radius, length = shape.size
            ends = [vector(m.pose.position) for m in shown[first + 1 : first + 3]]
            np.testing.assert_allclose((ends[0] + ends[1]) / 2.0, place, atol=1e-6)
            np.testing.assert_allclose(ends[0] - ends[1], turn[:, 2] * length, atol=1e-6)
            assert vector(shown[first].scale) == pytest.approx([2 * radius, 2 * radius, length])
            assert vector(shown[first + 1].scale) == pytest.approx([2 * radius] * 3)


def _of_stamp(markers: ReceivedMessages, state: JointState) -> list[Marker] | None:
    stamp = stamp_ns(state)
    found = [m.markers for m in markers.messages if stamp_ns(m.markers[0]) == stamp]
    return found[-1] if found else None


def test_markers_come_at_their_own_rate_of_simulated_time(
    processes: Processes, client: SimulatorClient
) -> None:
    markers = client.listen(topics.VISUALIZATION)
    processes.simulator(display_rate=24.0, republish_period=60.0, wait_for_subscribers=1)

    client.drive(client.first_state(), 60, np.random.default_rng(1))

    client.spin_until(lambda: tick_of(markers.last.markers[0]) == 60, "the last markers")
    ticks = [tick_of(message.markers[0]) for message in markers.messages]
    assert set(ticks) <= {1, 10, 20, 30, 40, 50, 60}
    assert ticks[-4:] == [30, 40, 50, 60]


# Diagnostics


def test_the_diagnostics_say_how_it_goes(processes: Processes, client: SimulatorClient) -> None:
    slowly = 0.1  # so that no deadline is missed
    processes.simulator("humanoid", max_ticks=30, real_time_factor=slowly, wait_for_subscribers=1)
    state = client.first_state()
    client.wrenches.publish(wrench_message(CLOCK.stamp_ns(20), [("chest", [1.0] * 6)]))
    for _ in range(30):
        state = client.advance(state, {"right_knee": -1000.0, "chest_x": 150.0, "chest_y": 150.0})

    status = client.reported(tick=31, accepted=30, accepted_pushes=1, rejected_pushes=0)

    values = {item.key: item.value for item in status.values}
    assert (status.name, status.level, status.message) == ("sim_node", status.OK, "running")
    assert status.hardware_id == "humanoid"
    assert (values["episode"], values["paused"], values["timeouts"]) == ("1", "False", "0")
    assert values["saturated_ticks"] == "60"
    assert set(values["saturated"].split()) == {"chest", "right_knee"}
    for name in ("duplicate", "conflict", "stale", "future", "rejected"):
        assert values[name] == "0"
    for name in ("ticks_per_s", "tick_us_p50", "tick_us_p99", "late_us_p50", "late_us_p99"):
        assert float(values[name]) >= 0.0
    assert int(values["missed_deadlines"]) >= 0


def test_the_diagnostics_warn_of_missed_deadlines(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator("humanoid", mode="realtime", rate=100_000)  # no machine keeps it

    def warned() -> object:
        statuses = [status for m in client.diagnostics.messages for status in m.status]
        return next((s for s in statuses if s.level == s.WARN), None)

    status = client.spin_until(warned, "a warning")
    assert "deadlines missed" in status.message


# Several characters


def two(**parameters: object) -> dict[str, object]:
    """Parameters of a simulator of a humanoid on the left and a pendulum on the right."""
    return {
        "characters": ["left", "right"],
        "left.character": "humanoid",
        "right.character": "pendulum",
        "right.placement": [2.0, 0.0, 0.0, 0.0],
        "wait_for_subscribers": 1,
        **parameters,
    }


def test_several_characters_have_topics_of_their_own_and_one_barrier_and_clock(
    processes: Processes, join: Join
) -> None:
    left, right = join("at_left", "left"), join("at_right", "right")
    processes.node(topics.SIM_NODE, **two(republish_period=SOON))
    first_left, first_right = left.first_state(), right.first_state()

    state = first_left
    for tick in range(1, 6):
        motors = [name for name in state.name if not name.startswith("root_")]
        left.command(stamp_ns(state), dict.fromkeys(motors, 0.5))
        enough = len(left.states) + 3  # republished: it waits for the other
        left.spin_until(lambda enough=enough: len(left.states) >= enough, "repeated states")
        assert tick_of(left.states.last) == tick
        right.command(stamp_ns(state), {"hinge": -0.25})
        state = left.state(tick + 1)
        assert stamp_ns(right.state(tick + 1)) == stamp_ns(state)

    assert tuple(first_left.name) == character("humanoid").layout.dof_names
    assert list(first_right.name) == ["hinge"]
    assert list(right.state(6).effort) == [-0.25]
    assert set(left.state(6).effort) == {0.0, 0.5}
    clock = [(m.clock.sec, m.clock.nanosec) for m in left.clock.messages]
    assert len(clock) == len(set(clock))  # not one a character
    assert len(left.node.get_publishers_info_by_topic("/clock")) == 1
    for one, name, whole in ((left, "left", "humanoid"), (right, "right", "pendulum")):
        one.spin_until(lambda one=one: one.configuration.messages, "configuration")
        content = json.loads(one.configuration.last.data)
        assert content["character"] == whole
        assert len(content["parameters"]["initial_position"]) == len(one.states.last.name)
        assert stamp_ns(one.episodes.last) == CLOCK.stamp_ns(1)
        status = one.spin_until(lambda one=one, name=name: _status(one, name), "its report")
        assert status.level == status.OK
        assert status.hardware_id == f"{name}/{whole}"


def _status(client: SimulatorClient, name: str) -> object:
    statuses = [status for m in client.diagnostics.messages for status in m.status]
    return next((s for s in statuses if s.name == f"{name}/sim_node"), None)


def test_each_of_several_characters_is_pushed_shown_and_driven_by_its_own(
    processes: Processes, join: Join
) -> None:
    left, right = join("at_left", "left"), join("at_right", "right")
    applied = left.listen(topics.APPLIED_WRENCH.under("left"))
    others = right.listen(topics.APPLIED_WRENCH.under("right"))
    odometry = right.listen(topics.ODOM.under("right"))
    simulator = processes.node(
        topics.SIM_NODE, **two(max_ticks=120, wait_for_subscribers=2, wrench_duration=0.0)
    )
    left.spin_until(left.wrenches.get_subscription_count, "a simulator that listens")
    left.wrenches.publish(wrench_message(CLOCK.stamp_ns(60), [("chest", [1.0] * 6)]))

    processes.controller("humanoid", namespace="left", root_assistance=False)
    processes.controller("pendulum", namespace="right", placement=[2.0, 0.0, 0.0, 0.0])

    left.spin_until(lambda: 121 in left.states.ticks(), "the last state")
    right.spin_until(lambda: 121 in right.states.ticks(), "the last state")
    assert simulator.wait() == 0
    left.spin_until(lambda: 121 in applied.ticks(), "the pushes")
    right.spin_until(lambda: 121 in others.ticks(), "the pushes")
    right.spin_until(lambda: odometry.messages, "odometry")
    assert [tick_of(m) for m in applied.messages if m.joint_names] == [61]
    assert not any(m.joint_names for m in others.messages)
    assert odometry.last.child_frame_id == "right/base_link"
    assert odometry.last.pose.pose.position.x == pytest.approx(2.0)


# Nobody's listening changes anything


def test_the_states_are_the_same_whether_all_or_nothing_else_is_listened_to(
    processes: Processes, client: SimulatorClient
) -> None:
    for topic in (
        topics.CONTACTS,
        topics.APPLIED_WRENCH,
        topics.ODOM,
        topics.VISUALIZATION,
        topics.DESCRIPTION_JOINT_STATES,
        topics.contact_wrench("left_ankle"),
    ):
        client.listen(topic)
    processes.simulator("humanoid", display_rate=240.0, substeps=2, wait_for_subscribers=1)

    client.drive(client.first_state(), 150, np.random.default_rng(3))  # it falls

    rng = np.random.default_rng(3)
    messages = client.states.by_tick()
    with simulation("humanoid", substeps=2) as run:
        for tick in range(2, 152):
            effort = np.zeros(run.layout.size)
            effort[6:] = rng.uniform(-20.0, 20.0, run.layout.size - 6)
            state = run.advance(effort)
            assert list(messages[tick].position) == state.position.tolist()
            assert list(messages[tick].velocity) == state.velocity.tolist()
