"""Bounds of hinges and sliders come from the URDF, unless the character's file has others."""

import math
from pathlib import Path

import numpy as np
import pytest

from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.errors import CharacterError
from tests.support.physics import advance, still_world
from tests.support.urdf import joint, link, robot, write_character

LIMIT = '<limit lower="-0.5" upper="0.5" effort="5" velocity="9"/>'
NO_BOUNDS = '<limit effort="5" velocity="9"/>'
STEP_S = 1.0 / 240.0


def load(directory: Path, kind: str, limit: str, joints: str, scale: float = 1.0) -> Character:
    """A fixed base and one arm of 1 kg on a joint of a kind, along or about z."""
    urdf = robot(
        link("base"),
        link("arm"),
        joint("joint", "base", "arm", kind, '<axis xyz="0 0 1"/>', limit),
    )
    yaml = f"fixed_base: true\nscale: {scale}\njoints: {{joint: {{{joints}}}}}\n"
    return load_character(str(write_character(directory, urdf, yaml)))


def reach(character: Character, effort: float) -> float:
    """Where the joint is after it was pushed for four seconds without gravity, rad or m."""
    with still_world(character, STEP_S) as world:
        advance(world, np.array([effort]), steps=960)
        return float(world.body.read()[0][0])


CASES = {  # kind, the URDF's limit, the file's, the bounds that count
    "both": ("revolute", LIMIT, "lower: -0.2, upper: 0.3", (-0.2, 0.3)),
    "the lower alone": ("revolute", LIMIT, "lower: -0.2", (-0.2, 0.5)),
    "the upper alone": ("revolute", LIMIT, "upper: 0.3", (-0.5, 0.3)),
    "wider ones": ("revolute", LIMIT, "lower: -1, upper: 1", (-1.0, 1.0)),
    "of a slider": ("prismatic", LIMIT, "lower: -0.2, upper: 0.3", (-0.2, 0.3)),
    "of a joint that turns forever": ("continuous", "", "lower: -0.2, upper: 0.3", (-0.2, 0.3)),
    "of a hinge without": ("revolute", NO_BOUNDS, "lower: -0.2, upper: 0.3", (-0.2, 0.3)),
}


@pytest.mark.parametrize("case", CASES)
def test_the_files_bounds_count(tmp_path: Path, case: str) -> None:
    kind, limit, joints, bounds = CASES[case]

    character = load(tmp_path, kind, limit, joints)

    lower, upper = character.position_bounds()
    assert (lower.tolist(), upper.tolist()) == ([bounds[0]], [bounds[1]])
    assert character.effort_limits().tolist() == [5.0 if limit else math.inf]


@pytest.mark.parametrize("case", CASES)
def test_the_simulated_body_keeps_within_the_files_bounds(tmp_path: Path, case: str) -> None:
    kind, limit, joints, (lower, upper) = CASES[case]
    character = load(tmp_path, kind, limit, joints)

    assert reach(character, 2.0) == pytest.approx(upper, abs=1e-3)
    assert reach(character, -2.0) == pytest.approx(lower, abs=1e-3)


def test_bounds_are_the_urdfs_if_the_file_has_none(tmp_path: Path) -> None:
    (hinge,) = load(tmp_path, "revolute", LIMIT, "stiffness: 1").moving_joints

    assert (hinge.lower, hinge.upper) == (-0.5, 0.5)


def test_a_sliders_bounds_are_metres_whatever_the_scale(tmp_path: Path) -> None:
    character = load(tmp_path, "prismatic", LIMIT, "upper: 0.3", scale=4.0)
    (slider,) = character.moving_joints

    assert (slider.lower, slider.upper) == pytest.approx((-2.0, 0.3))
    assert reach(character, 2.0) == pytest.approx(0.3, abs=1e-3)


def test_a_joint_without_bounds_keeps_none(tmp_path: Path) -> None:
    lower, upper = load(tmp_path, "continuous", "", "stiffness: 1").position_bounds()

    assert (lower.tolist(), upper.tolist()) == ([-math.inf], [math.inf])


REFUSED = {
    "crossed": ("revolute", LIMIT, "lower: 1, upper: -1", "lower is 1, upper is -1"),
    "crossed with the URDF's": ("revolute", LIMIT, "lower: 0.6", "lower is 0.6, upper is 0.5"),
    "half of them": ("continuous", "", "lower: -1", "both lower and upper must be given"),
    "of a ball joint": ("spherical", "", "lower: -1", "this joint is spherical"),
    "of a fixed joint": ("fixed", "", "upper: 1", "this joint is fixed"),
    "not a number": ("revolute", LIMIT, "lower: .nan", "lower is nan"),
    "infinite": ("revolute", LIMIT, "upper: .inf", "upper is inf"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_impossible_bounds_are_refused_by_file_and_joint(tmp_path: Path, case: str) -> None:
    kind, limit, joints, words = REFUSED[case]

    with pytest.raises(CharacterError) as caught:
        load(tmp_path, kind, limit, joints)

    line = str(caught.value)
    assert "\n" not in line
    assert f"{tmp_path / 'robot.yaml'}: joints.joint" in line
    assert words in line


def test_a_rest_pose_within_the_urdfs_bounds_alone_is_refused(tmp_path: Path) -> None:
    load(tmp_path, "revolute", LIMIT, "upper: 0.3")
    with (tmp_path / "robot.yaml").open("a") as file:
        file.write("rest_pose: {joint: 0.4}\n")

    with pytest.raises(CharacterError, match=r"rest_pose\.joint is 0\.4"):
        load_character(str(tmp_path / "robot.yaml"))
