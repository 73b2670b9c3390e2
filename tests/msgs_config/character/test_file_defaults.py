"""A URDF alone stands on the ground and holds its pose; what is below the ground is named."""

import math
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
import trimesh

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from msgs_config.character.dynamics import still_model
from msgs_config.character.file import AUTOMATIC_GAINS_HZ
from msgs_config.character.loading import load_character
from msgs_config.character.lowest_points import lowest_heights
from msgs_config.geometry import rotations
from tests.support.urdf import inertial, joint, link, refusal, robot, write_character

SPEED = 2.0 * math.pi * AUTOMATIC_GAINS_HZ
DATA = Path(pybullet_data.getDataPath())
TURN = (0.3, -0.7, 1.1)  # roll, pitch, yaw
ORIGIN = f'<origin xyz="0.1 0.2 0.3" rpy="{TURN[0]} {TURN[1]} {TURN[2]}"/>'


def write_urdf(directory: Path, *parts: str) -> str:
    path = directory / "robot.urdf"
    path.write_text(robot(*parts))
    return str(path)


def write_fixed(directory: Path, *parts: str) -> str:
    """A character whose base is fixed and whose gains are a URDF's alone."""
    yaml = f"fixed_base: true\nautomatic_gains: {AUTOMATIC_GAINS_HZ}\n"
    return str(write_character(directory, robot(link("base"), *parts), yaml))


def body(name: str, geometry: str, origin: str = "") -> str:
    return link(name, f"{inertial()}<collision>{origin}<geometry>{geometry}</geometry></collision>")


def plan_hold(file: str, duration: float = 1.0, **simulator: object) -> RunPlan:
    return make_plan(file, duration, {"reference": "hold"}, simulator, {})


def moved_at_end(plan: RunPlan) -> np.ndarray:  # type: ignore[type-arg]
    """How far each entry is from the rest pose at a run's end (n,), rad or m."""
    *_, last = ticks_in_process(plan)
    layout, rest = plan.character.layout, np.array(plan.character.rest_position)
    return layout.difference(
        layout.configuration(rest), layout.configuration(last.following.position)
    )


# Where it begins


SHAPES = {
    "box": ('<box size="0.2 0.4 0.6"/>', trimesh.creation.box((0.2, 0.4, 0.6))),
    "cylinder": (
        '<cylinder radius="0.2" length="0.6"/>',
        trimesh.creation.cylinder(0.2, 0.6, sections=2000),
    ),
    "sphere": ('<sphere radius="0.3"/>', trimesh.creation.icosphere(5, 0.3)),
    "capsule": (
        '<capsule radius="0.2" length="0.6"/>',
        trimesh.creation.capsule(0.6, 0.2, count=[400, 400]),
    ),
    "mesh": ('<mesh filename="wedge.stl" scale="1 2 3"/>', None),
}


@pytest.mark.parametrize("case", SHAPES)
def test_its_lowest_point_is_on_the_ground(tmp_path: Path, case: str) -> None:
    geometry, surface = SHAPES[case]
    if surface is None:
        surface = trimesh.creation.box((0.2, 0.4, 0.6))
        (tmp_path / "wedge.stl").write_bytes(surface.export(file_type="stl"))
        surface.apply_scale((1.0, 2.0, 3.0))
    surface.apply_transform(trimesh.transformations.euler_matrix(*TURN, "sxyz"))

    character = load_character(write_urdf(tmp_path, body("body", geometry, ORIGIN)))

    lowest = 0.3 + surface.bounds[0][2]
    assert character.rest_position[2] == pytest.approx(-lowest, abs=2e-4)
    (height,) = lowest_heights(character, still_model(character, np.array(character.rest_position)))
    assert height == pytest.approx(0.0, abs=1e-12)
    assert any("lowest point on the ground: 'root_z'" in line for line in character.warnings)


def test_a_turned_base_has_its_lowest_point_elsewhere(tmp_path: Path) -> None:
    character = load_character(write_urdf(tmp_path, body("body", '<box size="2 2 2"/>')))
    position = np.array(character.rest_position)
    position[3:6] = rotations.log(rotations.about_z(0.0))
    position[3] = math.pi / 4

    (height,) = lowest_heights(character, still_model(character, position))

    assert height == pytest.approx(1.0 - math.sqrt(2.0))


def test_what_collides_with_nothing_falls_and_says_so(tmp_path: Path) -> None:
    character = load_character(write_urdf(tmp_path, link("body")))

    assert any("falls through the ground" in line for line in character.warnings)


@pytest.mark.parametrize(
    ("yaml", "terrain", "depth"),
    [
        ("", "plane", "0.3"),
        ("rest_pose: {root_z: 0.2}\n", "plane", "0.1"),
        ("rest_pose: {root_z: 0.26}\n", "plane", None),
        ("", "none", None),
        ("on_ground: true\n", "plane", None),
        ("fixed_base: true\n", "plane", None),
    ],
)
def test_a_start_below_the_ground_is_named_with_link_and_depth(
    tmp_path: Path, yaml: str, terrain: str, depth: str | None
) -> None:
    file = write_character(tmp_path, robot(body("ball", '<sphere radius="0.3"/>')), yaml)

    warnings = [
        line for line in plan_hold(str(file), terrain=terrain).warnings if "below the" in line
    ]

    assert len(warnings) == (depth is not None)
    assert all(f"link 'ball' is {depth} m deep" in line for line in warnings)


