"""Poses of a timeline: whole, mirrored, and between keys."""

import numpy as np
import pytest

from actuated_characters.timeline.poses import (
    mirrored,
    mirrored_rate,
    mirrored_values,
    values_of,
    whole_poses,
)
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.geometry import rotations
from tests.support.physics import character, random_state

HUMANOID = character("humanoid")
ELBOW = HUMANOID.layout.joint("right_elbow").start


def test_a_pose_keeps_what_the_ones_before_say() -> None:
    poses = [
        {"at": 0.0, "pose": {"right_elbow": 1.0, "left_elbow": 0.5}},
        {"at": 1.0, "pose": {"right_elbow": 0.2, "tail": 3.0, "left_knee": True}},
    ]

    pose = whole_poses(HUMANOID, poses)[1]

    named = values_of(HUMANOID, pose, ["right_elbow", "left_elbow", "left_knee"])
    assert named == {"right_elbow": 0.2, "left_elbow": 0.5, "left_knee": 0.0}


def test_mirrored_twice_is_the_same_and_once_the_other_side() -> None:
    position, _ = random_state(HUMANOID, np.random.default_rng(1))
    position = np.clip(position, *HUMANOID.position_bounds())
    pose = HUMANOID.layout.configuration(position)

    image = mirrored(HUMANOID, pose)
    twice = mirrored(HUMANOID, image)

    assert twice.position == pytest.approx(pose.position, abs=1e-9)
    layout = HUMANOID.layout
    assert image.position[layout.joint("left_elbow").start] == position[ELBOW]
    assert image.position[:3] == pytest.approx(position[:3] * (1.0, -1.0, 1.0))
    assert mirrored_values(HUMANOID, [{"at": 0.0, "pose": {"right_elbow": 0.7}}], 0) == {
        "left_elbow": pytest.approx(0.7)
    }


def test_a_mirrored_rate_is_how_the_mirror_image_moves() -> None:
    layout, step = HUMANOID.layout, 1e-5  # s
    position, _ = random_state(HUMANOID, np.random.default_rng(1))
    pose = layout.configuration(0.5 * np.clip(position, *HUMANOID.position_bounds()))
    velocity = np.random.default_rng(2).uniform(-1.0, 1.0, layout.size)
    turns = step * velocity[layout.rotation_entries]
    moved = GeneralizedPosition(
        pose.position + step * velocity,
        rotations.multiply(pose.orientations_xyzw, rotations.exp(turns)),
    )

    way = layout.difference(mirrored(HUMANOID, pose), mirrored(HUMANOID, moved)) / step
    named = dict(zip(layout.dof_names, velocity.tolist(), strict=True))
    image = mirrored_rate(HUMANOID, {**named, "tail": 1.0})

    assert list(image) == list(layout.dof_names)
    assert list(image.values()) == pytest.approx(way, abs=1e-6)
    assert mirrored_rate(HUMANOID, {"right_elbow": 0.7}) == {"left_elbow": pytest.approx(0.7)}
