"""Frames, joints of the description and contact wrenches: what viewers show of a character."""

import json
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.context import Context
from rclpy.validate_topic_name import validate_topic_name

from actuated_characters.runs.processes import MODULES
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.geometry import rotations
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from tests.sim_node.conftest import Join
from tests.support.description import link_frames, parse
from tests.support.description_picture import draw_description, draw_position, view_at
from tests.support.physics import FLOATING_TURNED_FRAMES, character
from tests.support.ros import Process, Processes, SimulatorClient, stamp_ns, tick_of
from tests.support.transforms import TF2, Frames, environment_with_tf2

CLOCK = TickClock(240)
Simulator = Callable[..., Process]


@pytest.fixture(autouse=True)
def tf2(monkeypatch: pytest.MonkeyPatch) -> None:
    """A package `tf2_msgs`, for what imports it from now on."""
    monkeypatch.syspath_prepend(str(TF2))


@pytest.fixture
def frames(client: SimulatorClient, tf2: None) -> Frames:
    return Frames(client.node)


@pytest.fixture
def simulator(processes: Processes) -> Simulator:
    """Starts `sim_node` where `tf2_msgs` can be imported."""

    def start(**parameters: object) -> Process:
        given = [part for item in parameters.items() for part in ("-p", "{}:={}".format(*item))]
        return processes.python(
            *("-m", MODULES[topics.SIM_NODE], "--ros-args"),
            *("-p", "wait_for_subscribers:=1", *given),
            environment=environment_with_tf2(),
        )

    return start


# /tf and /tf_static


@pytest.mark.slow
@pytest.mark.parametrize("name", ["humanoid", "franka_panda", FLOATING_TURNED_FRAMES])
def test_the_frames_of_the_links_are_where_the_other_engine_has_them(
    simulator: Simulator, client: SimulatorClient, frames: Frames, name: str
) -> None:
    positions = client.listen(topics.DESCRIPTION_JOINT_STATES)
    descriptions = client.listen(topics.ROBOT_DESCRIPTION)
    simulator(character=name, display_rate=240.0)
    whole = character(name)

    state = client.drive(client.first_state(), 40, np.random.default_rng(1))
    stamp = stamp_ns(state)
    client.spin_until(lambda: stamp in frames.moving and frames.static, "frames")
    client.spin_until(lambda: positions.of_stamp(stamp) and descriptions.messages, "description")

    model = DynamicsModel(whole)
    model.update(np.array(state.position), np.array(state.velocity))
    for link, origin, turn in zip(whole.links, *model.link_poses(), strict=True):
        found = frames.in_frame(link.name, "world", stamp)
        np.testing.assert_allclose(found[:3, 3], origin, atol=1e-6)
        np.testing.assert_allclose(found[:3, :3], rotations.matrix(turn), atol=1e-6)
    assert all(len(parents) == 1 for parents in frames.parents.values())  # a tree
    assert not frames.static.keys() & frames.moving[stamp].keys()
    # the description with its joint states gives the same frames, as robot_state_publisher would
    robot = parse(descriptions.last.data)
    assert {link.name for link in robot.links} <= {"base_link", *frames.parents}
    last = positions.of_stamp(stamp)
    expected = link_frames(robot, dict(zip(last.name, last.position, strict=True)))
    for link_name, matrix in expected.items():
        found = frames.in_frame(link_name, "base_link", stamp)
        np.testing.assert_allclose(found, matrix, atol=1e-6)


@pytest.mark.slow
def test_the_tree_is_that_of_rep_105_and_fixed_joints_are_static(
    simulator: Simulator, client: SimulatorClient, frames: Frames
) -> None:
    simulator(character="humanoid")

    stamp = stamp_ns(client.first_state())
    client.spin_until(lambda: stamp in frames.moving and frames.static, "frames")

    assert frames.parents["base_link"] == {"odom"}
    assert frames.parents["odom"] == {"world"}
    assert {"odom", "base", "right_wrist", "left_wrist"} <= frames.static.keys()
    assert {"pelvis_imu", "left_sole", "right_sole"} <= frames.static.keys()  # its sensors
    assert "base_link" in frames.moving[stamp]
    # standing, the base has the world's axes: z up, x forward
    base = frames.in_frame("base_link", "odom", stamp)
    np.testing.assert_allclose(base[:3, :3], np.eye(3), atol=1e-9)


