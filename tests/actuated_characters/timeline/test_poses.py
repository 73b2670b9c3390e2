"""Poses of a timeline: whole, mirrored, and between keys."""

import math

import numpy as np
import pytest

from actuated_characters.timeline.poses import (
    Preview,
    mirrored,
    mirrored_values,
    values_of,
    whole_poses,
)
from tests.support.physics import character, random_state

HUMANOID = character("humanoid")
ELBOW = HUMANOID.layout.joint("right_elbow").start


def keys(*poses: dict[str, object], **settings: object) -> dict[str, object]:
    return {"keys": [{"name": "a", "poses": list(poses), **settings}]}


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


def test_the_preview_is_at_a_key_what_the_key_says_and_rest_without() -> None:
    content = keys(
        {"at": 1.0, "pose": {"right_elbow": 1.0}},
        {"at": 2.0, "pose": {"right_elbow": 2.0}},
        **{"in": 0.4, "out": 0.4},
    )
    preview = Preview(HUMANOID, content)

    found = [preview.at(time).position[ELBOW] for time in (0.5, 0.8, 1.0, 1.5, 2.0, 2.2, 2.5)]

    assert found == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0, 1.0, 0.0])
    assert Preview(HUMANOID, {}).at(1.0).position == pytest.approx(
        np.array(HUMANOID.rest_position), abs=1e-12
    )


@pytest.mark.parametrize(("ease", "value"), [("smooth", None), ("rest", 0.0), ("linear", 1.0)])
def test_an_ease_is_how_a_key_is_moved_through(ease: str, value: float | None) -> None:
    """By finite differences of the rate just after the middle one of three keys, rad/s."""
    content = keys(
        {"at": 0.0, "pose": {"right_elbow": 0.0}},
        {"at": 1.0, "pose": {"right_elbow": 1.0}, "ease": ease},
        {"at": 2.0, "pose": {"right_elbow": 2.0}},
        out="never",
    )
    preview = Preview(HUMANOID, content)

    early, late = (preview.at(time).position[ELBOW] for time in (1.0, 1.001))

    assert (late - early) / 0.001 == pytest.approx(1.0 if value is None else value, abs=1e-2)
    assert preview.at(9.0).position[ELBOW] == pytest.approx(2.0)


def test_a_later_layer_is_above_an_earlier_one_in_its_own_joints_alone() -> None:
    content = {
        "keys": [
            {"poses": [{"at": 0.0, "pose": {"right_elbow": 1.0, "left_elbow": 1.0}}]},
            {"poses": [{"at": 0.0, "pose": {"right_elbow": 0.5}}]},
        ]
    }

    pose = Preview(HUMANOID, content).at(0.0)

    named = values_of(HUMANOID, pose, ["right_elbow", "left_elbow"])
    assert named == {"right_elbow": pytest.approx(0.5), "left_elbow": pytest.approx(1.0)}
    assert math.isfinite(pose.position.max())
