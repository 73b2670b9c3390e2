"""Inverse kinematics: MuJoCo's kinematics as the oracle, limits, feet that stay, no blow-up."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller_node.references.posing import Posed, Posing, Target
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character, Placement, Vector
from msgs_config.errors import MotionError
from msgs_config.geometry import rotations
from tests.support.physics import character
from tests.support.urdf import joint, link, robot, write_character

HUMANOID = character("humanoid")
HANDLES = ("right_wrist", "left_wrist", "right_elbow", "neck", "chest", "left_knee", "base")
COORDINATES = st.floats(-3.0, 3.0)
PLACES = st.tuples(COORDINATES, COORDINATES, COORDINATES)
FAR_M = 1e6


def standing(body: Character) -> GeneralizedPosition:
    """The rest pose, at the limits where that is beyond; the humanoid's knees bent."""
    position = np.array(body.rest_position)
    if body.name == HUMANOID.name:
        for name in ("right_knee", "left_knee"):
            position[body.layout.joint(name).entries] = -0.3
    return body.layout.configuration(position)


def bounds(body: Character) -> tuple[FloatArray, FloatArray]:
    lower, upper = body.position_bounds()
    for each in body.moving_joints:
        if each.soft_limit is not None:
            entries = body.layout.joint(each.name).entries
            lower[entries], upper[entries] = each.soft_limit.lower, each.soft_limit.upper
    return lower, upper


def frames(body: Character, pose: GeneralizedPosition) -> tuple[FloatArray, FloatArray]:
    """Places (l, 3) and axes (l, 3, 3) of all links, by MuJoCo's kinematics."""
    model = DynamicsModel(body)
    model.update(pose.position, np.zeros(body.layout.size))
    places, axes = model.link_frames(np.arange(len(body.links)))
    return places.copy(), axes.copy()


def numbers_of(body: Character, names: tuple[str, ...]) -> list[int]:
    return [[each.name for each in body.links].index(name) for name in names]


def random_pose(body: Character, seed: int) -> GeneralizedPosition:
    """Anywhere, turned, every joint within its limits."""
    rng, (lower, upper) = np.random.default_rng(seed), bounds(body)
    lower, upper = np.maximum(lower, -1.5), np.minimum(upper, 1.5)
    return body.layout.configuration(rng.uniform(lower, upper))


@pytest.mark.parametrize("name", ["humanoid", "franka_panda", "laikago", "kuka"])
def test_links_are_where_mujoco_has_them(name: str) -> None:
    body = character(name)
    pose = random_pose(body, 1)

    places, axes = frames(body, pose)

    for number, each in enumerate(body.links):
        place, turn = Posing(body).frame(pose, each.name)
        assert place == pytest.approx(places[number], abs=1e-12)
        assert rotations.matrix(turn) == pytest.approx(axes[number], abs=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_what_another_pose_has_is_reached_with_both_feet_where_they_are(seed: int) -> None:
    """Targets of a pose whose feet stand at the same place can be had, all of them."""
    posing, pose = Posing(HUMANOID), standing(HUMANOID)
    rng = np.random.default_rng(seed)
    away = HUMANOID.layout.configuration(pose.position.copy())
    away.position[:3] += rng.uniform((-0.1, -0.1, -0.2), (0.1, 0.1, 0.0))
    arms = HUMANOID.layout.mask(["right_shoulder", "left_shoulder", "right_elbow", "chest"])
    away.position[arms] = random_pose(HUMANOID, seed).position[arms]
    goal = posing.fit(
        HUMANOID.layout.configuration(away.position),
        [Target(foot, tuple(posing.frame(pose, foot)[0]), weight=1e4) for foot in HUMANOID.feet],
        free=HUMANOID.layout.mask(
            ["right_hip", "right_knee", "right_ankle", "left_hip", "left_knee", "left_ankle"]
        ),
    )
    names = ("right_wrist", "left_wrist", "neck")
    places = frames(HUMANOID, goal.pose)[0][numbers_of(HUMANOID, names)]
    wanted = [Target(name, tuple(place)) for name, place in zip(names, places, strict=True)]

    found = posing.fit(pose, wanted, holds=HUMANOID.feet)

    assert found.reached
    assert_kept(found, pose, names, places, within=1e-3)


def assert_kept(
    found: Posed,
    before: GeneralizedPosition,
    names: tuple[str, ...],
    places: FloatArray,
    within: float,
) -> None:
    """By MuJoCo: links are at their places, and the feet where they were."""
    now, axes = frames(HUMANOID, found.pose)
    then, axes_then = frames(HUMANOID, before)
    feet = numbers_of(HUMANOID, HUMANOID.feet)
    assert now[numbers_of(HUMANOID, names)] == pytest.approx(places, abs=within)
    assert now[feet] == pytest.approx(then[feet], abs=1e-3)
    assert axes[feet] == pytest.approx(axes_then[feet], abs=1e-2)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(HANDLES), PLACES), min_size=1, max_size=3))
