"""What a URDF's text means: axes, limits, and a line for each element that does not count."""

import math
from pathlib import Path

import numpy as np
import pytest

from controller_node.model_check import check_agreement
from msgs_config.character.dynamics import DynamicsModel, still_model
from msgs_config.character.layout import JointType
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.character.urdf.robot_description import robot_description
from sim_node.physics.probe import measure_probe
from tests.support.description import link_frames, parse
from tests.support.urdf import joint, link, refusal, robot, write_character

MASS, ARM, MOMENT = 1.5, 0.4, 0.02  # kg, m, kg m^2
SWINGING = (
    f'<inertial><origin xyz="0 0 -{ARM}"/><mass value="{MASS}"/><inertia ixx="{MOMENT}" '
    f'iyy="{MOMENT}" izz="{MOMENT}" ixy="0" ixz="0" iyz="0"/></inertial>'
)
LIMIT = '<limit lower="-3" upper="3" effort="5"/>'


def arm(inside: str = "", kind: str = "revolute", limit: str = LIMIT, more: str = "") -> str:
    """A robot of one joint, its base the world."""
    parts = (
        link("world", ""),
        link("arm", SWINGING),
        joint("j", "world", "arm", kind, inside, limit),
    )
    return robot(*parts, more)


def loaded(directory: Path, text: str, yaml: str = "") -> Character:
    return load_character(str(write_character(directory, text, yaml)))


def left_out(character: Character) -> list[str]:
    return [line for line in character.warnings if line.startswith("left out")]


# Axes

LENGTHS = ["0 1 0", "0 1.004 0", "0 -7 0", "0 1e-9 0", "0 1e-200 0", "0 5e-324 0", "0\t1e30  0"]


@pytest.mark.parametrize("axis", [*LENGTHS, "1 1 0", "0.71 0.71 0", None])
def test_an_axis_is_a_direction_whatever_its_length(tmp_path: Path, axis: str | None) -> None:
    """The inertia about it is the theory's: `I + m l^2` across the arm, in both engines."""
    text = "<axis/>" if axis is None else f'<axis xyz="{axis}"/>'
    character = loaded(tmp_path, arm(text))

    sample = measure_probe(character, 9.81)

    inertia = 2.0 * sample.kinetic_energy / sample.velocity[0] ** 2
    assert inertia == pytest.approx(MOMENT + MASS * ARM**2, rel=1e-5)
    check_agreement(DynamicsModel(character), character.layout, sample)
    direction = character.links[1].joint.axis_in_child
    assert math.hypot(*direction) == pytest.approx(1.0, abs=1e-15)
    if axis is None:
        assert direction == (1.0, 0.0, 0.0)


def test_the_axis_of_a_slider_is_no_gear(tmp_path: Path) -> None:
    character = loaded(tmp_path, arm('<axis xyz="0 0 -2"/>', "prismatic"))

    sample = measure_probe(character, 9.81)

    assert 2.0 * sample.kinetic_energy / sample.velocity[0] ** 2 == pytest.approx(MASS, rel=1e-5)
    assert character.links[1].joint.axis_in_child == (0.0, 0.0, -1.0)


def test_an_axis_of_another_length_is_named_and_one_with_few_digits_is_not(tmp_path: Path) -> None:
    long, rounded = (
        loaded(tmp_path, arm(f'<axis xyz="{xyz}"/>')) for xyz in ("0 5 0", "0.7071 0.7071 0")
    )

    assert "axes of another length than 1 are directions alone: j (5)" in long.warnings
    assert not [line for line in rounded.warnings if "axes" in line]


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
def test_an_axis_without_direction_is_refused(tmp_path: Path, kind: str) -> None:
    line = refusal(write_character(tmp_path, arm('<axis xyz="0 -0.0 0"/>', kind)))

    assert "joint 'j' has an axis of length zero" in line


def test_a_fixed_joint_needs_no_direction(tmp_path: Path) -> None:
    assert loaded(tmp_path, arm('<axis xyz="0 0 0"/>', "fixed", "")).layout.size == 0


# Limits


