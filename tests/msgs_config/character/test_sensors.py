"""The sensors in a character's file: what they become, and one clear line for each mistake."""

import math
from pathlib import Path

import numpy as np
import pytest

from msgs_config.character.loading import load_character
from msgs_config.character.sensors import Noise, Sensor, SensorType
from msgs_config.character.urdf.described_joints import DescribedJoints
from msgs_config.character.urdf.robot_description import robot_description
from msgs_config.errors import ConfigurationError
from msgs_config.geometry import rotations, scalars
from sim_node import parameters as for_simulator
from tests.support.description import link_frames, parse
from tests.support.urdf import inertial, joint, link, refusal, robot, write_character

SHAPE = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
ROBOT = robot(link("base"), link("foot", inertial() + SHAPE), joint("ankle", "base", "foot"))


def sensors(imu: str = "", force: str = "") -> str:
    """A character's sensors, each a line in YAML."""
    return f"sensors: {{imu: {{{imu}}}, force: {{{force}}}}}\n"


def test_a_sensor_has_a_link_a_pose_and_noise_per_axis(tmp_path: Path) -> None:
    text = """
sensors:
  imu:
    bare: {link: base}
    placed:
      link: foot
      xyz: [1, 2, 3]
      rpy: [0.1, 0.2, 0.3]
      noise:
        angular_velocity: {stddev: 0.5, bias: [-1, 0, 1], bias_stddev: 2, bias_walk: [0, 0, 3]}
        linear_acceleration: {stddev: 0}
  force:
    sole: {link: foot}
"""

    bare, placed, sole = load_character(str(write_character(tmp_path, ROBOT, text))).sensors

    assert bare == Sensor("bare", SensorType.IMU, "base")
    assert sole == Sensor("sole", SensorType.FORCE, "foot")
    assert (placed.name, placed.link, placed.position) == ("placed", "foot", (1.0, 2.0, 3.0))
    turns = [rotations.exp(np.array(v)) for v in ((0, 0, 0.3), (0, 0.2, 0), (0.1, 0, 0))]
    expected = rotations.multiply(rotations.multiply(turns[0], turns[1]), turns[2])
    assert placed.orientation_xyzw == pytest.approx(expected, abs=1e-15)
    assert placed.noise == {
        "angular_velocity": Noise((0.5,) * 3, (-1.0, 0.0, 1.0), (2.0,) * 3, (0.0, 0.0, 3.0))
    }


def test_the_frames_of_the_humanoids_sensors_have_x_forward_and_z_up_as_it_stands() -> None:
    whole = load_character("humanoid")
    positions = dict.fromkeys([j.name for j in DescribedJoints(whole).moving], 0.0)

    placed = link_frames(parse(robot_description(whole)), positions)

    assert {each.name for each in whole.sensors} == {"pelvis_imu", "left_sole", "right_sole"}
    for sensor in whole.sensors:
        assert placed[sensor.name][:3, :3] == pytest.approx(np.eye(3), abs=1e-12)
        assert not sensor.noise
    heights = [placed[f"{side}_sole"][2, 3] for side in ("left", "right")]
    stands_at = dict(zip(whole.layout.dof_names, whole.rest_position, strict=True))["root_z"]
    assert heights == pytest.approx([-stands_at] * 2, abs=0.002)  # on the ground


@pytest.mark.parametrize("is_legal", [True, False])
def test_a_sensor_is_a_link_of_the_description(tmp_path: Path, is_legal: bool) -> None:
    text = sensors(imu="imu: {link: foot, xyz: [1, 2, 3], rpy: [0.1, 0.2, 0.3]}")
    whole = load_character(
        str(write_character(tmp_path, ROBOT, text + ("" if is_legal else "scale: 0.5\n")))
    )

    description = parse(robot_description(whole))

    found = description.joint_map["imu_joint"]
    assert (found.type, found.parent, found.child) == ("fixed", "foot", "imu")
    assert found.origin.xyz == pytest.approx([1.0, 2.0, 3.0])  # as given, not scaled
    assert found.origin.rpy == pytest.approx([0.1, 0.2, 0.3])
    assert description.link_map["imu"].inertial is None


