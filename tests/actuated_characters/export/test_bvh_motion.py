"""Characters as BVH: where its joints are, against Bullet, by two readers."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from actuated_characters.export.sources import of_clip
from character_motion.bvh.kinematics import forward_kinematics
from character_motion.bvh.reading import read_bvh
from character_motion.bvh.skeleton import BvhMotion
from character_motion.bvh.writing import bvh_text, write_bvh
from character_motion.export.bvh_motion import to_bvh
from character_motion.export.trajectories import Trajectories
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from tests.support.moving import random_motion
from tests.support.physics import EVERY_CHARACTER, character, character_id

Floats = NDArray[np.float64]
ORDERS = ("ZXY", "ZYX", "XYZ", "YXZ")
TO_FILE = [1, 2, 0]  # of x, y, z: y is up, forward is z
CLOSE = 2e-5  # m: a micrometre and a millionth of a degree, along a chain of joints


def bvh_of(motion: Trajectories, order: str = "ZXY", scale: float = 1.0) -> BvhMotion:
    (trajectory,) = motion.characters
    poses = motion.link_poses(trajectory, motion.sample_times())
    return to_bvh(trajectory.character, poses, motion.rate, order, scale)


def joint_places(text: str) -> dict[str, Floats]:
    """Where each joint is in each frame (f, 3): a second reader, line by line, with matrices."""
    hierarchy, _, rest = text.partition("MOTION")
    rows = np.array([line.split() for line in rest.split("\n")[3:] if line], dtype=float)
    places: dict[str, Floats] = {}
    above: list[tuple[Floats, Floats]] = [
        (np.zeros((len(rows), 3)), np.tile(np.eye(3), (len(rows), 1, 1)))
    ]
    column, name, offset = 0, "", np.zeros(3)
    for words in (line.split() for line in hierarchy.splitlines()):
        match words:
            case ["ROOT" | "JOINT", joint]:
                name = joint
            case ["End", "Site"]:
                name = f"end of {name} {len(places)}"
            case ["OFFSET", *numbers]:
                place, turn = above[-1]
                offset = np.array(numbers, dtype=float)
                above.append((place + turn @ offset, turn))
                places[name] = above[-1][0]
            case ["CHANNELS", _, *channels]:
                place, turn = above[-2]
                shift, own = np.tile(offset, (len(rows), 1)), np.tile(np.eye(3), (len(rows), 1, 1))
                for channel in channels:
                    axis = "XYZ".index(channel[0])
                    if channel.endswith("position"):
                        shift[:, axis] = rows[:, column]
                    else:
                        own = own @ turn_about(axis, rows[:, column])
                    column += 1
                above[-1] = (place + np.einsum("fij,fj->fi", turn, shift), turn @ own)
                places[name] = above[-1][0]
            case ["}"]:
                above.pop()
    assert column == rows.shape[1] and len(above) == 1
    return places


def turn_about(axis: int, degrees: Floats) -> Floats:
    """The matrices (f, 3, 3) of turns about an axis."""
    turn, (i, j) = np.zeros((len(degrees), 3, 3)), ((axis + 1) % 3, (axis + 2) % 3)
    turn[:, axis, axis] = 1.0
    turn[:, i, i] = turn[:, j, j] = np.cos(np.radians(degrees))
    turn[:, j, i] = np.sin(np.radians(degrees))
    turn[:, i, j] = -turn[:, j, i]
    return turn


def moving_links(whole: Character) -> list[tuple[int, str]]:
    """Numbers of the links that move, and their joints' names."""
    return [
        (row, link.joint.name)
        for row, link in enumerate(whole.links)
        if row == 0 or link.joint.type is not JointType.FIXED
    ]


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
def test_every_joint_is_where_bullet_has_it(name: str, order: str, tmp_path: Path) -> None:
    whole = character(name)
    motion, expected = random_motion(whole)
    file = tmp_path / "motion.bvh"

    write_bvh(file, bvh_of(motion, order))

    found = joint_places(file.read_text())
    read = read_bvh(file)
    ours = forward_kinematics(read)
    assert read.frame_time == pytest.approx(1.0 / motion.rate)
    assert len(read.skeleton.names) == len(moving_links(whole))
    for row, joint in moving_links(whole):
        place = expected.origins[:, row][:, TO_FILE]
        np.testing.assert_allclose(found[joint], place, atol=CLOSE)
        number = read.skeleton.names.index(joint)
        np.testing.assert_allclose(ours.positions[:, number], place, atol=CLOSE)


@pytest.mark.parametrize("clip", ["walk", "backflip", "getup_facedown"])
def test_a_clip_keeps_its_joints_and_its_end_sites(clip: str) -> None:
    whole = character("humanoid")
    motion = of_clip(whole, clip)
    poses = motion.link_poses(motion.characters[0], motion.sample_times())

    found = joint_places(bvh_text(bvh_of(motion)))

    for row, joint in moving_links(whole):
        np.testing.assert_allclose(found[joint], poses.origins[:, row][:, TO_FILE], atol=CLOSE)
    hands = [row for row, link in enumerate(whole.links) if link.name.endswith("wrist")]
    ends = [found[name] for name in found if name.startswith("end of") and "elbow" in name]
    for row, end in zip(hands, ends, strict=True):
        np.testing.assert_allclose(end, poses.origins[:, row][:, TO_FILE], atol=CLOSE)


def test_a_bent_knee_is_one_angle_of_its_hinge() -> None:
    whole = character("humanoid")
    position = np.zeros(whole.layout.size)
    position[:6] = whole.rest_position[:6]
    position[2], position[whole.layout.joint("right_knee").start] = 1.0, -0.5
    motion, _ = random_motion(whole)
    still = whole.layout.configuration(position[np.newaxis])
    trajectory = replace(motion.characters[0], configurations=still)
    motion = replace(motion, times=np.zeros(1), characters=(trajectory,))

    written = bvh_of(motion, scale=100.0)

    # the shin swings back by 0.5 rad; in the file that is from down to back, about +x
    skeleton, (values,) = written.skeleton, written.values
    start = skeleton.channel_starts[skeleton.names.index("right_knee")]
    expected = np.zeros(len(values))
    expected[1] = 100.0  # cm, up
    expected[start + skeleton.channels[-1].index("Xrotation")] = np.degrees(0.5)
    np.testing.assert_allclose(values, expected, atol=1e-6)
    places = joint_places(bvh_text(written))
    knee, ankle = places["right_knee"][0], places["right_ankle"][0]
    shin = 100.0 * 0.40987
    np.testing.assert_allclose(
        ankle - knee, (0.0, -shin * np.cos(0.5), -shin * np.sin(0.5)), atol=1e-4
    )
    assert knee[0] < 0.0  # right is -x where forward is z and up is y


def test_names_are_single_words_and_frames_are_evenly_spaced() -> None:
    motion = of_clip(character("humanoid"), "roll")  # whose frames last unequally long

    written = bvh_of(motion)

    assert written.frame_time == pytest.approx(1.0 / motion.rate)
    assert len(written.values) == int(motion.times[-1] * motion.rate) + 1
    assert all(len(name.split()) == 1 for name in written.skeleton.names)