@pytest.mark.slow
def test_a_fixed_base_is_static_and_frames_have_the_names_that_are_given(
    simulator: Simulator, client: SimulatorClient, frames: Frames
) -> None:
    simulator(character="pendulum", odom_frame="world", base_frame="stand")

    stamp = stamp_ns(client.first_state())
    client.spin_until(lambda: stamp in frames.moving and frames.static, "frames")

    root = character("pendulum").links[0].name
    assert frames.parents["stand"] == {"world"}
    assert frames.static.keys() == {"stand", root}
    assert "world" not in frames.parents


@pytest.mark.slow
def test_frames_come_at_the_display_rate(
    simulator: Simulator, client: SimulatorClient, frames: Frames
) -> None:
    simulator(character="pendulum", display_rate=24.0, republish_period=60.0)

    client.drive(client.first_state(), 60, np.random.default_rng(1))
    client.spin_until(lambda: CLOCK.stamp_ns(60) in frames.moving, "the last frames")

    assert frames.moving.keys() <= {CLOCK.stamp_ns(tick) for tick in (1, *range(10, 61, 10))}


def test_frames_of_several_characters_begin_with_their_names(
    simulator: Simulator, join: Join
) -> None:
    left = join("at_left", "left")
    frames = Frames(left.node)
    simulator(
        **{
            "wait_for_subscribers": 0,
            "characters": "[left, right]",
            "left.character": "humanoid",
            "right.character": "pendulum",
            "right.placement": "[2.0, 0.0, 0.0, 0.0]",
        }
    )

    stamp = stamp_ns(left.first_state())
    left.spin_until(lambda: len(frames.moving.get(stamp, ())) == 30, "frames of both")
    left.spin_until(lambda: {"left/odom", "right/odom"} <= frames.static.keys(), "static frames")

    assert all(name.startswith(("left/", "right/")) for name in frames.parents)
    placed = frames.in_frame("right/base_link", "world", stamp)
    np.testing.assert_allclose(placed[:3, 3], (2.0, 0.0, 0.0), atol=1e-9)


def test_who_looks_later_at_a_waiting_simulator_gets_the_frames(
    simulator: Simulator, client: SimulatorClient
) -> None:
    simulator(character="humanoid", republish_period=0.05)
    stamp = stamp_ns(client.first_state())

    frames = Frames(client.node)

    client.spin_until(lambda: stamp in frames.moving and frames.static, "frames")
    # those of the state that waits, and nothing of a tick that has not begun
    assert frames.moving.keys() == {stamp}
    links = {link.name for link in character("humanoid").links}
    assert links <= frames.moving[stamp].keys() | frames.static.keys()
    base = frames.in_frame("base_link", "odom", stamp)
    np.testing.assert_allclose(base[:3, :3], np.eye(3), atol=1e-9)


@pytest.mark.slow
def test_a_bag_has_the_frames_where_their_type_is_installed(
    simulator: Simulator, processes: Processes, tmp_path: Path
) -> None:
    recorder = processes.python(
        *("-m", MODULES[topics.RECORDER_NODE], "--ros-args"),
        *("-p", f"directory:={tmp_path / 'run'}"),
        environment=environment_with_tf2(),
    )
    simulated = simulator(character="pendulum", max_ticks=60, wait_for_subscribers=2)
    processes.controller("pendulum")
    assert simulated.wait() == 0
    recorder.send(signal.SIGINT)
    assert recorder.wait() == 0

    (file,) = (tmp_path / "run").rglob("*.mcap")
    found: dict[str, set[str]] = {"/tf": set(), "/tf_static": set()}
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(topics=list(found)):
            found[channel.topic] |= {each.child_frame_id for each in message.transforms}
    whole = character("pendulum")
    assert found["/tf"] == {link.name for link in whole.links[1:]}
    assert found["/tf_static"] == {"odom", "base_link", whole.links[0].name}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["humanoid", pytest.param("laikago", marks=pytest.mark.slow)])
