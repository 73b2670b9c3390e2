"""A URDF as ROS means it: frames without mass, inertia of real bodies; nothing else is altered."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from controller_node.model_check import check_agreement
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.character.urdf.repair import Repairs
from msgs_config.errors import CharacterError
from msgs_config.geometry import rotations
from msgs_config.messages.probe import DynamicsSample
from sim_node.physics.probe import measure_probe
from tests.support.engines import need_engine
from tests.support.urdf import joint, link, refusal, robot, write_character


def body(mass: float, moments: str, products: str = "0 0 0", origin: str = "0.1 0 0.05") -> str:
    """An inertial of moments about x, y and z, and products xy, xz and yz."""
    x, y, z = moments.split()
    xy, xz, yz = products.split()
    return (
        f'<inertial><origin xyz="{origin}" rpy="0.3 -0.2 0.1"/><mass value="{mass}"/>'
        f'<inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="{xy}" ixz="{xz}" iyz="{yz}"/></inertial>'
    )


def at(xyz: str, rpy: str = "0 0 0") -> str:
    return f'<origin xyz="{xyz}" rpy="{rpy}"/>'


def hinge(parent: str, child: str, inside: str = "") -> str:
    return joint(f"{parent}_{child}", parent, child, "continuous", inside + '<axis xyz="0 1 0"/>')


def fixed(parent: str, child: str, inside: str = "") -> str:
    return joint(f"{parent}_{child}", parent, child, "fixed", inside, limit="")


def loaded(directory: Path, *parts: str, yaml: str = "") -> Character:
    return load_character(str(write_character(directory, robot(*parts), yaml)))


def assert_engines_agree(character: Character) -> None:
    sample = measure_probe(character, 9.81)
    model = DynamicsModel(character)
    model.update(sample.position, sample.velocity)
    force = model.mass_matrix() @ sample.acceleration + model.bias_force()
    assert np.allclose(force, sample.effort, rtol=1e-4, atol=1e-4 * np.abs(force).max())


BALL_OF_2_KG = 0.4 * 2.0 * (2.0 / 1000.0 / (4.0 / 3.0 * np.pi)) ** (2.0 / 3.0)  # of water, kg m^2
TRUNK, ARM = body(2.0, "0.02 0.03 0.04"), body(1.0, "0.01 0.01 0.005")


def test_a_base_without_mass_takes_that_of_the_link_fixed_to_it(tmp_path: Path) -> None:
    """`base_link` of most robots: a frame at the trunk, which is turned and aside."""
    character = loaded(
        tmp_path,
        link("base", ""),
        link("trunk", TRUNK),
        link("arm", ARM),
        fixed("base", "trunk", at("0.1 0.2 0.3", "0.4 1.5707963267948966 0.5")),
        hinge("trunk", "arm", at("0 0 0.5")),
    )

    base, arm = character.links
    assert (base.name, base.mass, arm.name) == ("base", 2.0, "arm")
    # by hand: rpy are turns about the fixed axes x, y and z
    sine, cosine = np.sin([0.4, 0.5]), np.cos([0.4, 0.5])
    about_x = np.array([[1, 0, 0], [0, cosine[0], -sine[0]], [0, sine[0], cosine[0]]])
    about_y = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    about_z = np.array([[cosine[1], -sine[1], 0], [sine[1], cosine[1], 0], [0, 0, 1]])
    turn = about_z @ about_y @ about_x
    assert base.inertial_pose.position == pytest.approx(
        tuple(turn @ [0.1, 0, 0.05] + [0.1, 0.2, 0.3]), abs=1e-15
    )
    assert arm.joint.pose_in_parent.position == pytest.approx(
        tuple(turn @ [0, 0, 0.5] + [0.1, 0.2, 0.3]), abs=1e-15
    )
    axes = rotations.matrix(np.array(arm.joint.pose_in_parent.orientation_xyzw))
    assert np.allclose(axes, turn, rtol=0.0, atol=1e-15)
    assert character.layout.has_floating_base
    assert "base link 'base' has no mass, and takes that of trunk" in character.warnings
    assert_engines_agree(character)


def test_frames_add_no_mass_and_need_no_room_in_the_engine(tmp_path: Path) -> None:
    frames = [link(f"frame{n}", "") for n in range(300)]
    joints = [fixed("arm" if n == 0 else f"frame{n - 1}", f"frame{n}") for n in range(300)]

    character = loaded(
        tmp_path, link("base", TRUNK), link("arm", ARM), hinge("base", "arm"), *frames, *joints
    )

    assert [link.name for link in character.links] == ["base", "arm"]
    assert character.mass == 3.0
    assert any("frame0 of arm" in warning for warning in character.warnings)


def test_links_without_mass_by_number_are_frames_where_the_engine_needs_the_room(
    tmp_path: Path,
) -> None:
    """Otherwise they stay: the tools of some arms, whose recordings have them."""
    arms = [link(f"arm{n}", ARM) for n in range(101)]
    hinges = [hinge(f"arm{n}", f"arm{n + 1}") for n in range(100)]
    tools = [link(f"tool{n}", body(0.0, "0 0 0")) for n in range(28)]
    mounts = [fixed("arm100", f"tool{n}") for n in range(28)]

    few = loaded(tmp_path, *arms, *hinges, *tools[:27], *mounts[:27])
    many = loaded(tmp_path, *arms, *hinges, *tools, *mounts)

    assert (len(few.links), few.mass) == (128, 101.0)
    assert (len(many.links), many.mass) == (101, 101.0)


def test_what_is_fixed_to_a_frame_moves_to_the_link_above_it(tmp_path: Path) -> None:
    """A shape of a frame, and a joint from it, are where they were."""
    ball = f'<collision>{at("0 0 1")}<geometry><sphere radius="0.1"/></geometry></collision>'
    quarter = at("1 0 0", "1.5707963267948966 0 0")

    character = loaded(
        tmp_path,
        link("base", TRUNK),
        link("frame", ball),
        link("arm", ARM),
        fixed("base", "frame", quarter),
        hinge("frame", "arm", at("0 0 2")),
    )

    base, arm = character.links
    (shape,) = base.collision_shapes
    assert shape.pose.position == pytest.approx((1.0, -1.0, 0.0), abs=1e-15)
    assert arm.joint.pose_in_parent.position == pytest.approx((1.0, -2.0, 0.0), abs=1e-15)
    assert_engines_agree(character)


def test_links_without_mass_between_hinges_are_no_obstacle(tmp_path: Path) -> None:
    """A universal joint, the link in its middle a mere frame."""
    character = loaded(
        tmp_path,
        link("base", TRUNK),
        link("cross", ""),
        link("arm", ARM),
        hinge("base", "cross"),
        joint("other", "cross", "arm", "continuous", '<axis xyz="1 0 0"/>'),
    )

    assert character.layout.size == 8
    assert character.mass == 3.0
    assert_engines_agree(character)


def test_a_point_at_the_crossing_of_three_axes_is_refused(tmp_path: Path) -> None:
    """The head of some humanoids: it can turn about the line from the crossing to the point."""
    character = loaded(
        tmp_path,
        link("base", TRUNK),
        link("one", ""),
        link("two", ""),
        link("head", body(1.0, "0 0 0")),
        hinge("base", "one"),
        joint("roll", "one", "two", "continuous", '<axis xyz="1 0 0"/>'),
        joint("yaw", "two", "head", "continuous", '<axis xyz="0 0 1"/>'),
    )
    nothing = np.zeros(character.layout.size)
    sample = DynamicsSample(nothing, nothing, nothing, 1.0, nothing)

    with pytest.raises(CharacterError, match="a mass but without inertia"):
        check_agreement(DynamicsModel(character), character.layout, sample)


def test_a_link_may_be_called_world(tmp_path: Path) -> None:
    character = loaded(tmp_path, link("world", ""), link("arm", ARM), hinge("world", "arm"))

    assert DynamicsModel(character).mass_matrix().shape == (1, 1)


def engine_tensor(character: Character) -> np.ndarray:
    link = character.links[0]
    axes = rotations.matrix(np.array(link.inertial_pose.orientation_xyzw))
    return axes @ np.diag(link.inertia_diagonal) @ axes.T


def test_products_of_inertia_are_exact(tmp_path: Path) -> None:
    """The engine's own diagonalisation ends at 1e-8 or so."""
    character = loaded(tmp_path, link("a", body(1.0, "0.3 0.2 0.4", "0.01 -0.02 0.03")))

    axes = rotations.matrix(np.array(rotations.exp(np.array([0.0, 0.0, 0.1]))))
    for vector in ([0.0, -0.2, 0.0], [0.3, 0.0, 0.0]):
        axes = axes @ rotations.matrix(rotations.exp(np.array(vector)))
    given = np.array([[0.3, 0.01, -0.02], [0.01, 0.2, 0.03], [-0.02, 0.03, 0.4]])
    assert np.allclose(engine_tensor(character), axes @ given @ axes.T, rtol=0.0, atol=1e-15)
    assert character.warnings == ()


