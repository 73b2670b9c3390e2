"""A character that was written as MJCF is, for MuJoCo alone, what it was."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.mjcf.writing import write_mjcf
from msgs_config.character.model import Character
from tests.support.mjcf import FILES, GRAVITY, Original
from tests.support.mjcf import write_mjcf as write_file
from tests.support.physics import EVERY_CHARACTER, character_id


def written(folder: Path, character: Character, *, servos: bool = False) -> Path:
    """The character's MJCF in a folder."""
    path = folder / "written.xml"
    path.write_text(write_mjcf(character, servos=servos).text)
    return path


def check_mechanics(original: Original, character: Character) -> None:
    model = DynamicsModel(character, GRAVITY)
    rng = np.random.default_rng(2)
    for _ in range(5):
        position, velocity = original.random_state(rng)
        model.update(position, velocity)
        mass_matrix, bias = original.mass_matrix(), original.bias()
        size = np.abs(mass_matrix).max()
        np.testing.assert_allclose(model.mass_matrix(), mass_matrix, rtol=0, atol=1e-11 * size)
        own = model.bias_force() - character.passive_damping() * velocity
        np.testing.assert_allclose(own, bias, rtol=0, atol=1e-11 * np.abs(bias).max())


@pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
def test_mass_matrix_and_bias_are_the_characters(tmp_path: Path, name: str) -> None:
    character = load_character(name)

    check_mechanics(Original(written(tmp_path, character), character), character)


@pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
def test_it_is_read_again_as_it_was(tmp_path: Path, name: str) -> None:
    character = load_character(name)
    path = written(tmp_path, character)

    again = load_character(path)

    assert again.layout.dof_names == character.layout.dof_names
    assert again.leaders == character.leaders
    assert again.mass == pytest.approx(character.mass, rel=1e-12)
    check_mechanics(Original(path, again), again)
    joints = {joint.name: joint for joint in again.moving_joints}
    for joint in character.moving_joints[character.layout.has_floating_base :]:
        own = joints[joint.name]
        assert (own.lower, own.upper) == pytest.approx((joint.lower, joint.upper))
        assert (own.damping, own.friction) == (joint.damping, joint.friction)
    np.testing.assert_allclose(again.rest_position[7:], character.rest_position[7:], atol=1e-12)


@pytest.mark.parametrize("bodies", FILES.values(), ids=FILES)
def test_so_is_one_that_was_an_mjcf(tmp_path: Path, bodies: str) -> None:
    character = load_character(write_file(tmp_path, bodies))

    check_mechanics(Original(written(tmp_path, character), character), character)


def test_servos_have_the_gains_and_motors_the_limits(tmp_path: Path) -> None:
    character = load_character("laikago")
    name = character.layout.actuated_joint_names[0]
    limited = [
        replace(link, joint=replace(link.joint, effort_limit=7.0))
        if link.joint.name == name
        else link
        for link in character.links
    ]
    character = replace(character, links=tuple(limited))

    motors = mujoco.MjModel.from_xml_path(str(written(tmp_path, character)))
    servos = mujoco.MjModel.from_xml_path(str(written(tmp_path, character, servos=True)))

    np.testing.assert_allclose(motors.actuator(name).ctrlrange, (-7.0, 7.0))
    gains = character.gains[name]
    assert servos.actuator(name).gainprm[0] == gains.stiffness
    np.testing.assert_allclose(
        servos.actuator(name).biasprm[:3], (0.0, -gains.stiffness, -gains.damping)
    )
    np.testing.assert_allclose(servos.actuator(name).forcerange, (-7.0, 7.0))


def test_it_stands_on_its_floor_and_its_links_do_not_meet(tmp_path: Path) -> None:
    character = load_character(write_file(tmp_path, FILES["free, with limbs"]))
    model = mujoco.MjModel.from_xml_path(str(written(tmp_path, character)))
    data = mujoco.MjData(model)

    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[2] -= 1e-3
    mujoco.mj_forward(model, data)

    assert data.ncon > 0
    assert {model.geom(int(pair[0])).name for pair in data.contact.geom} == {"floor"}
    assert data.contact.dist.min() == pytest.approx(-1e-3, abs=1e-4)