@pytest.mark.parametrize(
    ("kind", "limit", "words"),
    [
        ("revolute", 'lower="1" upper="-1"', "lower of <limit> is 1, upper is -1"),
        ("prismatic", 'lower="0.2" upper="0.1"', "lower of <limit> is 0.2, upper is 0.1"),
        ("revolute", 'lower="0.5"', "lower of <limit> is 0.5, upper is 0"),
        ("revolute", 'lower="-1" upper="1" effort="-5"', "effort of <limit> is -5"),
        ("continuous", 'effort="-1e-3"', "effort of <limit> is -1e-3"),
        ("spherical", 'effort="-2"', "effort of <limit> is -2"),
        ("prismatic", 'lower="-1" upper="1" velocity="-9"', "velocity of <limit> is -9"),
    ],
)
def test_limits_that_nothing_can_keep_are_refused(
    tmp_path: Path, kind: str, limit: str, words: str
) -> None:
    line = refusal(write_character(tmp_path, arm("", kind, f"<limit {limit}/>")))

    assert f"{tmp_path / 'robot.urdf'}: joint 'j': {words}" in line


def test_bounds_in_the_characters_file_mend_those_of_the_urdf(tmp_path: Path) -> None:
    text = arm("", limit='<limit lower="1" upper="-1" effort="5"/>')

    character = loaded(tmp_path, text, "joints: {j: {lower: -0.5, upper: 1}}\n")

    assert (character.links[1].joint.lower, character.links[1].joint.upper) == (-0.5, 1.0)


def test_a_bound_that_is_not_given_is_0(tmp_path: Path) -> None:
    """As the format has it; for the engine the upper one would be -1."""
    character = loaded(tmp_path, arm("", limit='<limit lower="-1" effort="5"/>'))

    assert (character.links[1].joint.lower, character.links[1].joint.upper) == (-1.0, 0.0)


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("position", [0.7, -1.2, 0.0])
@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_a_joint_of_equal_bounds_is_fixed_where_they_are(
    tmp_path: Path, kind: str, position: float, scale: float
) -> None:
    """Its child is where a joint that is free to move has it at this position."""
    inside = '<origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"/><axis xyz="1 2 -2"/>'
    bounds = f'<limit lower="{position}" upper="{position}" effort="5"/>'
    free = loaded(tmp_path, arm(inside, kind), f"scale: {scale}\n")
    length = scale if kind == "prismatic" else 1.0
    expected = [part[1] for part in still_model(free, np.array([length * position])).link_poses()]

    locked = loaded(tmp_path, arm(inside, kind, bounds), f"scale: {scale}\n")

    assert locked.layout.size == 0
    assert locked.links[1].joint.type is JointType.FIXED
    origin, turn = (part[1] for part in still_model(locked, np.empty(0)).link_poses())
    assert origin == pytest.approx(expected[0], abs=1e-9)
    assert abs(turn @ expected[1]) == pytest.approx(1.0, abs=1e-12)
    assert f"joints whose limits leave no room are fixed: j at {position:g}" in locked.warnings
    described = link_frames(parse(robot_description(locked)), {})["arm"]
    assert described[:3, 3] == pytest.approx(origin, abs=1e-9)


def test_gains_of_a_joint_that_the_file_itself_locks_are_no_mistake(tmp_path: Path) -> None:
    yaml = "joints: {j: {stiffness: 5, lower: 0.3, upper: 0.3}}\n"

    assert loaded(tmp_path, arm(), yaml).layout.size == 0


# A mass that is hardly one


@pytest.mark.parametrize("mass", ["1e-6", "1e-10", "1e-14", "1e-16", "1e-300"])
def test_a_slider_that_moves_hardly_anything_is_no_obstacle(tmp_path: Path, mass: str) -> None:
    """With damping that stops it within the instant in which the engine is probed."""
    grain = (
        f'<inertial><mass value="{mass}"/><inertia ixx="{mass}" iyy="{mass}" izz="{mass}" ixy="0" '
        'ixz="0" iyz="0"/></inertial>'
    )
    damped = '<axis xyz="0 1 0"/><dynamics damping="10"/>'
    slider = joint("s", "arm", "grain", "prismatic", damped, '<limit upper="0.09" effort="9"/>')
    character = loaded(tmp_path, arm(more=link("grain", grain) + slider))

    check_agreement(DynamicsModel(character), character.layout, measure_probe(character, 9.81))

    counts = float(mass) > 1e-15
    assert character.layout.size == 1 + counts
    assert any("count as none: grain" in line for line in character.warnings) != counts