def test_an_inertia_that_no_body_can_have_is_altered_and_named(tmp_path: Path) -> None:
    """The engine alone would take it for zero, and print that where it is not seen."""
    character = loaded(tmp_path, link("a", body(1.0, "1 2 4")))

    assert np.linalg.eigvalsh(engine_tensor(character)) == pytest.approx([4 / 3, 7 / 3, 11 / 3])
    (warning,) = character.warnings
    assert "a (1, 2, 4) -> (1.333, 2.333, 3.667)" in warning


def test_a_negative_zero_is_zero_and_what_is_less_is_refused(tmp_path: Path) -> None:
    tiny = link("arm", body(0.1, "-5.42101e-20 0 0"))
    parts = link("base", TRUNK), hinge("base", "arm")

    assert loaded(tmp_path, *parts, tiny).links[1].inertia_diagonal == (0.0, 0.0, 0.0)
    write_character(tmp_path, robot(*parts, link("arm", body(0.1, "-5.42101e-5 1 1"))))
    line = refusal(tmp_path / "robot.yaml")
    assert "link 'arm': ixx of <inertia> is '-5.42101e-5'" in line


def test_bullets_own_factor_of_inertia_is_named(tmp_path: Path) -> None:
    factor = '<contact><inertia_scaling value="3"/></contact>'
    character = loaded(tmp_path, link("a", body(1.0, "1 1 1") + factor))

    assert character.links[0].inertia_diagonal == (3.0, 3.0, 3.0)
    assert any("inertia of a by 3" in warning for warning in character.warnings)


