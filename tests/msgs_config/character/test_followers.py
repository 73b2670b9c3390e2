"""Joints that mimic others: what a URDF may say, and what a character makes of it."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from controller_node import parameters as controller_parameters
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.character.urdf.robot_description import robot_description
from msgs_config.errors import CharacterError, CommandError, ConfigurationError
from msgs_config.messages import configuration
from msgs_config.parameters import Values
from sim_node.parameters import load_parameters
from sim_node.timing.lockstep import LockstepBarrier
from tests.support.hands import box_link


def joint(
    name: str,
    mimic: str = "",
    kind: str = "revolute",
    lower: float = -1.0,
    upper: float = 1.0,
    mass: float = 0.5,
) -> str:
    """A link of its own on `world`; `mimic` are the attributes of a `<mimic>`."""
    element = f"<mimic {mimic}/>" if mimic else ""
    link = box_link(f"{name}_link", mass, (0.4, 0.02, 0.02), (0.2, 0.0, 0.0))
    return (
        (link if mass else f'<link name="{name}_link"/>')
        + f'<joint name="{name}" type="{kind}"><parent link="world"/><child link="{name}_link"/>'
        f'<axis xyz="0 0 1"/><limit lower="{lower}" upper="{upper}" effort="5" velocity="1"/>'
        f"{element}</joint>"
    )


def load(folder: Path, *joints: str, yaml: str | None = None) -> Character:
    urdf = folder / "robot.urdf"
    urdf.write_text(f'<robot name="r"><link name="world"/>{"".join(joints)}</robot>')
    if yaml is None:
        return load_character(str(urdf))
    (folder / "robot.yaml").write_text(f"urdf: robot.urdf\n{yaml}")
    return load_character(str(folder / "robot.yaml"))


@pytest.mark.parametrize(
    ("joints", "sentence"),
    [
        ([joint("a"), joint("b", 'joint="z"')], "'b' mimics another: unknown joint 'z'"),
        ([joint("a"), joint("b", 'joint=""')], "'b' mimics another: unknown joint ''"),
        ([joint("a", 'joint="a"')], "'a' mimics itself"),
        ([joint("a", 'joint="b"'), joint("b", 'joint="a"')], "mimics itself"),
        ([joint("a", kind="spherical"), joint("b", 'joint="a"')], "'a' is spherical"),
        ([joint("a"), joint("b", 'joint="a"', kind="spherical")], "'b' is spherical"),
        ([joint("a"), joint("b", 'joint="a" multiplier="two"')], "multiplier of <mimic>"),
        ([joint("a"), joint("b", 'joint="a" offset="nan"')], "offset of <mimic>"),
        ([joint("a"), joint("b", 'joint="a" offset="5"')], "nowhere"),
    ],
)
def test_a_mimic_that_makes_no_sense_is_an_error_in_a_line(
    tmp_path: Path, joints: list[str], sentence: str
) -> None:
    with pytest.raises(CharacterError) as error:
        load(tmp_path, *joints)

    assert sentence in str(error.value) and "\n" not in str(error.value)


def test_a_chain_leads_to_its_first_leader(tmp_path: Path) -> None:
    whole = load(
        tmp_path,
        joint("c", 'joint="b" multiplier="0.5" offset="0.1"'),
        joint("b", 'joint="a" multiplier="-0.5" offset="0.2"'),
        joint("a"),
    )

    mimics = {each.name: each.mimic for each in whole.moving_joints}
    assert mimics["a"] is None
    assert mimics["c"] == ("a", -0.25, pytest.approx(0.2))
    assert whole.layout.actuated_joint_names == ["a"]


def test_lengths_of_a_scaled_slider_are_scaled(tmp_path: Path) -> None:
    slider = joint("b", 'joint="a" multiplier="0.1" offset="0.02"', kind="prismatic")
    whole = load(tmp_path, joint("a"), slider, yaml="scale: 2\nfixed_base: true\n")

    mimic = {each.name: each.mimic for each in whole.moving_joints}["b"]
    assert mimic == ("a", pytest.approx(0.2), pytest.approx(0.04))
    described = ElementTree.fromstring(robot_description(whole)).find("joint[@name='b']/mimic")
    assert described is not None
    assert float(described.get("offset", "")) == pytest.approx(0.04)


def test_a_leader_rests_where_its_followers_may_be(tmp_path: Path) -> None:
    follower = joint("b", 'joint="a" multiplier="-2" offset="0"', lower=0.5)

    whole = load(tmp_path, joint("a"), follower)

    assert whole.rest_position == (-0.25, 0.5)
    assert any("'a' rests at -0.25" in line for line in whole.warnings)


def test_what_follows_a_fixed_joint_is_fixed_itself(tmp_path: Path) -> None:
    whole = load(tmp_path, joint("a", kind="fixed"), joint("b", 'joint="a"'), joint("c"))

    assert [each.name for each in whole.moving_joints] == ["c"]


def test_what_follows_a_joint_without_room_is_fixed_too(tmp_path: Path) -> None:
    whole = load(tmp_path, joint("a", lower=0, upper=0), joint("b", 'joint="a"'), joint("c"))

    assert [each.name for each in whole.moving_joints] == ["c"]


def test_the_first_follower_of_a_leader_without_mass_leads_the_others(tmp_path: Path) -> None:
    whole = load(
        tmp_path,
        joint("knob", mass=0.0),
        joint("b", 'joint="knob" multiplier="2" offset="0.1"'),
        joint("c", 'joint="knob" multiplier="-1"'),
    )

    mimics = {each.name: each.mimic for each in whole.moving_joints}
    assert mimics["b"] is None
    assert mimics["c"] == ("b", -0.5, pytest.approx(0.05))
    assert any("'knob' moves no mass, so that 'b' leads" in line for line in whole.warnings)


@pytest.mark.parametrize(
    "text",
    ["joints: {b: {stiffness: 5}}", "joints: {b: {effort_limit: 5}}", "rest_pose: {b: 0.1}"],
)
def test_a_file_gives_a_follower_neither_motor_nor_place(tmp_path: Path, text: str) -> None:
    with pytest.raises(CharacterError, match="mimics 'a' and has no motor"):
        load(tmp_path, joint("a"), joint("b", 'joint="a"'), yaml=f"{text}\n")


def test_with_joint_mimic_none_it_is_a_joint_as_any(tmp_path: Path) -> None:
    whole = load(tmp_path, joint("a"), joint("b", 'joint="a"'), yaml="joint_mimic: none\n")

    assert whole.layout.actuated_joint_names == ["a", "b"]
    assert not whole.coupling


def test_a_follower_has_no_parameters_of_a_motor(tmp_path: Path) -> None:
    whole = load(tmp_path, joint("a"), joint("b", 'joint="a"'))

    names = [each.name for each in controller_parameters.character_parameters(whole)]
    assert "gains.a.p" in names and not any(".b" in name for name in names)
    text = configuration.describe(whole, Values({}))
    assert configuration.parse(text).layout.actuated_joint_names == ["a"]


def test_automatic_gains_count_the_followers_inertia(tmp_path: Path) -> None:
    alone = load(tmp_path, joint("a"))
    leader = load(tmp_path, joint("a"), joint("b", 'joint="a" multiplier="2"', lower=-9, upper=9))

    assert leader.gains["a"].stiffness == pytest.approx(5.0 * alone.gains["a"].stiffness)
    assert "b" not in leader.gains


def test_a_command_for_a_follower_is_rejected_in_a_line(tmp_path: Path) -> None:
    whole = load(tmp_path, joint("a"), joint("b", 'joint="a"'))
    names, mask = whole.layout.dof_names, whole.layout.mask(["a"])
    barrier = LockstepBarrier(names, mask, whole.leaders)

    with pytest.raises(CommandError, match="'b' is not among the commanded joints; it mimics 'a'"):
        barrier.submit(1, np.array([0, 1]), np.zeros(2))
    with pytest.raises(ConfigurationError, match="commanded_joints: 'b' mimics 'a'"):
        load_parameters({"character": str(tmp_path / "robot.urdf"), "commanded_joints": ["a", "b"]})


def test_a_follower_of_a_locked_joint_is_described_where_it_is_simulated(tmp_path: Path) -> None:
    locked = joint("ja", lower=0.5, upper=0.5)
    whole = load(tmp_path, locked, joint("jb", 'joint="ja"'))

    described = ElementTree.fromstring(robot_description(whole))

    follower = described.find("joint[@name='jb']")
    assert follower is not None and follower.get("type") == "fixed"
    assert follower.find("mimic") is None
    origin = follower.find("origin")
    assert origin is not None
    assert [float(n) for n in origin.get("rpy", "").split()] == pytest.approx([0.0, 0.0, 0.5])


def test_joints_that_are_apart_here_are_described_so(tmp_path: Path) -> None:
    joints = (joint("ja"), joint("jb", 'joint="ja"'))

    apart = load(tmp_path, *joints, yaml="joint_mimic: none\n")

    assert "<mimic" not in robot_description(apart)
    assert "<mimic" in robot_description(load(tmp_path, *joints))