def test_the_description_and_the_frames_alone_look_like_the_renderers_picture(
    simulator: Simulator, client: SimulatorClient, frames: Frames, name: str
) -> None:
    descriptions = client.listen(topics.ROBOT_DESCRIPTION)
    simulator(character=name, display_rate=240.0)

    state = client.drive(client.first_state(), 60, np.random.default_rng(1))
    stamp, position = stamp_ns(state), np.array(state.position)
    client.spin_until(lambda: stamp in frames.moving and frames.static, "frames")
    client.spin_until(lambda: descriptions.messages, "the description")

    robot = parse(descriptions.last.data)
    placed = {link.name: frames.in_frame(link.name, "world", stamp) for link in robot.links}
    view, size = view_at(position[:3]), (320, 400)
    _, found = draw_description(robot, placed, view, size)
    _, expected = draw_position(name, position, view, size)
    assert np.count_nonzero(expected) > 1000
    _, elsewhere = draw_position(name, np.array(character(name).rest_position), view, size)
    differing, moved = (np.count_nonzero(each != expected) for each in (found, elsewhere))
    # a sphere of the engine's has few corners: its edge differs from the renderer's
    share = np.count_nonzero(expected)
    assert differing < 0.04 * share < 0.1 * moved


# Contact wrenches


def test_the_wrench_on_a_link_is_that_of_its_contacts_in_its_frame(
    processes: Processes, client: SimulatorClient
) -> None:
    wrenches = client.listen(topics.contact_wrench("left_ankle"))
    heads = client.listen(topics.contact_wrench("neck"))
    contacts = client.listen(topics.CONTACTS)
    processes.simulator("humanoid", display_rate=240.0, wait_for_subscribers=1)
    whole = character("humanoid")

    client.drive(client.first_state(), 60, np.random.default_rng(3))
    stamp = CLOCK.stamp_ns(61)
    for inbox in (wrenches, heads, contacts):
        client.spin_until(lambda inbox=inbox: inbox.of_stamp(stamp), "wrenches")

    (row,) = [row for row, link in enumerate(whole.links) if link.name == "left_ankle"]
    model, largest = DynamicsModel(whole), 0.0
    states = client.states.by_tick()
    for message in wrenches.messages:
        state, there = states[tick_of(message)], contacts.of_stamp(stamp_ns(message))
        assert message.header.frame_id == "left_ankle"
        expected = np.zeros(6)
        if there is not None and "left_ankle" in there.joint_names:
            wrench = there.wrench[there.joint_names.index("left_ankle")]
            model.update(np.array(state.position), np.array(state.velocity))
            _, turns = model.link_poses()
            axes = rotations.matrix(turns[row])
            force, torque = (
                np.array([getattr(part, axis) for axis in "xyz"])
                for part in (wrench.force, wrench.torque)
            )
            arm = axes @ np.array(whole.links[row].inertial_pose.position)
            expected = np.concatenate((axes.T @ force, axes.T @ (torque + np.cross(arm, force))))
        elif there is None:  # from before the simulator knew of the listener
            continue
        found = [
            getattr(part, axis)
            for part in (message.wrench.force, message.wrench.torque)
            for axis in "xyz"
        ]
        np.testing.assert_allclose(found, expected, atol=1e-4 * max(np.abs(expected).max(), 1.0))
        largest = max(largest, float(np.abs(expected[:3]).max()))
    assert largest > 50.0
    assert not any(message.wrench.force.x for message in heads.messages)


@pytest.mark.parametrize(
    ("link", "topic"),
    [("left_ankle", "left_ankle"), ("link-1", "link_1"), ("1st", "_1st"), ("Fuß 2", "Fu__2")],
)
def test_a_links_topic_has_a_name_that_a_topic_can_have(link: str, topic: str) -> None:
    name = topics.contact_wrench(link).name

    assert name == f"contact_wrenches/{topic}"
    assert validate_topic_name(name)


# Parameters


def test_a_wrong_frame_is_one_clear_line(processes: Processes, context: Context) -> None:
    for wrong, words in (
        ({"base_frame": "odom"}, "parameter 'base_frame' is 'odom'"),
        ({"odom_frame": "/odom"}, "parameter 'odom_frame' is '/odom'"),
        ({"odom_frame": "chest"}, "a link of character 'humanoid'"),
    ):
        node = processes.simulator("humanoid", **wrong)

        assert node.wait() == 1
        assert words in node.stderr
        assert "Traceback" not in node.stderr


def test_the_configuration_has_the_frames(processes: Processes, client: SimulatorClient) -> None:
    processes.simulator(base_frame="stand")

    client.spin_until(lambda: client.configuration.messages, "configuration")

    parameters = json.loads(client.configuration.last.data)["parameters"]
    assert (parameters["odom_frame"], parameters["base_frame"]) == ("odom", "stand")