def test_where_nought_is_beyond_the_limits_it_rests_at_the_nearest_one(tmp_path: Path) -> None:
    limit = '<limit lower="0.2" upper="0.7" effort="5" velocity="9"/>'
    file = write_urdf(tmp_path, link("a"), link("b"), joint("knee", "a", "b", limit=limit))

    character = load_character(file)

    assert character.rest_position[-1] == 0.2
    assert any("rests there: knee at 0.2" in line for line in character.warnings)


def test_a_run_without_collisions_needs_no_meshes_and_repeats(tmp_path: Path) -> None:
    parts = body("base", '<mesh filename="gone.dae"/>'), link("arm"), joint("j", "base", "arm")
    path = write_character(tmp_path, robot(*parts), "fixed_base: true\nautomatic_gains: 5\n")

    plan = make_plan(str(path), 0.1, {"reference": "hold"}, {}, {"collision": "none"})

    assert plan.simulator["collision"] == "none"  # set on one side, it counts on both
    (moved,) = moved_at_end(plan)
    assert moved == pytest.approx(0.0, abs=1e-12)
    line = refusal(path)
    assert f"looked for {tmp_path / 'gone.dae'}" in line and "collision: none" in line


# Its gains


def test_an_arm_is_critically_damped_by_what_hangs_on_the_joint(tmp_path: Path) -> None:
    """1 kg at 2 m from an axis of x, and 1 kg m^2 of its own."""
    arm = link("arm", inertial(origin='<origin xyz="0 0 -2"/>'))
    file = write_fixed(tmp_path, arm, joint("hinge", "base", "arm"))

    gains = load_character(file).gains["hinge"]

    assert gains.stiffness == pytest.approx(5.0 * SPEED**2)
    assert gains.damping == pytest.approx(2.0 * 5.0 * SPEED)


def test_of_a_floating_pair_it_is_the_reduced_inertia(tmp_path: Path) -> None:
    """Two wheels of 1 and 1.5 kg m^2 about one axis: I1 I2 / (I1 + I2)."""
    file = write_urdf(
        tmp_path, link("a"), link("b", inertial(moment=1.5)), joint("axle", "a", "b", "continuous")
    )

    gains = load_character(file).gains["axle"]

    assert gains.stiffness == pytest.approx(0.6 * SPEED**2)


def test_a_joint_over_the_ground_moves_the_rest_of_the_body(tmp_path: Path) -> None:
    """A trunk of 1 kg, 1 kg m^2, 1.5 m over the ankle of a foot; both bounds are far."""
    ankle = joint("ankle", "trunk", "foot", inside='<origin xyz="0 0 -1.5"/>')
    foot = link(
        "foot",
        f'{inertial()}<collision><geometry><box size=".3 .3 .1"/></geometry></collision>',
    )

    gains = load_character(write_urdf(tmp_path, link("trunk"), foot, ankle)).gains["ankle"]

    assert gains.stiffness == pytest.approx((1.0 + 1.5**2) * SPEED**2)
    assert gains.damping == pytest.approx(2.0 * (1.0 + 1.5**2) * SPEED)


def test_gains_of_the_file_stay_and_passive_damping_counts(tmp_path: Path) -> None:
    parts = (
        link("base"),
        link("a"),
        link("b"),
        joint("one", "base", "a"),
        joint("two", "a", "b", inside='<dynamics damping="3"/>'),
    )
    yaml = "fixed_base: true\nautomatic_gains: 2\njoints: {one: {stiffness: 7, damping: 1}}\n"

    gains = load_character(str(write_character(tmp_path, robot(*parts), yaml))).gains

    assert (gains["one"].stiffness, gains["one"].damping) == (7.0, 1.0)
    assert gains["two"].stiffness == pytest.approx((4.0 * math.pi) ** 2)
    assert gains["two"].damping == pytest.approx(2.0 * 4.0 * math.pi - 3.0)


def test_a_frequency_that_a_tick_cannot_follow_is_refused(tmp_path: Path) -> None:
    file = write_character(tmp_path, robot(link("a")), "automatic_gains: 51\n")

    assert "at most 50 Hz" in refusal(file)


def test_a_limit_too_low_for_the_rest_pose_is_named(tmp_path: Path) -> None:
    """1 kg at 2 m to the side weighs 19.6 N m; the limit is 5."""
    arm = link("arm", inertial(origin='<origin xyz="0 2 0"/>'))
    file = write_fixed(tmp_path, arm, joint("hinge", "base", "arm"))

    warnings = load_character(file).warnings

    assert any("too low to hold the rest pose: hinge (19.6 of at most 5)" in w for w in warnings)


# It stands, and holds


@pytest.mark.slow
@pytest.mark.parametrize(
    "file", ["laikago/laikago_toes_zup.urdf", "mini_cheetah/mini_cheetah.urdf", "r2d2.urdf"]
)
def test_a_robot_of_pybullet_stands(file: str) -> None:
    moved = moved_at_end(plan_hold(str(DATA / file), 2.0))

    assert np.abs(moved).max() < 0.05


def test_an_arm_holds_its_pose_but_for_what_its_stiffness_gives_way(tmp_path: Path) -> None:
    """1 kg at 2 m to the side: the error is the gravity's torque over the stiffness."""
    arm = link("arm", inertial(origin='<origin xyz="0 2 0"/>'))
    limit = '<limit lower="-1" upper="1" effort="50" velocity="9"/>'
    file = write_fixed(tmp_path, arm, joint("hinge", "base", "arm", limit=limit))
    plan = plan_hold(file, 2.0)

    (moved,) = moved_at_end(plan)

    sag = 9.81 * 2.0 / plan.character.gains["hinge"].stiffness
    assert moved == pytest.approx(-sag, rel=1e-2)