WRONG = {
    "an unknown type": ("sensors: {gps: {a: {link: base}}}", ["sensors.gps", "imu, force"]),
    "a list": ("sensors: [imu]", ["sensors", "mapping"]),
    "a list of sensors": ("sensors: {imu: [{link: base}]}", ["sensors.imu", "mapping"]),
    "no link": (sensors("a: {}"), ["sensors.imu.a.link", "text"]),
    "an unknown link": (
        sensors("a: {link: foo}"),
        ["sensors.imu.a.link", "'foo'", "did you mean 'foot'?", "base, foot"],
    ),
    "an unknown key": (sensors("a: {link: base, xyx: 1}"), ["sensors.imu.a.xyx", "'xyz'"]),
    "a wrong place": (sensors("a: {link: base, xyz: [1, 2]}"), ["sensors.imu.a.xyz", "3 finite"]),
    "a wrong turn": (sensors("a: {link: base, rpy: 1}"), ["sensors.imu.a.rpy", "3 finite"]),
    "a turn in degrees": (
        sensors("a: {link: base, rpy: [-90, 0, 0]}"),
        ["sensors.imu.a.rpy", "from -6.28319 to 6.28319"],
    ),
    "a place beyond all numbers": (
        sensors("a: {link: base, xyz: [1e300, 0, 0]}"),
        ["sensors.imu.a.xyz", "from -1000 to 1000"],
    ),
    "noise beyond all numbers": (
        sensors("a: {link: base, noise: {orientation: {stddev: 1e300}}}"),
        ["noise.orientation.stddev", "from 0 to 1e+09"],
    ),
    "a name that no topic has": (
        sensors("'le ft': {link: base}"),
        ["sensors.imu.le ft", "letters, digits and underscores"],
    ),
    "a name that is a link's": (sensors("foot: {link: base}"), ["sensors.imu.foot", "'foot'"]),
    "the name of the world": (sensors("world: {link: base}"), ["sensors.imu.world"]),
    "a name of two": (
        sensors("a: {link: base}", "a: {link: foot}"),
        ["sensors.force.a", "'a'", "other sensors"],
    ),
    "a force sensor that nothing touches": (
        sensors("", "a: {link: base}"),
        ["sensors.force.a.link", "'base'", "no collision shape", "foot"],
    ),
    "noise of another type": (
        sensors("a: {link: base, noise: {force: {stddev: 1}}}"),
        ["sensors.imu.a.noise.force", "orientation, angular_velocity, linear_acceleration"],
    ),
    "unknown noise": (
        sensors("a: {link: base, noise: {orientation: {std: 1}}}"),
        ["noise.orientation.std", "did you mean 'stddev'?"],
    ),
    "noise that is a number": (
        sensors("a: {link: base, noise: {orientation: 1}}"),
        ["noise.orientation", "mapping"],
    ),
    "a negative deviation": (
        sensors("a: {link: base, noise: {orientation: {stddev: -1}}}"),
        ["noise.orientation.stddev", "-1", "from 0 to 1e+09"],
    ),
    "a negative deviation of an axis": (
        sensors("a: {link: base, noise: {orientation: {bias_walk: [0, -1, 0]}}}"),
        ["noise.orientation.bias_walk", "3 finite numbers"],
    ),
    "a deviation that is no number": (
        sensors("a: {link: base, noise: {orientation: {stddev: .nan}}}"),
        ["noise.orientation.stddev", "nan"],
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_sensor_is_refused_with_what_would_be_right(tmp_path: Path, case: str) -> None:
    text, words = WRONG[case]

    line = refusal(write_character(tmp_path, ROBOT, text))

    for word in ["robot.yaml", *words]:
        assert word in line


@pytest.mark.parametrize("parameter", ["odom_frame", "base_frame"])
def test_a_sensor_cannot_be_the_frame_of_the_base_or_of_odom(parameter: str) -> None:
    with pytest.raises(ConfigurationError, match=f"'{parameter}' is 'pelvis_imu'.* a sensor"):
        for_simulator.load_parameters({"character": "humanoid", parameter: "pelvis_imu"})


def test_urdfs_angles_are_those_of_the_description() -> None:
    for roll, pitch, yaw in np.random.default_rng(1).uniform(-1.5, 1.5, (20, 3)):
        turn = np.array(scalars.of_roll_pitch_yaw((roll, pitch, yaw)))
        assert rotations.yaw_pitch_roll(rotations.matrix(turn)) == pytest.approx((yaw, pitch, roll))
        assert math.isclose(float(turn @ turn), 1.0)
