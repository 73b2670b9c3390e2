"""Inverse kinematics: its derivatives against differences, and what it reaches."""

from dataclasses import replace

import numpy as np
import pytest

from character_motion.retargeting.optimisation.goals import Goals
from character_motion.retargeting.optimisation.inverse_kinematics import InverseKinematics
from character_motion.retargeting.target_body import TargetBody
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.geometry import rotations
from tests.support.physics import character, random_state

FRAMES, FRAME_TIME = 6, 1.0 / 60.0


@pytest.fixture(scope="module")
def target() -> TargetBody:
    return TargetBody(character("humanoid"))


def moved(target: TargetBody, motion: GeneralizedPosition, step: np.ndarray) -> GeneralizedPosition:
    entries = target.character.layout.rotation_entries
    turns = rotations.multiply(motion.orientations_xyzw, rotations.exp(step[:, entries]))
    positions = motion.position + step
    positions[:, entries] = rotations.log(turns)
    return GeneralizedPosition(positions, turns)


def goals_of(target: TargetBody, motion: GeneralizedPosition) -> Goals:
    """The turns and places that some links have in a motion; feet, hands and head."""
    model, layout = DynamicsModel(target.character), target.character.layout
    links = np.array([target.map[r] for r in ("pelvis", "head", "left_ankle", "right_wrist")])
    offsets = np.array([(0.0, 0.1, 0.0)] * len(links))
    turns, places = [], []
    for position in motion.position:
        model.update(position, np.zeros(layout.size))
        origins, all_turns = model.link_poses()
        turns.append(all_turns[links])
        places.append(origins[links] + rotations.rotate(all_turns[links], offsets))
    shape = (len(motion.position), len(links))
    return Goals(
        links=links,
        turns_xyzw=np.array(turns),
        turn_weights=np.tile(10.0 * np.eye(3), (*shape, 1, 1)),
        point_links=links,
        point_offsets=offsets,
        places=np.array(places),
        place_weights=np.full((*shape, 3), 30.0),
        surface=target.surface,
        clearance=np.full((shape[0], len(target.surface.links)), -10.0),
        ground_weight=1000.0,
        capsules=target.capsules,
        overlap_weight=500.0,
        limit_weight=200.0,
        acceleration=np.full(layout.size, 100.0),
    )


def still(target: TargetBody) -> GeneralizedPosition:
    """The rest pose with bent knees and elbows, so that all can move."""
    layout = target.character.layout
    position = np.array(target.character.rest_position)
    for name, angle in (("left_knee", -0.4), ("right_knee", -0.5), ("left_elbow", 0.6)):
        position[layout.joint(name).start] = angle
    position[layout.joint("right_elbow").start] = 0.7
    return layout.configuration(np.tile(position, (FRAMES, 1)))


def test_residuals_change_as_their_jacobians_say(target: TargetBody) -> None:
    rng = np.random.default_rng(3)
    layout = target.character.layout
    state, _ = random_state(target.character, rng)
    motion = layout.configuration(np.tile(state, (FRAMES, 1)))
    near = moved(target, motion, rng.normal(0.0, 1e-4, motion.position.shape))
    goals = replace(goals_of(target, near), clearance=np.ones((FRAMES, len(target.surface.links))))
    solver = InverseKinematics(target, FRAME_TIME)
    step = rng.normal(0.0, 1e-6, motion.position.shape)

    weights = np.ones(layout.size)
    before = solver._linearised(motion, goals, weights)
    after = solver._linearised(moved(target, motion, step), goals, weights)

    for one, other in ((before.wanted, after.wanted), (before.bounded, after.bounded)):
        predicted = one[1] - np.matmul(one[0], step[..., np.newaxis])[..., 0]
        scale = np.abs(one[1] - other[1]).max()
        np.testing.assert_allclose(predicted, other[1], rtol=0.0, atol=1e-3 * scale)


def test_links_reach_where_they_were(target: TargetBody) -> None:
    rng = np.random.default_rng(5)
    start = still(target)
    way = np.tile(rng.normal(0.0, 0.15, start.position.shape[1]), (FRAMES, 1))
    wanted = moved(target, start, way)
    goals = goals_of(target, wanted)

    found = InverseKinematics(target, FRAME_TIME).solve(start, goals)

    reached = goals_of(target, found)
    np.testing.assert_allclose(reached.places, goals.places, atol=2e-3)
    apart = rotations.angle_between(reached.turns_xyzw, goals.turns_xyzw)
    assert apart.max() < 5e-3


def test_nothing_is_below_the_ground_or_beyond_a_limit(target: TargetBody) -> None:
    start = still(target)
    down = np.zeros(start.position.shape)
    down[:, 2] = -0.3  # m: the places are below the ground
    below = moved(target, start, down)
    surface = target.surface
    goals = replace(goals_of(target, below), clearance=np.zeros((FRAMES, len(surface.links))))

    found = InverseKinematics(target, FRAME_TIME).solve(below, goals)

    model, layout = DynamicsModel(target.character), target.character.layout
    lower, upper = target.bounds
    for position in found.position:
        model.update(position, np.zeros(layout.size))
        origins, turns = model.link_poses()
        arms = rotations.rotate(turns[surface.links], surface.offsets)
        heights = origins[surface.links, 2] + arms[:, 2] - surface.radii
        assert heights.min() > -2e-3
        assert (position > lower - 5e-3).all() and (position < upper + 5e-3).all()
