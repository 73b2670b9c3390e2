"""What of a character can be taken, what stands, and what a drag moves."""

import numpy as np
import pytest

from actuated_characters.viewer.editor.handles import Drag, Handle, handles_of, standing_links
from controller_node.references.posing import Posing
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Character
from tests.support.physics import character

HUMANOID = character("humanoid")
POSING = Posing(HUMANOID)


def rest(body: Character, height: float = 0.0) -> GeneralizedPosition:
    position = np.array(body.rest_position)
    position[2] += height
    return body.layout.configuration(position)


def handle_of(name: str) -> Handle:
    found = {HUMANOID.links[each.row].name: each for each in handles_of(HUMANOID)}
    return found[name]


def drag(name: str, pose: GeneralizedPosition, *, limb_alone: bool = False) -> Drag:
    stands = standing_links(HUMANOID, pose)
    return Drag(POSING, HUMANOID, pose, handle_of(name), limb_alone=limb_alone, stands=stands)


def test_a_humanoid_is_taken_at_ends_middle_joints_pelvis_and_chest() -> None:
    sides = {f"{side}_{name}" for side in ("left", "right") for name in
             ("wrist", "elbow", "knee", "ankle")}  # fmt: skip

    names = {HUMANOID.links[each.row].name for each in handles_of(HUMANOID)}

    assert names == sides | {"base", "chest", "neck"}


@pytest.mark.parametrize("name", ["franka_panda", "laikago", "kuka", "pendulum"])
def test_any_character_has_handles_at_its_ends(name: str) -> None:
    body = character(name)

    rows = {each.row for each in handles_of(body)}

    assert set(body.end_effectors) <= rows
    assert (0 in rows) == body.layout.has_floating_base


def test_feet_stand_on_the_ground_alone() -> None:
    assert standing_links(HUMANOID, rest(HUMANOID)) == HUMANOID.feet
    assert standing_links(HUMANOID, rest(HUMANOID, 0.1)) == ()
    assert standing_links(character("kuka"), rest(character("kuka"))) == ()


def test_a_hand_that_is_dragged_leaves_feet_where_they_stand() -> None:
    pose = rest(HUMANOID)
    held = drag("right_wrist", pose)

    found = held.pose(held.place + np.array((0.5, 0.1, 0.3)))

    for foot in HUMANOID.feet:
        place, turn = POSING.frame(found, foot)
        assert place == pytest.approx(POSING.frame(pose, foot)[0], abs=1e-3)
        assert turn == pytest.approx(POSING.frame(pose, foot)[1], abs=5e-3)
    hand = POSING.place(found, "right_wrist", handle_of("right_wrist").point)
    assert hand == pytest.approx(held.place + np.array((0.5, 0.1, 0.3)), abs=2e-3)


def test_a_foot_that_is_dragged_leaves_the_other_one_alone() -> None:
    pose = rest(HUMANOID)
    held = drag("right_ankle", pose)

    found = held.pose(held.place + np.array((0.2, 0.0, 0.2)))

    assert POSING.frame(found, "left_ankle")[0] == pytest.approx(
        POSING.frame(pose, "left_ankle")[0], abs=1e-3
    )
    foot = POSING.place(found, "right_ankle", handle_of("right_ankle").point)
    assert foot == pytest.approx(held.place + np.array((0.2, 0.0, 0.2)), abs=2e-3)


def test_in_the_air_a_hand_leaves_the_root_and_the_pelvis_takes_all_along() -> None:
    pose = rest(HUMANOID, 0.5)
    hand, pelvis = drag("right_wrist", pose), drag("base", pose)

    reached = hand.pose(hand.place + np.array((0.1, 0.0, 0.2)))
    moved = pelvis.pose(pelvis.place + np.array((0.3, 0.0, 0.2)))

    assert reached.position[:6].tolist() == pose.position[:6].tolist()
    assert moved.position[:3] == pytest.approx(
        pose.position[:3] + np.array((0.3, 0.0, 0.2)), abs=1e-2
    )
    assert moved.position[6:].tolist() == pose.position[6:].tolist()


def test_a_limb_alone_is_all_that_moves() -> None:
    pose = rest(HUMANOID)
    held = drag("right_wrist", pose, limb_alone=True)

    found = held.pose(held.place + np.array((2.0, 0.0, 2.0)))

    arm = POSING.chain("right_wrist")
    assert found.position[~arm].tolist() == pose.position[~arm].tolist()
    assert not np.allclose(found.position[arm], pose.position[arm])


