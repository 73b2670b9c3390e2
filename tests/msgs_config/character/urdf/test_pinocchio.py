"""Mass matrix, bias force and gravity are Pinocchio's, which reads the URDF itself.

Needs the extra `robots`; `make robots` compares hundreds of files of other packages.
"""

from pathlib import Path

import pybullet_data
import pytest

from msgs_config.character.loading import load_character
from tests.support.urdf import joint, link, robot, write_character
from tests.support.urdf_trial import compare_with_pinocchio

pytest.importorskip("pinocchio")

DATA = Path(pybullet_data.getDataPath())
ROBOTS = [
    "a1/a1.urdf",  # frames without inertial
    "cube_small.urdf",  # an inertia that Bullet multiplies
    "franka_panda/panda.urdf",
    "kuka_iiwa/model_free_base.urdf",
    "laikago/laikago_toes.urdf",  # inertial frames that are off
    "quadruped/minitaur.urdf",
    "xarm/xarm6_robot.urdf",  # the base is called `world`
]
HOSTILE = robot(  # a base that is a frame, a frame between hinges, an impossible inertia
    link("base", ""),
    link("trunk"),
    link("cross", ""),
    link(
        "arm",
        '<inertial><origin xyz="0.1 0.2 0.3" rpy="0.3 1.2 -2"/><mass value="2"/>'
        '<inertia ixx="0.1" iyy="0.2" izz="0.5" ixy="0.03" ixz="-0.02" iyz="0.01"/></inertial>',
    ),
    joint("mount", "base", "trunk", "fixed", '<origin xyz="1 2 3" rpy="0.1 1.57 2"/>', ""),
    joint("first", "trunk", "cross", "revolute", '<axis xyz="0 1 1"/>'),
    joint("second", "cross", "arm", "prismatic", '<axis xyz="1 0 2"/><origin rpy="1 2 3"/>'),
)


def assert_agrees(path: Path) -> None:
    differences = compare_with_pinocchio(load_character(str(path)))

    assert differences
    assert max(differences.values()) < 1e-9, differences


@pytest.mark.parametrize("name", [name for name in ROBOTS if (DATA / name).is_file()])
def test_robots_of_other_makers_move_as_in_pinocchio(name: str) -> None:
    assert_agrees(DATA / name)


def test_a_repaired_robot_moves_as_in_pinocchio(tmp_path: Path) -> None:
    assert_agrees(write_character(tmp_path, HOSTILE))
