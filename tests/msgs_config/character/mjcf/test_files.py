"""Where an MJCF may stand: alone, under a character's file, in a recording; and what is refused."""

from pathlib import Path

import numpy as np
import pytest

import actuated_characters as ac
from msgs_config.character.file import read_character_file, read_character_texts
from msgs_config.character.loading import build_character, load_character
from msgs_config.errors import CharacterError
from tests.support.mjcf import FILES, arm, torso, write_mjcf

ARM = FILES["several joints on one body"]


def test_a_characters_file_names_one_and_its_own_keys_count(tmp_path: Path) -> None:
    servos = '<actuator><position joint="x" kp="5" kv="1"/><motor joint="y" gear="3"/></actuator>'
    write_mjcf(tmp_path, ARM, servos)
    file = tmp_path / "character.yaml"
    file.write_text(
        "urdf: robot.xml\njoints: {x: {stiffness: 9, effort_limit: 2}, z: {lower: -1, upper: 1}}\n"
    )

    character = load_character(file)

    joints = {joint.name: joint for joint in character.moving_joints}
    assert character.gains["x"] == ac.load_character(file).gains["x"]
    assert (character.gains["x"].stiffness, character.gains["x"].damping) == (9.0, 1.0)
    assert joints["x"].effort_limit == 2.0
    assert (joints["z"].lower, joints["z"].upper) == (-1.0, 1.0)
    assert character.gains["y"].stiffness == 0.0  # no automatic gains: the file asks for none


@pytest.mark.parametrize("bodies", FILES.values(), ids=FILES)
def test_its_texts_are_all_that_a_recording_needs(tmp_path: Path, bodies: str) -> None:
    sensors = '<site name="s"/><geom size="0.1"/>'
    rest = '<sensor><gyro site="s"/></sensor>'
    path = write_mjcf(tmp_path, bodies.replace("</body>", f"{sensors}</body>", 1), rest)
    file = read_character_file(str(path))
    character = build_character(file)
    path.unlink()

    again = build_character(
        read_character_texts(path, file.text, file.loading.urdf_path, file.loading.urdf_text)
    )

    assert again.links == character.links
    assert again.gains == character.gains
    assert again.sensors == character.sensors
    assert again.rest_position == character.rest_position


def test_other_robots_of_ros_see_it_as_a_urdf(tmp_path: Path) -> None:
    from msgs_config.character.urdf.robot_description import robot_description

    text = robot_description(load_character(write_mjcf(tmp_path, torso(ARM))))

    assert text.startswith("<robot")
    for name in ("torso", "arm_x", "arm"):
        assert f'<link name="{name}"' in text


def test_lines_of_what_is_left_out_need_not_be_said(tmp_path: Path) -> None:
    write_mjcf(tmp_path, ARM, '<option timestep="0.01"/>')
    file = tmp_path / "character.yaml"

    file.write_text("urdf: robot.xml\n")
    assert any("left out: <option>" in line for line in load_character(file).warnings)
    file.write_text("urdf: robot.xml\nleft_out: [option]\n")
    assert not any("<option>" in line for line in load_character(file).warnings)


LOST = {
    "<tendon> (1): t": '<tendon><fixed name="t"><joint joint="h" coef="1"/></fixed></tendon>',
    "<exclude> (1): e": '<contact><exclude name="e" body1="arm" body2="hand"/></contact>',
    "<pair> (1)": '<contact><pair geom1="g" geom2="p"/></contact>',
    "<texture> (1): sky": '<asset><texture name="sky" builtin="flat" width="8" height="8" '
    'type="2d"/></asset>',
    "<key> (1): k": '<keyframe><key name="k"/></keyframe>',
    "<numeric> (1): n": '<custom><numeric name="n" data="1"/></custom>',
    "<visual>": "<visual><global/></visual>",
    "<hfield> (1): f": '<asset><hfield name="f" nrow="2" ncol="2" size="1 1 1 1"/></asset>',
    "gravity, integrator": '<option gravity="0 0 -1" integrator="RK4"/>',
}


@pytest.mark.parametrize(("line", "element"), LOST.items(), ids=LOST)
def test_what_no_character_has_is_said(tmp_path: Path, line: str, element: str) -> None:
    hand = '<body name="hand" pos="0 0 1"><joint/><geom name="p" size="0.1"/></body>'
    bodies = arm('<joint name="h"/>', '<geom name="g" size="0.1"/>', hand)

    character = load_character(write_mjcf(tmp_path, bodies, element))

    assert any(each.startswith("left out") and line in each for each in character.warnings)


JOINTS = {
    "stiffness (1): h": ('<joint name="h" stiffness="2"/>', ""),
    "solreffriction and solimpfriction (1): h": (
        '<joint name="h" frictionloss="1" solreffriction="0.1 1"/>',
        "",
    ),
    "range of a ball joint (1): b": ('<joint name="b" type="ball" range="0 1"/>', ""),
    "gravcomp (1): arm": ('<joint name="h"/>', 'gravcomp="1"'),
    "contact parameters of geoms": ('<joint name="h"/><geom size="1" friction="0.1"/>', ""),
}


@pytest.mark.parametrize(("line", "given"), JOINTS.items(), ids=JOINTS)
def test_what_joints_and_bodies_do_not_have_is_said(
    tmp_path: Path, line: str, given: tuple[str, str]
) -> None:
    joint, attribute = given
    bodies = arm(joint).replace("<body ", f"<body {attribute} ")

    character = load_character(write_mjcf(tmp_path, bodies))

    assert any(line in each for each in character.warnings)


BAD = {
    "an unknown element": ("<mujoco><robot/></mujoco>", "not usable by MuJoCo: XML Error"),
    "no joint": ("<mujoco><worldbody/></mujoco>", "no body has a joint"),
    "no mass": (
        '<mujoco><worldbody><body name="b"><joint/></body></worldbody></mujoco>',
        "not usable by MuJoCo: Error: mass and inertia of moving bodies must be larger",
    ),
    "an include that is missing": (
        '<mujoco><include file="gone.xml"/></mujoco>',
        "not usable by MuJoCo: XML Error: Error opening file",
    ),
    "half of a file": ("<mujoco><worldbody>", "not usable by MuJoCo: XML"),
}


@pytest.mark.parametrize(("text", "reason"), BAD.values(), ids=BAD)
def test_a_bad_file_is_refused_in_a_line_and_leaves_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, reason: str
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "robot.xml"
    path.write_text(text)

    with pytest.raises(CharacterError) as refused:
        load_character(path)

    line = str(refused.value)
    assert line.startswith(f"{path}: {reason}")
    assert "\n" not in line
    assert list(tmp_path.iterdir()) == [path]


def test_a_part_of_a_scene_is_read_without_what_names_the_rest(tmp_path: Path) -> None:
    rest = '<contact><pair geom1="floor" geom2="g"/></contact>'
    path = write_mjcf(tmp_path, arm('<joint name="h"/>', '<geom name="g" size="0.1"/>'), rest)

    character = load_character(path)

    assert any("all <sensor>, <pair> and <exclude>" in line for line in character.warnings)
    assert np.isfinite(character.mass)