# What does not count

REST = {  # in a robot, beside its links and joints
    "<transmission>": '<transmission name="t"><joint name="j"/></transmission>',
    "<gazebo>": '<gazebo reference="arm"><a:plugin b:c="1"/></gazebo>',
    "<loop_joint>": '<loop_joint name="l" type="revolute"><link1 link="a"/></loop_joint>',
    "<inertial> in <robot>": "<inertial><mass value='1'/></inertial>",
    "<ros2_control>": '<ros2_control name="c" type="system"/>',
    "<mujoco>": '<mujoco><compiler meshdir="m"/></mujoco>',
    "<Link>": '<Link name="capital"/>',
    "<origin> in <robot>": '<origin xyz="0 0 1"/>',
    "<texture>": '<material name="m"><texture filename="t.png"/></material>',
}
IN_JOINT = {
    "<safety_controller>": '<safety_controller k_velocity="1"/>',
    "<calibration>": '<calibration rising="0"/>',
    "<joint_properties>": '<joint_properties damping="1"/>',
    "all but the first <axis> of a joint": '<axis xyz="0 1 0"/><axis xyz="1 0 0"/>',
    "all but the first <origin> of a joint": "<origin/><origin xyz='0 0 1'/>",
    "all but the first <limit> of a joint": '<limit lower="-2" upper="2"/>',
    "all but the first <dynamics> of a joint": "<dynamics/><dynamics damping='3'/>",
    "all but the first <parent> of a joint": '<parent link="arm"/>',
    "<inertial> in <joint>": "<inertial/>",
    "'stiffness' of <dynamics>": '<dynamics stiffness="1"/>',
    "'xzy' of <axis>": '<axis xzy="0 0 1"/>',
    "velocity limits, which nothing keeps": '<limit lower="-3" upper="3" velocity="2"/>',
}
IN_LINK = {
    "<sensor>": '<sensor name="camera" type="camera"/>',
    "<origin> in <link>": '<origin xyz="0 0 1"/>',
    "all but the first <inertial> of a link": "<inertial><mass value='7'/></inertial>",
    "all but the first <geometry> of a collision": "<collision><geometry><sphere radius='1'/>"
    "</geometry><geometry><sphere radius='2'/></geometry></collision>",
    "all but the first <sphere> of a geometry": "<visual><geometry><sphere radius='1'/>"
    "<sphere radius='2'/></geometry></visual>",
    "<lateral_friction>, for which the parameter 'link_friction' stands": "<contact>"
    "<lateral_friction value='1'/></contact>",
    "'margin' of <collision>": "<collision margin='1'><geometry><sphere radius='1'/></geometry>"
    "</collision>",
}


def with_part(part: str, place: str) -> str:
    if place == "joint":
        limit = part if "velocity" in part else LIMIT + part
        return arm(limit=limit if part.startswith("<limit") else part + LIMIT)
    text = arm(more=part if place == "robot" else "")
    return text.replace("</inertial></link>", f"</inertial>{part}</link>", place == "link")


CASES = [
    (what, part, place)
    for place, parts in {"robot": REST, "joint": IN_JOINT, "link": IN_LINK}.items()
    for what, part in parts.items()
]


@pytest.mark.parametrize(("what", "part", "place"), CASES, ids=[case[0] for case in CASES])
def test_each_element_that_does_not_count_is_in_a_line(
    tmp_path: Path, what: str, part: str, place: str
) -> None:
    character = loaded(tmp_path, with_part(part, place))

    assert [line for line in left_out(character) if f": {what} (1)" in line], character.warnings
    assert len(left_out(character)) == 1
    assert character.links[1].joint.upper == 3.0
    assert character.mass == MASS