@pytest.mark.parametrize("way", [(0.0, -0.25, 0.55), (0.0, 0.0, 0.3), (0.0, -0.1, 0.8)])
def test_a_straight_arm_bends_where_its_hand_is_dragged_nearer(
    way: tuple[float, float, float],
) -> None:
    held = drag("right_wrist", rest(HUMANOID), limb_alone=True)
    begin, point = held.place.copy(), handle_of("right_wrist").point

    for share in np.linspace(0.05, 1.0, 20):
        wanted = begin + share * np.array(way)
        place = POSING.place(held.pose(wanted), "right_wrist", point)
        assert place == pytest.approx(wanted, abs=2e-3)


@pytest.mark.parametrize(
    "way",
    [(0.0, 0.0, 0.2), (0.3, 0.0, 0.2), (0.5, 0.0, 0.4), (0.0, -0.4, 0.3), (0.1, 0.1, 0.5)],
)
def test_an_arm_that_is_long_enough_moves_alone(way: tuple[float, float, float]) -> None:
    """Of a pose that the arm alone can have, the trunk has no share."""
    pose = rest(HUMANOID)
    whole, alone = drag("right_wrist", pose), drag("right_wrist", pose, limb_alone=True)

    for share in np.linspace(0.1, 1.0, 10):
        wanted = whole.place + share * np.array(way)
        found, expected = whole.pose(wanted), alone.pose(wanted)
        place = POSING.place(found, "right_wrist", handle_of("right_wrist").point)
        assert place == pytest.approx(wanted, abs=1e-3)
        assert found.position.tolist() == expected.position.tolist()


def test_the_trunk_follows_once_the_arm_is_straight_and_without_a_jump() -> None:
    pose = rest(HUMANOID)
    held, names = drag("right_wrist", pose), [link.name for link in HUMANOID.links]
    elbow, trunk = (HUMANOID.layout.joint(name) for name in ("right_elbow", "chest"))
    step, before = np.array((0.8, 0.0, 0.5)) / 80.0, None
    leant = 0

    for number in range(1, 81):
        found = held.pose(held.place + number * step)
        places = np.array([POSING.frame(found, name)[0] for name in names])
        if before is not None:
            assert np.linalg.norm(places - before, axis=1).max() < 5.0 * np.linalg.norm(step)
        before = places
        if np.abs(found.position[trunk.entries] - pose.position[trunk.entries]).max() > 0.02:
            leant += 1
            assert np.degrees(found.position[elbow.start]) < 15.0

    assert 0 < leant < 40


def test_a_foot_that_is_lifted_bends_its_knee_and_leaves_the_rest() -> None:
    pose = rest(HUMANOID)
    held = drag("right_ankle", pose)

    found = held.pose(held.place + np.array((0.0, 0.0, 0.2)))

    leg = POSING.chain("right_ankle")
    assert found.position[~leg].tolist() == pose.position[~leg].tolist()
    assert abs(found.position[HUMANOID.layout.joint("right_knee").start]) > 0.5
    foot = POSING.place(found, "right_ankle", handle_of("right_ankle").point)
    assert foot == pytest.approx(held.place + np.array((0.0, 0.0, 0.2)), abs=1e-3)


def test_the_pelvis_goes_down_onto_bent_knees_above_the_same_feet() -> None:
    pose = rest(HUMANOID)
    held = drag("base", pose)

    found = held.pose(held.place - np.array((0.0, 0.0, 0.2)))

    assert found.position[2] == pytest.approx(pose.position[2] - 0.2, abs=5e-3)
    for foot in HUMANOID.feet:
        assert POSING.frame(found, foot)[0] == pytest.approx(POSING.frame(pose, foot)[0], abs=1e-3)


def test_a_knee_above_a_foot_that_stands_leaves_that_where_it_is() -> None:
    pose = rest(HUMANOID)
    held = drag("right_knee", pose)

    found = held.pose(held.place + np.array((0.1, -0.05, 0.0)))

    place = POSING.frame(found, "right_ankle")[0]
    assert place == pytest.approx(POSING.frame(pose, "right_ankle")[0], abs=1e-3)
