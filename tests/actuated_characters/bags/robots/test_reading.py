"""Bags of other robots: what their joint states and base poses become, by an independent writer."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin

from actuated_characters.bags.robots.reading import RobotRecording, RobotSource, read_any
from msgs_config.errors import ActuatedCharactersError
from tests.support.robot_bags import (
    JOINTS,
    ROLLER,
    Sent,
    at,
    joints,
    odometry,
    stamped_pose,
    text,
    transform,
    write_bag,
)

TIMES = [0.0, 0.013, 0.05, 0.31, 0.32, 1.0]  # s, as irregular as a busy robot's


@pytest.fixture
def robot(tmp_path: Path) -> str:
    file = tmp_path / "roller.urdf"
    file.write_text(ROLLER)
    return str(file)


@pytest.fixture
def read(tmp_path: Path, robot: str) -> Callable[..., RobotRecording]:
    """Writes messages into a bag, and reads them as the roller's."""

    def write_and_read(sent: list[Sent], **source: Any) -> RobotRecording:
        bag = write_bag(tmp_path / "bag", sent)
        (recording,) = read_any(bag, RobotSource(**{"character": robot, **source}))
        assert isinstance(recording, RobotRecording)
        return recording

    return write_and_read


def column(recording: RobotRecording, name: str) -> np.ndarray[Any, Any]:
    return recording.position[:, recording.layout.dof_names.index(name)]