def test_any_places_leave_feet_and_limits_kept(wanted: list[tuple[str, Vector]]) -> None:
    """Far more than half of them are out of reach."""
    posing, pose = Posing(HUMANOID), standing(HUMANOID)
    targets = [Target(name, place) for name, place in wanted]

    found = posing.fit(pose, targets, holds=HUMANOID.feet)
    again = posing.fit(pose, targets, holds=HUMANOID.feet)

    lower, upper = bounds(HUMANOID)
    assert (found.pose.position >= np.minimum(lower, pose.position) - 1e-9).all()
    assert (found.pose.position <= np.maximum(upper, pose.position) + 1e-9).all()
    assert_kept(found, pose, (), np.empty((0, 3)), within=0.0)
    assert found.pose.position.tobytes() == again.pose.position.tobytes()
    assert found.pose.orientations_xyzw.tobytes() == again.pose.orientations_xyzw.tobytes()
    by_mujoco = frames(HUMANOID, found.pose)[0]
    off = by_mujoco[numbers_of(HUMANOID, tuple(t.link for t in targets))] - [
        t.place for t in targets
    ]
    assert found.errors == pytest.approx(np.linalg.norm(off, axis=1), abs=1e-9)
    assert found.residual == found.errors.max()


@pytest.mark.parametrize("distance", [2.0, 20.0, FAR_M])
def test_an_arm_stretches_towards_what_is_out_of_reach(distance: float) -> None:
    posing, pose = Posing(HUMANOID), standing(HUMANOID)
    shoulder = posing.frame(pose, "right_shoulder")[0]
    way = np.array((0.6, -0.64, 0.48))
    target = Target("right_wrist", tuple(shoulder + distance * way))

    found = posing.fit(pose, [target], free=posing.chain("right_wrist"))

    hand = posing.frame(found.pose, "right_wrist")[0] - shoulder
    assert not found.reached
    assert hand / np.linalg.norm(hand) == pytest.approx(way, abs=5e-3)
    assert np.linalg.norm(hand) == pytest.approx(0.274788 + 0.258947, abs=1e-3)


def test_an_arm_reaches_before_the_trunk_bends_or_the_pelvis_moves() -> None:
    posing, pose = Posing(HUMANOID), standing(HUMANOID)
    shoulder = posing.frame(pose, "right_shoulder")[0]
    target = Target("right_wrist", tuple(shoulder + np.array((0.4, -0.1, 0.1))))

    found = posing.fit(pose, [target], holds=HUMANOID.feet)

    assert found.reached
    moved = np.abs(HUMANOID.layout.difference(pose, found.pose))
    assert moved[HUMANOID.layout.mask(["chest"])].max() < 0.15
    assert moved[:3].max() < 0.02
    assert moved[HUMANOID.layout.mask(["right_shoulder"])].max() > 1.0


