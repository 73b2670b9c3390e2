"""A character that stands elsewhere, turned: all that it does is what it did, moved."""

import numpy as np
import pytest

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from controller_node.references.clip import ClipReference
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.clips.reading import read_clip
from msgs_config.errors import ConfigurationError
from msgs_config.geometry import rotations
from msgs_config.shared_parameters import placed
from tests.support.physics import DATA, character, controller, link_poses, simulation, still_world

pytestmark = pytest.mark.usefixtures("engine")

ELSEWHERE = [1.5, -2.0, 0.25, 0.7]
FIXED = ["franka_panda", str(DATA / "turned_frames_fixed_y_up.yaml")]


def moved(points: FloatArray) -> FloatArray:
    """Points (..., 3) turned and moved by the textbook's matrix."""
    x, y, z, yaw = ELSEWHERE
    cosine, sine = np.cos(yaw), np.sin(yaw)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    result: FloatArray = points @ turn.T + [x, y, z]
    return result


def elsewhere(name: str) -> Character:
    return placed(character(name), {"placement": ELSEWHERE})


@pytest.mark.parametrize("name", ["humanoid", *FIXED])
def test_no_placement_is_the_character_itself(name: str) -> None:
    assert placed(character(name), {}) is character(name)
    assert placed(character(name), {"placement": [0.0, 0, 0.0, 0]}) is character(name)


@pytest.mark.parametrize("name", ["humanoid", *FIXED])
def test_every_link_of_the_rest_pose_is_moved_and_turned(name: str) -> None:
    origins, turns = rest_frames(character(name))

    moved_origins, moved_turns = rest_frames(elsewhere(name))

    np.testing.assert_allclose(moved_origins, moved(origins), atol=1e-9)
    about_z = np.array([0.0, 0.0, np.sin(0.35), np.cos(0.35)])
    expected = rotations.multiply(about_z, turns)
    assert rotations.angle_between(moved_turns, expected).max() < 1e-7


def rest_frames(whole: Character) -> tuple[FloatArray, FloatArray]:
    with still_world(whole) as world:
        world.body.set_state(np.array(whole.rest_position), np.zeros(whole.layout.size))
        return link_poses(world.body, whole)


@pytest.mark.parametrize("clip", ["spin", "getup_faceup"])
def test_a_clip_is_moved_at_all_times_with_its_velocities(clip: str) -> None:
    at_origin = ClipReference(character("humanoid").layout, read_clip(character("humanoid"), clip))
    whole = elsewhere("humanoid")

    there = ClipReference(whole.layout, read_clip(whole, clip))

    for time in np.linspace(0.0, 12.0, 40):
        state, same = there.sample(float(time)), at_origin.sample(float(time))
        place = same.configuration.position[:3]
        np.testing.assert_allclose(state.configuration.position[:3], moved(place), atol=1e-9)
        turned = moved(same.velocity[:3]) - moved(np.zeros(3))
        np.testing.assert_allclose(state.velocity[:3], turned, atol=1e-9)
        np.testing.assert_allclose(state.velocity[3:], same.velocity[3:], atol=1e-6)
        about_z = rotations.about_z(ELSEWHERE[3])
        expected = rotations.multiply(about_z, same.configuration.orientations_xyzw[0])
        angle = rotations.angle_between(state.configuration.orientations_xyzw[0], expected)
        assert angle < 1e-7


def test_both_sides_are_placed_by_one_setting_and_the_motion_is_the_same_moved() -> None:
    """Until rounding, which contacts amplify, has grown."""
    flat = [*ELSEWHERE[:2], 0.0, ELSEWHERE[3]]
    clip = {"reference": "clip", "clip": "walk"}

    plan = make_plan("humanoid", 0.05, clip, {}, {"placement": flat})
    here = make_plan("humanoid", 0.05, clip, {}, {})
    roots = [
        np.array([tick.following.position[:3] for tick in ticks_in_process(each)])
        for each in (here, plan)
    ]

    assert plan.simulator["placement"] == plan.controller["placement"] == flat
    np.testing.assert_allclose(roots[1], moved(roots[0]) - [0.0, 0.0, ELSEWHERE[2]], atol=1e-4)


def test_different_placements_on_both_sides_are_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"'placement'.*must be the same"):
        make_plan("lift", 1.0, {}, {"placement": ELSEWHERE}, {"placement": [0.0] * 4})


def test_a_fixed_arm_keeps_its_answer_wherever_it_stands() -> None:
    run = simulation("franka_panda")
    state = run.state

    here, _ = controller("franka_panda").compute_effort(state, state.stamp_ns)
    there, _ = controller("franka_panda", placement=ELSEWHERE).compute_effort(state, state.stamp_ns)
    run.close()

    np.testing.assert_allclose(there, here, atol=1e-9)
