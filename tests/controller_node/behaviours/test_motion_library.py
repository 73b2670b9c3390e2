"""The library of motion: its distance by definition, and the moment that it finds."""

import math

import mujoco
import numpy as np
import pytest

from controller_node.behaviours.motion_library import MotionLibrary, Window
from controller_node.references.clip import ClipReference
from controller_node.references.transformed import PlanarTransform
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.clips.reading import read_clip
from msgs_config.errors import ActuatedCharactersError, ConfigurationError
from tests.support.physics import character

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
MASSES = np.array([link.mass for link in HUMANOID.links])
LASTING = 0.5  # s
SAMPLES, RATE = 7, 30.0
CLIPS = ["getup_facedown", "walk", "kick"]
LIBRARY = MotionLibrary(HUMANOID, CLIPS, LASTING)
SEEN_FROM_BELOW = np.array((1.0, 1.0, 0.0))


def window(clip: str, time: float, carry: PlanarTransform | None = None) -> Window:
    """A window of a clip, from the engine of the dynamics, and from anywhere on the ground."""
    reference, model = ClipReference(LAYOUT, read_clip(HUMANOID, clip)), DynamicsModel(HUMANOID)
    origins, turns, root = [], [], None
    for number in range(SAMPLES):
        state = (carry or PlanarTransform()).moved(LAYOUT, reference.sample(time + number / RATE))
        root = state.configuration.position[:3] if root is None else root
        model.update(state.configuration.position, state.velocity)
        places, axes = model.link_poses()
        origins.append(places - SEEN_FROM_BELOW * root)
        turns.append(axes)
    return Window(np.array(origins), np.array(turns))


def lengths() -> FloatArray:
    """Of each link: to its farthest joint, or twice to its centre of mass."""
    ends = [[2.0 * math.hypot(*link.inertial_pose.position)] for link in HUMANOID.links]
    for link in HUMANOID.links[1:]:
        ends[link.parent].append(math.hypot(*link.joint.pose_in_parent.position))
    return np.array([max(*end, 0.05) for end in ends])


def matrix(q_xyzw: FloatArray) -> FloatArray:
    """A quaternion's matrix, by MuJoCo."""
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, np.roll(q_xyzw, 1))
    return axes.reshape(3, 3)


def about_z(angle: float) -> FloatArray:
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def distance(one: Window, other: Window) -> tuple[float, float]:
    """By definition: the other one turned about z, by trial, until the origins are nearest."""
    mean = MASSES / (SAMPLES * MASSES.sum())

    def places(angle: float) -> float:
        apart = one.positions - other.positions @ about_z(angle).T
        return float(((apart**2).sum(axis=2) * mean).sum())

    width, best = math.pi, 0.0
    while width > 1e-9:
        candidates = best + np.linspace(-width, width, 41)
        best = float(min(candidates, key=places))
        width /= 10.0
    total = places(best)
    for sample in range(SAMPLES):
        for link, length in enumerate(lengths()):
            theirs = about_z(best) @ matrix(other.turns_xyzw[sample, link])
            between = theirs.T @ matrix(one.turns_xyzw[sample, link])
            angle = math.acos(min((np.trace(between) - 1.0) / 2.0, 1.0))
            total += float(mean[link]) * (length * angle) ** 2
    return math.sqrt(total), best


def test_the_distance_is_that_of_its_definition() -> None:
    ours = window("walk", 0.31, PlanarTransform(2.0, 1.0, -3.0))
    distances, turns = LIBRARY.distances(ours)

    compared = {"walk": 0.5, "kick": 0.7, "getup_facedown": 0.3}
    for clip, time in compared.items():
        theirs = window(clip, time)
        moment = int(np.flatnonzero((LIBRARY.clips == clip) & np.isclose(LIBRARY.times, time))[0])
        expected, turn = distance(ours, theirs)
        assert distances[moment] == pytest.approx(expected, abs=1e-6)
        assert np.cos(turns[moment] - turn) == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize(("clip", "time"), [("walk", 0.4), ("getup_facedown", 1.0)])
def test_a_moment_is_found_again_wherever_it_happens(clip: str, time: float) -> None:
    match = LIBRARY.nearest(window(clip, time, PlanarTransform(-1.1, 4.0, 2.0)))

    assert (match.clip, match.time) == (clip, pytest.approx(time))
    assert match.distance == pytest.approx(0.0, abs=1e-5)
    assert match.turn == pytest.approx(-1.1, abs=1e-6)
    assert match.median > 0.2


def test_the_search_may_be_kept_to_one_clip() -> None:
    match = LIBRARY.nearest(window("walk", 0.4), among="kick")

    assert match.clip == "kick"
    distances, _ = LIBRARY.distances(window("walk", 0.4))
    of_kick = distances[LIBRARY.clips == "kick"]
    assert match.distance == of_kick.min()
    assert match.median == np.median(of_kick)


def test_a_clip_that_ends_is_left_in_time_and_one_that_wraps_is_whole() -> None:
    ends = {clip: float(read_clip(HUMANOID, clip).times[-1]) for clip in CLIPS}
    latest = {clip: float(LIBRARY.times[LIBRARY.clips == clip].max()) for clip in CLIPS}

    assert ends["kick"] - LASTING - 1.0 / RATE < latest["kick"] <= ends["kick"] - LASTING
    assert ends["walk"] - 2.0 / RATE < latest["walk"] <= ends["walk"] - 1.0 / RATE


def test_the_prediction_begins_with_the_state_and_keeps_its_velocities() -> None:
    # Arrange: a motion of constant velocities, but in ball joints
    position = np.array(HUMANOID.rest_position)
    velocity = np.zeros(LAYOUT.size)
    velocity[:3] = 1.0, -2.0, 0.5

    # Act
    predicted = LIBRARY.predicted(position, velocity)

    # Assert
    moved = predicted.positions - predicted.positions[0]
    times = np.arange(SAMPLES) / RATE
    np.testing.assert_allclose(
        moved, np.einsum("w,i->wi", times, velocity[:3])[:, np.newaxis] + 0 * moved
    )
    assert predicted.positions[0, 0, :2].tolist() == [0.0, 0.0]


def test_without_clips_given_all_of_the_characters_are_there() -> None:
    whole = MotionLibrary(HUMANOID, [], LASTING)

    assert len(whole.references) == 15
    assert len(whole) > 900


@pytest.mark.parametrize(
    ("name", "clips", "lasting", "word"),
    [
        ("humanoid", ["wlak"], LASTING, "did you mean 'walk'"),
        ("kuka", [], LASTING, "no key 'clips'|has none"),
        ("humanoid", ["kick"], 50.0, "50 s"),
    ],
)
def test_an_empty_library_or_an_unknown_clip_is_refused_in_a_line(
    name: str, clips: list[str], lasting: float, word: str
) -> None:
    with pytest.raises(ConfigurationError, match=word) as refused:
        MotionLibrary(character(name), clips, lasting)
    assert isinstance(refused.value, ActuatedCharactersError)
    assert "\n" not in str(refused.value)