def test_a_hand_that_is_dragged_out_of_reach_and_back_never_jumps() -> None:
    posing, pose = Posing(HUMANOID), standing(HUMANOID)
    start = posing.frame(pose, "right_wrist")[0]
    hands, last = [], pose
    for share in np.concatenate((np.linspace(0.0, 1.0, 60), np.linspace(1.0, 0.0, 60))):
        target = Target("right_wrist", tuple(start + share * np.array((1.5, -0.5, 1.2))))
        last = posing.fit(pose, [target], holds=HUMANOID.feet, start=last).pose
        hands.append(posing.frame(last, "right_wrist")[0])

    ways = np.linalg.norm(np.diff(hands, axis=0), axis=1)
    assert ways.max() < 2.0 * 2.0 / 60  # the target itself moves 2 m in 60 steps
    assert hands[-1] == pytest.approx(start, abs=1e-3)


def test_what_may_not_move_stays_to_the_bit_and_what_is_not_asked_for_nearly() -> None:
    posing, pose = Posing(HUMANOID), random_pose(HUMANOID, 5)
    arm = posing.chain("left_wrist")
    place = posing.frame(pose, "left_wrist")[0] + 0.05

    found = posing.fit(pose, [Target("left_wrist", tuple(place))], free=arm)
    same = posing.fit(pose, [Target("left_wrist", tuple(posing.frame(pose, "left_wrist")[0]))])

    names = {HUMANOID.layout.dof_names[index] for index in np.flatnonzero(arm)}
    assert names == {"left_elbow", *(f"left_shoulder_{axis}" for axis in "xyz")}
    assert found.pose.position[~arm].tobytes() == pose.position[~arm].tobytes()
    assert same.reached
    assert same.pose.position == pytest.approx(pose.position, abs=1e-9)


def test_a_hand_is_turned_as_it_is_to_be() -> None:
    posing, pose = Posing(HUMANOID), standing(HUMANOID)
    goal, arm = HUMANOID.layout.configuration(pose.position.copy()), posing.chain("right_wrist")
    goal.position[arm] = (-0.7, 0.4, 0.5, 1.0)
    place, wanted = posing.frame(HUMANOID.layout.configuration(goal.position), "right_wrist")

    target = Target("right_wrist", tuple(place), orientation_xyzw=tuple(wanted))
    found = posing.fit(pose, [target], holds=HUMANOID.feet)

    assert found.reached
    found_turn = posing.frame(found.pose, "right_wrist")[1]
    assert rotations.angle_between(found_turn, wanted) < 1e-3


def test_a_head_looks_at_a_point() -> None:
    posing, pose = Posing(HUMANOID), standing(HUMANOID)
    point, forward = (2.0, 0.8, 1.2), (1.0, 0.0, 0.0)

    aimed = posing.aim(pose, "neck", forward, point)
    found = posing.fit(pose, [aimed], free=HUMANOID.layout.mask(["neck"]))

    place, turn = posing.frame(found.pose, "neck")
    way = np.array(point) - place
    assert found.reached
    assert rotations.rotate(turn, np.array(forward)) == pytest.approx(
        way / np.linalg.norm(way), abs=1e-3
    )


@pytest.mark.parametrize("yaw", [0.5, 2.0, 3.1, -2.5])
def test_where_a_character_stands_and_faces_does_not_matter(yaw: float) -> None:
    placement = Placement(x=3.0, y=-2.0, yaw=yaw)
    placed, place = HUMANOID.placed(placement), np.array((0.4, -0.3, 1.3))
    here, there = standing(HUMANOID), standing(placed)

    found = Posing(HUMANOID).fit(here, [Target("right_wrist", tuple(place))], holds=HUMANOID.feet)
    moved = tuple(placement.moved(place, np.array(rotations.IDENTITY_XYZW))[0])
    again = Posing(placed).fit(there, [Target("right_wrist", moved)], holds=HUMANOID.feet)

    assert found.reached and again.reached
    assert again.pose.position[6:] == pytest.approx(found.pose.position[6:], abs=1e-5)


