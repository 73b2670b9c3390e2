"""Capsules of a character's shapes: their distances, and legs that a motion keeps apart."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from character_motion.clips.importing import import_bvh
from character_motion.retargeting.optimisation import goals
from character_motion.retargeting.optimisation.capsules import closest_points
from character_motion.retargeting.target_body import TargetBody
from msgs_config.character.dynamics import still_model
from msgs_config.geometry import rotations
from tests.support.capture_makers import MAKERS
from tests.support.captures import Proportions, capture
from tests.support.overlaps import depths
from tests.support.physics import character, random_state

POINT = st.tuples(*[st.floats(-1.0, 1.0, allow_nan=False)] * 3)


@example((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 1.0, 1.2e-7))
@example((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1e-5), (0.0, 1.0, 1e-5))
@example((-2e-4, 0.0, 0.0), (2e-4, 0.0, 0.0), (0.0, -2e-4, 0.0), (0.0, 2e-4, 0.0))
@given(POINT, POINT, POINT, POINT)
def test_no_points_of_two_segments_are_nearer_than_those_found(
    start: tuple[float, ...],
    end: tuple[float, ...],
    first: tuple[float, ...],
    last: tuple[float, ...],
) -> None:
    one, other = np.array((start, end)), np.array((first, last))

    near = closest_points(one, other)

    shares = np.linspace(0.0, 1.0, 41)[:, np.newaxis]
    points = [each[0] + shares * (each[1] - each[0]) for each in (one, other)]
    apart = np.linalg.norm(points[0][:, np.newaxis] - points[1], axis=-1)
    assert np.linalg.norm(near[0] - near[1]) <= apart.min() + 1e-7


def test_capsules_are_as_far_apart_as_the_engine_s_shapes() -> None:
    whole = character("humanoid")
    target, rng = TargetBody(whole), np.random.default_rng(5)
    capsules, names = target.capsules, [link.name for link in whole.links]
    states = [random_state(whole, rng)[0] for _ in range(10)]
    motion = whole.layout.configuration(np.array(states))
    found = depths(whole, motion)

    for frame, state in enumerate(motion.position):
        origins, turns = still_model(whole, state).link_poses()
        near = capsules.nearest(origins[np.newaxis], rotations.matrix(turns)[np.newaxis])
        for (one, other), distance in zip(capsules.pairs, near.distance[0], strict=True):
            first, second = sorted((int(capsules.links[one]), int(capsules.links[other])))
            depth = found[f"{names[first]}-{names[second]}"][frame]
            if "ankle" in names[first] or "ankle" in names[second]:
                continue  # a box has corners, which its capsules have not
            if distance < 0.15:
                assert distance == pytest.approx(-depth, abs=2e-3)


def test_legs_and_arms_that_overlap_in_the_capture_are_kept_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = TargetBody(character("humanoid"))
    narrow = replace(MAKERS["lafan"], proportions=Proportions(hip_width=0.01))
    file = capture(tmp_path / "a.bvh", narrow, "walk")

    apart = depths(target.character, import_bvh(file, target).clip.motion)
    monkeypatch.setattr(goals, "_OVERLAP", 0.0)
    through = depths(target.character, import_bvh(file, target).clip.motion)

    assert max(depth.max() for depth in through.values()) > 0.01
    assert max(depth.max() for depth in apart.values()) < 0.0