def test_a_link_that_the_engine_reads_otherwise_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As it would be without the repair of the text that the engine is given."""
    need_engine("bullet")
    character = loaded(tmp_path, link("a", body(1.0, "1 2 4")))
    monkeypatch.setattr("sim_node.physics.bullet.urdf_text.repair_urdf", lambda *_: [])

    with pytest.raises(CharacterError) as caught:
        measure_probe(character, 9.81)

    assert "link 'a': the engine has an inertia in kg m^2 of 0 0 0" in str(caught.value)
    assert str(tmp_path / "robot.urdf") in str(caught.value)


def test_a_repair_that_loses_mass_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lose_a_link(robot: ElementTree.Element, loading: UrdfOptions) -> Repairs:
        robot.remove(robot.findall("link")[1])
        robot.remove(robot.findall("joint")[0])
        return Repairs((), frozenset(), ())

    monkeypatch.setattr("msgs_config.character.loading.repair_urdf", lose_a_link)
    parts = link("a", body(1.0, "1 1 1")), link("b", body(2.5, "1 1 1")), hinge("a", "b")
    write_character(tmp_path, robot(*parts))

    line = refusal(tmp_path / "robot.yaml")

    assert "all links have 1 kg; the URDF's text has 3.5" in line


def test_of_a_urdf_alone_a_mass_without_inertia_is_a_ball_of_water(tmp_path: Path) -> None:
    """4.19 kg are a ball of 0.1 m; with `inertia: file` it stays a point."""
    mass = 1000.0 * 4.0 / 3.0 * np.pi * 0.1**3
    parts = link("base", TRUNK), hinge("base", "arm"), link("arm", body(mass, "0 0 0"))
    yaml = write_character(tmp_path, robot(*parts), "inertia: file\n")

    alone, exact = load_character(str(tmp_path / "robot.urdf")), load_character(str(yaml))

    assert alone.links[1].inertia_diagonal == pytest.approx([0.4 * mass * 0.1**2] * 3, rel=1e-12)
    assert exact.links[1].inertia_diagonal == (0.0, 0.0, 0.0)
    assert alone.links[1].mass == exact.links[1].mass == mass
    assert any("ball of water" in warning and "arm" in warning for warning in alone.warnings)
    assert_engines_agree(alone)


def test_an_arm_of_which_no_link_has_a_mass_can_be_moved(tmp_path: Path) -> None:
    """As those are that are made for planning alone."""
    shape = '<visual><geometry><box size="1 1 1"/></geometry></visual>'
    parts = link("base", shape), hinge("base", "arm"), link("arm", shape)
    write_character(tmp_path, robot(*parts))

    alone = load_character(str(tmp_path / "robot.urdf"))

    assert alone.links[1].mass == 1.0
    assert not alone.layout.has_floating_base
    assert any("no link has a mass" in warning for warning in alone.warnings)


@pytest.mark.parametrize(("limit", "size"), [("0", 0), ("0.5", 1)])
def test_a_hinge_whose_limits_leave_nothing_but_zero_is_fixed(
    tmp_path: Path, limit: str, size: int
) -> None:
    stuck = joint("stuck", "a", "b", limit=f'<limit lower="0" upper="{limit}" effort="1"/>')

    character = loaded(tmp_path, link("a"), link("b"), stuck, yaml="fixed_base: true\n")

    assert character.layout.size == size
    assert any("stuck" in each and "no room" in each for each in character.warnings) == (size == 0)


@pytest.mark.parametrize("inertia", ["", '<inertia ixx="0" iyy="0" izz="0"/>'])
def test_a_mass_without_inertia_has_that_of_a_ball_of_water(tmp_path: Path, inertia: str) -> None:
    text = f'<inertial><mass value="2"/>{inertia}</inertial>'

    character = loaded(tmp_path, link("body", text), yaml="inertia: filled\n")

    (whole,) = character.links
    assert whole.mass == 2.0
    assert whole.inertia_diagonal == pytest.approx([BALL_OF_2_KG] * 3, rel=1e-12)
    (warning,) = [line for line in character.warnings if "ball of water" in line]
    assert "body (0.0" in warning


@pytest.mark.parametrize(("across", "along"), [(0.5, BALL_OF_2_KG), (1e-3, 1e-3)])
def test_a_rod_without_inertia_about_its_axis_has_that_of_a_ball_or_no_more_than_across(
    tmp_path: Path, across: float, along: float
) -> None:
    text = body(2.0, f"{across} 0 {across}")

    character = loaded(tmp_path, link("rod", text), yaml="inertia: filled\n")

    assert character.links[0].inertia_diagonal == pytest.approx([across, along, across], rel=1e-12)
    assert_engines_agree(character)