@pytest.mark.parametrize("name", ["franka_panda", "kuka"])
@pytest.mark.parametrize("seed", range(5))
def test_an_arm_reaches_what_another_pose_of_it_has(name: str, seed: int) -> None:
    body = character(name)
    posing, goal = Posing(body), random_pose(body, seed)
    end = body.links[-1].name
    place, turn = posing.frame(goal, end)
    start = body.layout.configuration(0.7 * goal.position + 0.3 * standing(body).position)

    target = Target(end, tuple(place), orientation_xyzw=tuple(turn))
    found = posing.fit(start, [target])

    lower, upper = bounds(body)
    assert found.reached
    assert (found.pose.position >= np.minimum(lower, start.position)).all()
    assert (found.pose.position <= np.maximum(upper, start.position)).all()
    model = frames(body, found.pose)[0][len(body.links) - 1]
    assert model == pytest.approx(place, abs=1e-3)


def test_three_feet_of_a_robot_stay_where_its_fourth_is_dragged() -> None:
    laikago = character("laikago")
    posing, pose = Posing(laikago), standing(laikago)
    feet = [laikago.links[number].name for number in laikago.end_effectors]
    before = [posing.frame(pose, foot)[0] for foot in feet]

    target = Target(feet[0], tuple(before[0] + (0.05, 0.0, 0.1)))
    stay = [
        Target(foot, tuple(place), weight=100.0)
        for foot, place in zip(feet[1:], before[1:], strict=True)
    ]
    found = posing.fit(pose, [target, *stay])

    assert found.reached


def test_what_mimics_a_joint_follows_it(tmp_path: Path) -> None:
    limit = '<limit lower="-2" upper="2" effort="1" velocity="1"/>'
    mimic = '<axis xyz="0 0 1"/><mimic joint="first" multiplier="0.5" offset="0.1"/>'
    chain = robot(
        link("base"),
        link("one"),
        link("two"),
        joint("first", "base", "one", inside='<axis xyz="0 0 1"/>', limit=limit),
        joint("second", "one", "two", inside=f'<origin xyz="1 0 0"/>{mimic}', limit=limit),
    )
    body = load_character(write_character(tmp_path, chain, "fixed_base: true"))
    posing, pose = Posing(body), body.layout.configuration(np.array((0.0, 0.1)))
    goal = body.layout.configuration(np.array((0.8, 0.5)))
    tip = (1.0, 0.0, 0.0)

    found = posing.fit(pose, [Target("two", tuple(posing.place(goal, "two", tip)), tip)])

    assert found.reached
    assert found.pose.position == pytest.approx(goal.position, abs=1e-3)


HASH = """
import hashlib
from tests.controller_node.references.test_posing import *
print(hashlib.sha256(found_of(3).pose.position.tobytes()).hexdigest())
"""


def found_of(seed: int) -> Posed:
    """What is found for three places, some of them out of reach."""
    posing, pose = Posing(HUMANOID), standing(HUMANOID)
    rng = np.random.default_rng(seed)
    targets = [
        Target(name, tuple(posing.frame(pose, name)[0] + 0.3 * rng.normal(size=3)))
        for name in ("right_wrist", "left_wrist", "neck")
    ]
    return posing.fit(pose, targets, holds=HUMANOID.feet)


@pytest.mark.slow
def test_the_processors_kernels_do_not_matter() -> None:
    features = " ".join(np._core._multiarray_umath.__cpu_dispatch__)
    other = {"NPY_DISABLE_CPU_FEATURES": features, "OPENBLAS_CORETYPE": "Nehalem"}

    apart = subprocess.run(
        [sys.executable, "-c", HASH],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[3],
        env=os.environ | other,
    )

    own = hashlib.sha256(found_of(3).pose.position.tobytes()).hexdigest()
    assert apart.stdout.strip() == own


def test_an_unknown_link_is_named_with_those_that_there_are() -> None:
    with pytest.raises(MotionError, match=r"'hand'.*right_wrist"):
        Posing(HUMANOID).fit(standing(HUMANOID), [Target("hand", (0.0, 0.0, 0.0))])
