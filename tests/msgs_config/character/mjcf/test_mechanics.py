"""A character that was read from an MJCF moves as MuJoCo's own model of the file does.

MuJoCo compiles the file again, by itself; its mass matrix, bias and masses are those to be met.
"""

from pathlib import Path

import numpy as np
import pytest

from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from tests.support.mjcf import BALL, FILES, GRAVITY, ROD, SEVERAL, Original, arm, torso, write_mjcf


@pytest.mark.parametrize("bodies", FILES.values(), ids=FILES)
def test_mass_matrix_and_bias_are_those_of_mujoco(tmp_path: Path, bodies: str) -> None:
    path = write_mjcf(tmp_path, bodies)
    character = load_character(path)
    original, model = Original(path, character), DynamicsModel(character, GRAVITY)
    rng = np.random.default_rng(0)

    for _ in range(20):
        position, velocity = original.random_state(rng)
        model.update(position, velocity)
        mass_matrix, bias = original.mass_matrix(), original.bias()

        damping = character.passive_damping() * velocity
        scale = np.abs(mass_matrix).max()
        np.testing.assert_allclose(model.mass_matrix(), mass_matrix, rtol=0, atol=1e-12 * scale)
        scale = np.abs(bias).max()
        np.testing.assert_allclose(model.bias_force() - damping, bias, rtol=0, atol=1e-12 * scale)


@pytest.mark.parametrize("bodies", FILES.values(), ids=FILES)
def test_each_body_has_its_mass_moments_and_place(tmp_path: Path, bodies: str) -> None:
    path = write_mjcf(tmp_path, bodies)
    character = load_character(path)
    original, model = Original(path, character), DynamicsModel(character, GRAVITY)
    position, velocity = original.random_state(np.random.default_rng(1))
    model.update(position, velocity)

    heavy = [index for index, link in enumerate(character.links) if link.mass]

    assert heavy
    for index in heavy:
        link, body = character.links[index], original.model.body(character.links[index].name)
        assert link.mass == body.mass[0]
        np.testing.assert_allclose(link.inertia_diagonal, body.inertia, rtol=1e-12)
        place, _ = original.body_place(link.name)
        origins, axes = model.link_frames(np.array([index]))
        centre = origins[0] + axes[0] @ np.array(link.inertial_pose.position)
        np.testing.assert_allclose(centre, place, atol=1e-12)


def test_the_world_is_what_a_fixed_one_hangs_on(tmp_path: Path) -> None:
    character = load_character(write_mjcf(tmp_path, arm(SEVERAL)))

    assert character.links[0].name == "world"
    assert not character.layout.has_floating_base
    assert [link.name for link in character.links[1:]] == ["arm_x", "arm_y", "arm_s", "arm"]
    assert [link.mass > 0.0 for link in character.links] == [False, False, False, False, True]


def test_ranges_damping_and_friction_are_the_joints_own(tmp_path: Path) -> None:
    joint = '<joint name="h" range="-0.5 1" damping="0.3" frictionloss="0.2"/>'
    balls = f'<body name="b"><joint name="b" type="ball" damping="0.4"/>{BALL}</body>'
    character = load_character(write_mjcf(tmp_path, arm(joint, more=balls)))

    hinge, ball = character.moving_joints

    assert (hinge.lower, hinge.upper) == (-0.5, 1.0)
    assert (hinge.damping, hinge.friction) == (0.3, 0.2)
    assert ball.damping == 0.4


def test_defaults_classes_degrees_and_includes_count(tmp_path: Path) -> None:
    (tmp_path / "hand.xml").write_text(
        '<mujocoinclude><body name="hand" pos="0 0 -0.5" childclass="light"><joint name="w"/>'
        '<geom type="sphere" size="0.02"/></body></mujocoinclude>'
    )
    (tmp_path / "robot.xml").write_text(
        '<mujoco><compiler angle="degree"/><default><joint axis="0 1 0" damping="0.5"/>'
        '<default class="light"><joint damping="0.1" range="-90 45"/></default></default>'
        f'<worldbody><body name="arm"><joint name="h"/>{ROD}<include file="hand.xml"/></body>'
        "</worldbody></mujoco>"
    )

    character = load_character(tmp_path / "robot.xml")

    shoulder, wrist = character.moving_joints
    assert (shoulder.damping, wrist.damping) == (0.5, 0.1)
    assert (wrist.lower, wrist.upper) == pytest.approx((-np.pi / 2, np.pi / 4))
    np.testing.assert_allclose(wrist.axis_in_child, (0.0, 1.0, 0.0), atol=1e-15)


def test_the_rest_pose_is_the_files_own_or_the_key_home(tmp_path: Path) -> None:
    joints = '<joint name="s" type="slide" ref="0.2" range="0 1"/><joint name="h"/>'
    key = '<keyframe><key name="other" qpos="0.3 0.1"/><key name="home" qpos="0.4 0.5"/></keyframe>'

    plain = load_character(write_mjcf(tmp_path, arm(joints)))
    home = load_character(write_mjcf(tmp_path, arm(joints), key))

    assert plain.rest_position == (0.2, 0.0)
    assert home.rest_position == (0.4, 0.5)
    assert "left out: <key> (1): other" in home.warnings


def test_a_floating_base_is_turned_as_in_the_file_and_stands_on_the_ground(tmp_path: Path) -> None:
    character = load_character(write_mjcf(tmp_path, torso("")))

    np.testing.assert_allclose(character.rest_position, (0.0, 0.0, 0.1, 0.2, 0.0, 0.0), atol=1e-12)