def test_a_line_counts_and_names_some_and_a_file_may_silence_it(tmp_path: Path) -> None:
    parts = "".join(f'<transmission name="t{number}"/>' for number in range(7)) + "<gazebo/>"

    spoken = loaded(tmp_path, arm(more=parts))
    silent = loaded(tmp_path, arm(more=parts), "left_out: [transmission]\n")

    assert left_out(spoken) == [
        "left out: <transmission> (7): t0, t1, t2, t3, t4 and 2 more",
        "left out: <gazebo> (1)",
    ]
    assert left_out(silent) == ["left out: <gazebo> (1)"]


def test_a_line_stays_one_whatever_the_names(tmp_path: Path) -> None:
    parts = f'<transmission name="a&#10;b{"c" * 5000}"/><{"x" * 5000}/>'

    lines = left_out(loaded(tmp_path, arm(more=parts)))

    assert lines[0].startswith("left out: <transmission> (1): a bccc")
    assert all("\n" not in line and len(line) < 300 for line in lines)


def test_what_does_not_count_need_not_be_right(tmp_path: Path) -> None:
    """Of what another program reads, numbers are not looked at."""
    text = arm(more='<gazebo><origin xyz="here"/></gazebo>', inside='<axis xyz="0 0 1"/><axis/>')

    assert loaded(tmp_path, text).layout.size == 1


# xacro that was not expanded


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ('<xacro:include filename="hand.xacro"/>', "<xacro:include>"),
        ('<gazebo><xacro:imu parent="arm"/></gazebo>', "<xacro:imu>"),
        ('<x:hand parent="arm"/>', "<x:hand>"),
        ('<link name="${prefix}hand"/>', "'name' of <link> as '${prefix}hand'"),
        (
            '<link name="h"><visual><origin xyz="0 0 $(arg z)"/></visual></link>',
            "'xyz' of <origin>",
        ),
        ('<include filename="hand.xacro"/>', "<include>"),
    ],
)
def test_xacro_that_was_not_expanded_is_refused_as_such(
    tmp_path: Path, part: str, words: str
) -> None:
    space = '<robot xmlns:x="http://www.ros.org/wiki/xacro" '
    text = arm(more=part).replace("<robot ", space)

    line = refusal(write_character(tmp_path, text))

    assert words in line
    assert "xacro that was not expanded" in line


def test_a_name_space_of_xacro_alone_is_no_xacro(tmp_path: Path) -> None:
    text = arm().replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')

    assert loaded(tmp_path, text).layout.size == 1


# The joint of a floating base


@pytest.mark.parametrize("base", ["world", "odom"])
def test_a_floating_joint_from_the_world_is_that_of_the_floating_base(
    tmp_path: Path, base: str
) -> None:
    """As files for other programs have it: the same robot as without the two."""
    rest = link("trunk"), link("arm"), joint("hinge", "trunk", "arm")
    floating = joint("free", base, "trunk", "floating", limit="")

    character = loaded(tmp_path, robot(link(base, ""), floating, *rest))
    without = loaded(tmp_path, robot(*rest))

    assert character.layout.dof_names == without.layout.dof_names
    assert character.layout.has_floating_base
    assert character.mass == without.mass
    assert character.frame_names == {base, "trunk", "arm"}
    assert "joint 'free' is that of the floating base" in character.warnings


def test_a_floating_joint_elsewhere_is_refused(tmp_path: Path) -> None:
    free = joint("free", "a", "b", "floating", limit="")

    line = refusal(write_character(tmp_path, robot(link("a"), link("b"), free)))

    assert "joint 'free' is of type floating" in line


def test_a_slider_that_moves_an_inertia_without_mass_is_fixed(tmp_path: Path) -> None:
    """Nothing would resist its effort."""
    wheel = SWINGING.replace(f'value="{MASS}"', 'value="0"')
    slider = joint("s", "arm", "wheel", "prismatic", limit='<limit upper="1" effort="1"/>')

    character = loaded(tmp_path, arm(more=link("wheel", wheel) + slider))

    assert character.layout.size == 1
    assert "joints that move no mass are fixed at 0: s" in character.warnings