def root(recording: RobotRecording) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Place and rotation vector of the root in each state."""
    return recording.position[:, :3], recording.position[:, 3:6]


def shown(recording: RobotRecording) -> str:
    return "\n".join(recording.remarks)


def still(*seconds: float) -> list[Sent]:
    return [joints(each, JOINTS, [0.1, 0.02, 0.3]) for each in seconds]


# Joint states


@pytest.mark.parametrize("version", [8, 9])
@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_positions_come_at_their_own_irregular_times_by_name(
    storage: StoragePlugin, version: int, tmp_path: Path, robot: str
) -> None:
    swapped = ("wheel", "shoulder", "finger")
    sent = [joints(time, swapped, [time, math.sin(time), 0.05 * time]) for time in TIMES]
    bag = write_bag(tmp_path / "bag", sent, storage, version)

    (recording,) = read_any(bag, RobotSource(robot))

    assert isinstance(recording, RobotRecording)
    assert recording.stamps_ns.tolist() == [at(time) for time in TIMES]
    np.testing.assert_allclose(recording.times, TIMES, atol=1e-9)
    np.testing.assert_array_equal(column(recording, "shoulder"), np.sin(TIMES))
    np.testing.assert_array_equal(column(recording, "finger"), 0.05 * np.array(TIMES))
    np.testing.assert_array_equal(column(recording, "wheel"), TIMES)
    assert np.isnan(recording.velocity).all()
    assert np.isnan(recording.effort).all()
    assert recording.episode_rows.tolist() == [0]


def test_velocities_and_efforts_are_kept_where_they_are_published(
    read: Callable[..., RobotRecording],
) -> None:
    recording = read([joints(t, ["shoulder"], [t], [2.0 * t], [3.0 * t]) for t in TIMES])

    entry = recording.layout.dof_names.index("shoulder")
    np.testing.assert_array_equal(recording.velocity[:, entry], 2.0 * np.array(TIMES))
    np.testing.assert_array_equal(recording.effort[:, entry], 3.0 * np.array(TIMES[1:]))
    assert np.isnan(recording.effort[:, :entry]).all()


def test_messages_with_other_joints_are_merged(read: Callable[..., RobotRecording]) -> None:
    recording = read(
        [
            joints(0.0, ["shoulder"], [0.5]),
            joints(0.1, ["finger", "wheel"], [0.01, 1.0]),
            joints(0.2, ["shoulder"], [0.7]),
            joints(0.3, ["shoulder"], [0.8]),
            joints(0.3, ["finger"], [0.03], late=0.004),  # of the same stamp: the same state
        ]
    )

    np.testing.assert_allclose(recording.times, [0.0, 0.1, 0.2, 0.3], atol=1e-9)
    assert column(recording, "shoulder").tolist() == [0.5, 0.5, 0.7, 0.8]
    assert column(recording, "finger").tolist() == [0.01, 0.01, 0.01, 0.03]
    assert column(recording, "wheel").tolist() == [1.0] * 4


def test_missing_joints_stay_at_rest_and_extra_ones_are_named_in_a_line(
    read: Callable[..., RobotRecording],
) -> None:
    names = ["shoulder", "camera_pan", *(f"led_{number}" for number in range(9))]

    recording = read([joints(t, names, [t] + 10 * [9.0]) for t in TIMES])

    np.testing.assert_array_equal(column(recording, "shoulder"), TIMES)
    assert not column(recording, "wheel").any()
    assert "not joints of roller that move, left out: camera_pan, led_0" in shown(recording)
    assert "led_4 and 4 more" in shown(recording)
    assert "not on '/joint_states', at rest: finger, wheel" in shown(recording)


def test_messages_without_positions_or_with_too_few_are_left_out(
    read: Callable[..., RobotRecording],
) -> None:
    recording = read(
        [
            *still(0.0, 0.1),
            joints(0.2, JOINTS, effort=[1.0, 2.0, 3.0]),
            joints(0.3, JOINTS, [1.0]),
            joints(0.4, JOINTS, [math.nan, 0.05, math.inf]),
        ]
    )

    np.testing.assert_allclose(recording.times, [0.0, 0.1, 0.4], atol=1e-9)
    assert column(recording, "shoulder").tolist() == [0.1] * 3
    assert column(recording, "finger").tolist() == [0.02, 0.02, 0.05]
    assert "1 of 5 messages on '/joint_states' have other numbers of names" in shown(recording)


def test_without_stamps_the_time_of_logging_counts(read: Callable[..., RobotRecording]) -> None:
    sent = [joints(t, JOINTS, [t, 0.0, 0.0], stamp_ns=0, late=0.0) for t in TIMES]
    sent[2] = joints(TIMES[2], JOINTS, [TIMES[2], 0.0, 0.0], late=0.0)  # one that has a stamp

    recording = read(sent)

    np.testing.assert_allclose(recording.times, TIMES, atol=1e-9)
    np.testing.assert_array_equal(column(recording, "shoulder"), TIMES)
    assert "stamps on '/joint_states' are not set" in shown(recording)


def test_stamps_that_begin_again_are_not_mixed(read: Callable[..., RobotRecording]) -> None:
    restarted = [at(0.0), at(2.0), at(4.0), at(0.5), at(2.5)]
    sent = [
        joints(number, JOINTS, [0.1 * number, 0.0, 0.0], stamp_ns=stamp, late=0.0)
        for number, stamp in enumerate(restarted)
    ]

    recording = read(sent)

    assert recording.times.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    np.testing.assert_allclose(column(recording, "shoulder"), [0.0, 0.1, 0.2, 0.3, 0.4])
    assert "stamps on '/joint_states' go back in time" in shown(recording)


def test_messages_that_overtake_each_other_a_little_are_put_in_order(
    read: Callable[..., RobotRecording],
) -> None:
    sent = [joints(0.00, JOINTS, [0.0, 0, 0]), joints(0.02, JOINTS, [0.2, 0, 0], late=0.001)]
    sent.append(joints(0.01, JOINTS, [0.1, 0, 0], late=0.02))

    recording = read(sent)

    assert column(recording, "shoulder").tolist() == [0.0, 0.1, 0.2]


def test_a_wheel_that_is_published_within_a_turn_goes_on(
    read: Callable[..., RobotRecording],
) -> None:
    times, angles = np.linspace(0.0, 2.0, 41), 7.0 * np.linspace(0.0, 2.0, 41)
    wrapped = np.arctan2(np.sin(angles), np.cos(angles))

    recording = read(
        [joints(t, ["wheel"], [angle]) for t, angle in zip(times, wrapped, strict=True)]
    )

    np.testing.assert_allclose(column(recording, "wheel"), angles, atol=1e-9)


def test_a_joint_that_mimics_another_follows_it(tmp_path: Path) -> None:
    mimic = '<mimic joint="shoulder" multiplier="0.05" offset="0.01"/><limit lower="0"'
    file = tmp_path / "roller.urdf"
    file.write_text(ROLLER.replace('<limit lower="0"', mimic))
    bag = write_bag(tmp_path / "bag", [joints(t, ["shoulder", "wheel"], [t, 0]) for t in TIMES])

    (recording,) = read_any(bag, RobotSource(str(file)))

    assert isinstance(recording, RobotRecording)
    if "finger" in recording.layout.dof_names:
        expected = 0.01 + 0.05 * np.array(TIMES)
        np.testing.assert_allclose(column(recording, "finger"), expected, atol=1e-12)
    assert "at rest: finger" not in shown(recording)


# The base


def test_the_base_is_that_of_an_odometry_between_its_messages(
    read: Callable[..., RobotRecording],
) -> None:
    sent = still(0.0, 0.25, 0.5, 1.0, 3.0)
    sent += [odometry(t, "base_link", (2.0 * t, -t, 0.25), 0.8 * t) for t in (0.0, 1.0, 2.0)]

    place, turn = root(read(sent))

    reached = np.array([0.0, 0.25, 0.5, 1.0, 2.0])  # after the last odometry it stays
    # base_link is 0.25 m above the root of the URDF, base_footprint
    np.testing.assert_allclose(place, np.outer(reached, [2.0, -1.0, 0.0]), atol=1e-9)
    np.testing.assert_allclose(turn, np.outer(reached, [0.0, 0.0, 0.8]), atol=1e-9)


def test_the_base_is_that_of_a_chain_of_transforms(read: Callable[..., RobotRecording]) -> None:
    times = (0.0, 0.5, 1.0)
    sent = still(*times)
    sent += [transform(t, "odom", "base_footprint", (t, 0.0, 0.0), 0.4 * t) for t in times]
    sent += [transform(0.0, "map", "odom", (3.0, 1.0, 0.0), 0.5 * math.pi, topic="/tf_static")]
    sent += [transform(t, "base_footprint", "base_link", (0.0, 0.0, 0.25)) for t in times]
    sent += [odometry(t, "base_footprint", (9.0, 9.0, 9.0)) for t in times]

    recording = read(sent)

    place, turn = root(recording)
    # the odometry's x is the map's y, 3 m and 1 m away
    np.testing.assert_allclose(place, [[3.0, 1.0 + t, 0.0] for t in times], atol=1e-9)
    yaws = [[0.0, 0.0, 0.5 * math.pi + 0.4 * t] for t in times]
    np.testing.assert_allclose(turn, yaws, atol=1e-9)
    assert "the base is that of tf, from 'map' to 'base_footprint'" in shown(recording)


def test_the_base_is_that_of_a_topic_of_poses_but_not_of_a_goal(
    read: Callable[..., RobotRecording],
) -> None:
    sent = still(0.0, 1.0)
    sent += [stamped_pose(t, (t, 0.0, 0.1), 0.2) for t in (0.0, 1.0)]
    sent += [stamped_pose(t, (7.0, 7.0, 7.0), topic="/goal_pose") for t in (0.0, 1.0)]

    place, _ = root(read(sent))

    np.testing.assert_allclose(place, [[0.0, 0.0, 0.1], [1.0, 0.0, 0.1]], atol=1e-9)


def test_which_topic_says_where_the_base_is_can_be_named(
    read: Callable[..., RobotRecording],
) -> None:
    sent = still(0.0, 1.0)
    sent += [odometry(t, "base_footprint", (t, 0.0, 0.0)) for t in (0.0, 1.0)]
    sent += [odometry(t, "base_footprint", (0.0, t, 0.0), topic="/truth") for t in (0.0, 1.0)]

    recording = read(sent, base="/truth")

    np.testing.assert_allclose(root(recording)[0][-1], [0.0, 1.0, 0.0], atol=1e-9)


def test_without_a_word_of_the_base_or_with_none_it_rests(
    read: Callable[..., RobotRecording],
) -> None:
    sent = [*still(0.0, 1.0), odometry(0.5, "base_link", (5.0, 5.0, 5.0))]

    recording = read(sent, base="none")

    rest = np.array(recording.character.rest_position)
    np.testing.assert_array_equal(recording.position[:, :6], np.tile(rest[:6], (2, 1)))
    assert "nothing says where the base is" in shown(recording)


def test_an_odometry_of_another_clock_is_placed_by_the_time_of_logging(
    read: Callable[..., RobotRecording],
) -> None:
    sent = still(0.0, 0.5, 1.0)
    sent += [
        odometry(t, "base_footprint", (t, 0.0, 0.0), stamp_ns=round(1e9 * (40.0 + t)))
        for t in (0.0, 0.5, 1.0)
    ]

    place, _ = root(read(sent))

    # logged 2 ms and 1 ms late: the joint states of 0.5 s are logged 1 ms after the odometry's
    np.testing.assert_allclose(place[:, 0], [0.001, 0.501, 1.0], atol=1e-9)


def test_of_two_robots_each_has_its_own_frames_and_topics(
    read: Callable[..., RobotRecording],
) -> None:
    sent = []
    for side, y in (("left", 1.0), ("right", -1.0)):
        topic = f"/{side}/joint_states"
        sent += [joints(t, ["shoulder"], [y * t], topic=topic) for t in (0.0, 1.0)]
        sent += [transform(t, "map", f"{side}/base_footprint", (t, y, 0.0)) for t in (0.0, 1.0)]

    recording = read(sent, topic="right/joint_states")

    assert column(recording, "shoulder").tolist() == [0.0, -1.0]
    np.testing.assert_allclose(root(recording)[0], [[0, -1, 0], [1, -1, 0]], atol=1e-9)


def test_a_robot_without_masses_moves_with_its_odometry(tmp_path: Path) -> None:
    base = ROLLER[ROLLER.index('<link name="base_link">') : ROLLER.index("<visual>")]
    file = tmp_path / "light.urdf"
    file.write_text(ROLLER.replace(base, '<link name="base_link">'))
    sent = [*still(0.0, 1.0), *(odometry(t, "base_link", (t, 0.0, 0.25)) for t in (0.0, 1.0))]

    (recording,) = read_any(write_bag(tmp_path / "bag", sent), RobotSource(str(file)))

    assert isinstance(recording, RobotRecording)
    np.testing.assert_allclose(root(recording)[0], [[0, 0, 0], [1, 0, 0]], atol=1e-9)


# Whose it is


def test_a_bag_with_a_robot_description_needs_no_character(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", [text("/robot_description", ROLLER), *still(0.0, 1.0)])

    (recording,) = read_any(bag, RobotSource())

    assert recording.character.name == "roller"
    assert recording.position[0, recording.layout.dof_names.index("finger")] == 0.02


def test_a_mesh_that_is_not_here_is_left_out_with_a_line(tmp_path: Path) -> None:
    mesh = '<mesh filename="package://not_here/box.stl"/>'
    described = ROLLER.replace('<box size="0.6 0.4 0.2"/>', mesh)
    described = described.replace('<box size="0.6 0.4 0.5"/>', mesh)
    bag = write_bag(tmp_path / "bag", [text("/robot_description", described), *still(0.0, 1.0)])

    (recording,) = read_any(bag, RobotSource())

    assert isinstance(recording, RobotRecording)
    assert "package://not_here/box.stl" in shown(recording)


def test_the_only_topic_of_joint_states_needs_no_name(
    read: Callable[..., RobotRecording],
) -> None:
    recording = read([joints(t, ["shoulder"], [t], topic="/arm/states") for t in TIMES])

    assert recording.topic == "/arm/states"


@pytest.mark.parametrize(
    ("sent", "source", "sentence"),
    [
        (still(0.0), {"character": None}, r"give the robot by --character ROBOT.urdf"),
        (
            [*still(0.0), odometry(0.0, "base_link", (0, 0, 0))],
            {"topic": "/odom"},
            "--topic /odom: it is a nav_msgs/msg/Odometry; it must be a sensor_msgs/msg/JointSt",
        ),
        (still(0.0), {"topic": "/joint_state"}, "did you mean '/joint_states'"),
        (
            [joints(0.0, JOINTS, [0, 0, 0], topic=f"/{side}/joints") for side in ("a", "b")],
            {},
            "name one by --topic: /a/joints, /b/joints",
        ),
        (
            [odometry(0.0, "base_link", (0, 0, 0))],
            {},
            "has no joint states: no topic is a sensor_msgs/msg/JointState; its topics: /odom",
        ),
        (
            [joints(0.0, ["hip", "knee"], [0, 0])],
            {},
            "has none of the joints of roller; it has hip, knee, and the character shoulder, fin",
        ),
        ([joints(0.0, JOINTS, effort=[1, 2, 3])], {}, "no message on '/joint_states' has the pos"),
        (still(0.0), {"base": "/odom"}, "unknown topic of --base '/odom'; there are: none"),
        (
            [*still(0.0), text("/chatter", "x")],
            {"base": "/chatter"},
            "--base /chatter: it is a std_msgs/msg/String; it must be one of tf2_msgs/msg/TFMessa",
        ),
    ],
)
def test_what_cannot_be_read_is_one_line_that_says_what_to_give(
    sent: list[Sent], source: dict[str, Any], sentence: str, read: Callable[..., RobotRecording]
) -> None:
    with pytest.raises(ActuatedCharactersError) as caught:
        read(sent, **source)

    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)
