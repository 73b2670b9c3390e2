"""Robots as targets: segments by many makers' names, crossing hinges, and a clip that is played."""

from pathlib import Path

import numpy as np
import pytest

from actuated_characters.cli import main
from character_motion.clips.importing import import_bvh
from character_motion.clips.motion_clip import read_motion_clip
from character_motion.retargeting.optimisation.joint_angles import joint_angles
from character_motion.retargeting.target_body import TargetBody
from msgs_config.character.dynamics import still_model
from msgs_config.character.loading import load_character
from msgs_config.errors import ClipError
from msgs_config.geometry import rotations
from tests.support.capture_makers import MAKERS
from tests.support.captures import capture
from tests.support.hinged_humanoid import NAMINGS, Naming, ros, write_robot


@pytest.mark.parametrize("naming", NAMINGS)
def test_segments_are_found_by_any_naming(tmp_path: Path, naming: Naming) -> None:
    whole = load_character(str(write_robot(tmp_path / "robot.urdf", naming)))

    target = TargetBody(whole)

    wanted = {
        "hip": ("hip_yaw", 3), "knee": ("knee", 4), "ankle": ("ankle_roll", 6),
        "shoulder": ("shoulder_yaw", 3), "elbow": ("elbow", 4),
    }  # fmt: skip
    for side in ("left", "right"):
        for part, (joint, number) in wanted.items():
            link = whole.links[target.map[f"{side}_{part}"]].name
            assert link == f"{naming(side, joint, number)}_link"
    assert whole.links[target.map["pelvis"]].name == "pelvis"
    assert whole.links[target.map["chest"]].name == "torso"
    # the axes of the hip's hinges cross where its roll is: 0.1 m beside the middle, 0.07 m down
    hips = [target.origin(f"{side}_hip") for side in ("left", "right")]
    np.testing.assert_allclose(hips[0] - hips[1], (0.0, 0.2, 0.0), atol=1e-9)


def test_hinges_that_cross_share_a_turn(tmp_path: Path) -> None:
    whole = load_character(str(write_robot(tmp_path / "robot.urdf")))
    target, layout = TargetBody(whole), whole.layout
    rng = np.random.default_rng(2)
    wanted = np.zeros((20, layout.size))
    for name in ("hip_pitch", "hip_roll", "hip_yaw"):
        wanted[:, layout.joint(f"left_{name}_joint").start] = rng.uniform(-0.8, 0.8, 20)
    link = target.map["left_hip"]
    turns = np.array([still_model(whole, position).link_poses()[1][link] for position in wanted])
    base = np.zeros((20, 3)), np.tile(rotations.IDENTITY_XYZW, (20, 1))

    found = joint_angles(whole, base, {link: turns})

    np.testing.assert_allclose(found.position[:, 6:], wanted[:, 6:], atol=1e-3)


def test_a_robot_walks_as_the_capture_does(tmp_path: Path) -> None:
    target = TargetBody(load_character(str(write_robot(tmp_path / "robot.urdf"))))

    made = import_bvh(capture(tmp_path / "walk.bvh", MAKERS["lafan"]), target)

    assert made.worst_mean_rad < 0.15
    assert made.quality.feet_in_ground_m < 0.01 and made.quality.overlap_m == 0.0
    assert made.quality.skating_mean_m_s is not None and made.quality.skating_mean_m_s < 0.02
    ahead = made.clip.motion.position[-1, 0] - made.clip.motion.position[0, 0]
    assert ahead > 0.4


def test_a_robot_without_arms_shows_the_legs_alone(tmp_path: Path) -> None:
    target = TargetBody(load_character(str(write_robot(tmp_path / "robot.urdf", arms=False))))

    made = import_bvh(capture(tmp_path / "walk.bvh", MAKERS["lafan"]), target)

    assert made.worst_mean_rad < 0.15 and not any("elbow" in role for role in target.map.joints)


def test_links_of_odd_names_are_told_by_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot, file = write_robot(tmp_path / "robot.urdf"), capture(tmp_path / "a.bvh", MAKERS["lafan"])
    robot.write_text(robot.read_text().replace("left_knee", "pillar"))
    file.write_text(file.read_text().replace("LeftLeg", "Column"))
    names = tmp_path / "map.yaml"
    names.write_text("source: {left_knee: Column}\ntarget: {left_knee: pillar_joint}\n")
    output = tmp_path / "a.json"
    words = f"motion import {file} --character {robot} --output {output} --no-picture"

    assert main(words.split()) == 1
    assert "character 'robot': no joint found for left_knee" in capsys.readouterr().err
    assert main([*words.split(), "--map", str(names)]) == 0

    assert f"--character {robot}" in " ".join(capsys.readouterr().out.split())
    clip = read_motion_clip(load_character(str(robot)), str(output))
    assert clip.source["joints"]["left_knee"] == "Column"


def test_a_name_that_is_no_link_is_said(tmp_path: Path) -> None:
    whole = load_character(str(write_robot(tmp_path / "robot.urdf", ros)))

    with pytest.raises(ClipError, match="map: unknown link or joint 'left_knie'; did you mean"):
        TargetBody(whole, {"left_knee": "left_knie"})


@pytest.mark.slow
def test_the_clip_of_a_robot_is_run(tmp_path: Path) -> None:
    robot, file = write_robot(tmp_path / "robot.urdf"), capture(tmp_path / "a.bvh", MAKERS["lafan"])
    output, run = tmp_path / "a.json", tmp_path / "run"
    assert main(f"motion import {file} --character {robot} --output {output}".split()) == 0

    words = f"run --clip {output} --character {robot} --duration 0.5 --composed --output {run}"
    assert main(words.split()) == 0
