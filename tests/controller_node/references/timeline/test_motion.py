"""The motion of timelines: layers of poses over clips and steering, without a jump."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from controller_node import parameters as for_controller
from controller_node.references.base import REFERENCES, ReferenceState
from controller_node.references.clip import ClipReference
from controller_node.references.timeline.file import read_timeline
from controller_node.references.timeline.motion import TimelineReference, timeline_motion
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.clips.reading import read_clip
from msgs_config.errors import MotionError
from msgs_config.parameters import Values
from tests.support.motion import (
    assert_consistent,
    assert_moves_as_it_says,
    assert_same_motion,
    assert_same_place,
    loaded,
)

HUMANOID, LAYOUT = loaded("humanoid")
RATE = 240
WAVE = {
    "in": 0.4,
    "out": 0.5,
    "poses": [
        {"at": 1.0, "pose": {"right_elbow": 0.6, **dict.fromkeys(["neck_x", "neck_y"], 0.1)}},
        {"at": 1.5, "pose": {"right_elbow": 1.4}},
        {"at": 2.0, "pose": {"right_elbow": 0.6}},
    ],
}
WAVE["poses"][0]["pose"]["neck_z"] = 0.2  # type: ignore[index]
ELBOW = LAYOUT.dof_names.index("right_elbow")
NECK = [LAYOUT.dof_names.index(f"neck_{axis}") for axis in "xyz"]
SLOW = {"at": 0.5, "until": 3.0, "velocity": [0.1, 0.0, 0.0]}
STILL = {"at": 0, "pose": {"right_elbow": 0.5}}
WALK = {"at": 0.5, "clip": "walk", "from": 0.2}


def made(directory: Path, name: str = "humanoid", **tracks: Any) -> TimelineReference:
    whole, _ = loaded(name)
    file = directory / "moves.yaml"
    file.write_text(yaml.safe_dump(tracks), encoding="utf-8")
    reference = REFERENCES["timeline"](whole, values_of(name, str(file))).reference
    assert isinstance(reference, TimelineReference)
    return reference


def values_of(name: str, file: str) -> Values:
    given = {"character": name, "reference": "timeline", "timeline": file, "rate": RATE}
    return for_controller.resolve_for(loaded(name)[0], given)


def heading(state: ReferenceState) -> float:
    """The way that a humanoid's root faces, rad: of its file's frame, y up and x ahead."""
    x, y, z, w = state.configuration.orientations_xyzw[0].tolist()
    return float(np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z)))


# Layers


def test_a_layer_is_in_each_of_its_poses_when_its_time_comes(tmp_path: Path) -> None:
    reference = made(tmp_path, keys=[WAVE])

    for time, elbow in ((1.0, 0.6), (1.5, 1.4), (2.0, 0.6)):
        position = reference.sample(time).configuration.position
        assert position[ELBOW] == pytest.approx(elbow, abs=1e-12)
        np.testing.assert_allclose(position[NECK], (0.1, 0.1, 0.2), atol=1e-12)


def test_beneath_a_layer_nothing_changes(tmp_path: Path) -> None:
    alone, layered = made(tmp_path, clips=[WALK]), made(tmp_path, clips=[WALK], keys=[WAVE])
    others = np.setdiff1d(np.arange(LAYOUT.size), [ELBOW, *NECK])

    for time in np.arange(0.0, 4.0, 0.01).tolist():
        beneath, state = alone.sample(time), layered.sample(time)
        for name in ("velocity", "acceleration"):
            np.testing.assert_allclose(
                getattr(state, name)[others], getattr(beneath, name)[others], atol=1e-12
            )
        apart = LAYOUT.difference(beneath.configuration, state.configuration)
        np.testing.assert_allclose(apart[others], 0.0, atol=1e-12)
        if time < 0.6 or time >= 2.5:
            assert_same_motion(LAYOUT, beneath, state, atol=1e-15)


def test_a_layer_comes_and_goes_without_a_jump_and_moves_as_it_says(tmp_path: Path) -> None:
    # over steering at rest, since the frames of clips have jumps of their own
    reference = made(tmp_path, keys=[WAVE])

    for time in (0.6, 1.0, 1.5, 2.0, 2.5):
        before, after = reference.sample(time - 1e-9), reference.sample(time + 1e-9)
        assert_same_motion(LAYOUT, before, after, atol=1e-5)
    times = np.random.default_rng(5).uniform(0.3, 2.7, 40)
    assert_moves_as_it_says(LAYOUT, reference.sample, times.tolist(), tolerance=1e-5)


def test_a_pose_to_rest_in_is_come_to_at_rest(tmp_path: Path) -> None:
    poses = [{"at": t, "pose": {"right_elbow": 0.5 * t}, "ease": "rest"} for t in (1.0, 1.5, 2.0)]
    resting, smooth = (
        made(tmp_path, keys=[{"poses": given}])
        for given in (poses, [{**pose, "ease": "smooth"} for pose in poses])
    )

    assert resting.sample(1.5).velocity[ELBOW] == pytest.approx(0.0, abs=1e-12)
    assert smooth.sample(1.5).velocity[ELBOW] == pytest.approx(0.5, abs=1e-12)  # the line's slope
    for reference in (resting, smooth):
        assert reference.sample(1.5).configuration.position[ELBOW] == pytest.approx(0.75)


def test_a_pose_is_passed_with_its_velocity_and_its_acceleration(tmp_path: Path) -> None:
    poses = [dict(pose) for pose in WAVE["poses"]]  # type: ignore[attr-defined]
    poses[1]["velocity"] = {"right_elbow": -3.0, "neck_x": 0.2, "neck_y": 0.0, "neck_z": 0.4}
    poses[1]["acceleration"] = {"right_elbow": 20.0}
    poses[2]["velocity"] = {"right_elbow": 1.0}
    reference = made(tmp_path, keys=[{**WAVE, "poses": poses}])

    state = reference.sample(1.5)
    assert state.configuration.position[ELBOW] == pytest.approx(1.4)
    assert state.velocity[ELBOW] == pytest.approx(-3.0)
    assert state.acceleration[ELBOW] == pytest.approx(20.0)
    assert state.velocity[NECK] == pytest.approx((0.2, 0.0, 0.4))
    assert reference.sample(2.0 - 1e-9).velocity[ELBOW] == pytest.approx(1.0, abs=1e-6)
    for time in (0.6, 1.0, 1.5, 2.0, 2.3, 2.5):
        before, after = reference.sample(time - 1e-9), reference.sample(time + 1e-9)
        assert_same_motion(LAYOUT, before, after, atol=1e-5)


def test_a_layer_from_the_beginning_is_there_at_once_and_one_that_never_goes_stays(
    tmp_path: Path,
) -> None:
    layer = {"out": "never", "poses": [{"at": 0.2, "pose": {"right_elbow": 1.0}}]}
    reference = made(tmp_path, keys=[layer])

    for time in (0.0, 0.1, 0.2, 5.0):
        state = reference.sample(time)
        assert state.configuration.position[ELBOW] == 1.0
        assert state.velocity[ELBOW] == 0.0


def test_the_upper_of_two_layers_counts(tmp_path: Path) -> None:
    one, two = ({"poses": [{"at": 1.0, "pose": {"right_elbow": angle}}]} for angle in (0.3, 0.9))

    state = made(tmp_path, keys=[one, two]).sample(1.0)

    assert state.configuration.position[ELBOW] == pytest.approx(0.9)


def test_an_arm_on_a_table_has_poses_too(tmp_path: Path) -> None:
    poses = [{"at": 1.0, "pose": {"panda_joint1": 0.5}}]
    reference = made(tmp_path, "franka_panda", keys=[{"poses": poses}])

    assert reference.sample(1.0).configuration.position[0] == pytest.approx(0.5)
    assert reference.end == pytest.approx(1.3)


# Targets


def link_frame(name: str, state: ReferenceState, link: str) -> tuple[FloatArray, FloatArray]:
    """A link's place (3,) in m and axes (3, 3) in the world, by MuJoCo's kinematics."""
    whole, layout = loaded(name)
    model = DynamicsModel(whole)
    model.update(state.configuration.position, np.zeros(layout.size))
    number = [each.name for each in whole.links].index(link)
    places, axes = model.link_frames(np.array([number]))
    return places[0].copy(), axes[0].copy()


REACH = {"at": 1.0, "until": 2.0, "link": "right_wrist", "point": [0.35, -0.25, 1.1], "out": 0.5}


@pytest.mark.slow
def test_a_hand_is_at_its_point_from_when_to_when_it_is_said(tmp_path: Path) -> None:
    reference = made(tmp_path, steering=[SLOW], reach=[REACH])
    alone = made(tmp_path, steering=[SLOW])

    for time in np.linspace(1.0, 2.0, 50).tolist():
        place, _ = link_frame("humanoid", reference.sample(time), "right_wrist")
        np.testing.assert_allclose(place, REACH["point"], atol=0.005)
    for time in (0.69, 2.51):
        assert_same_motion(LAYOUT, reference.sample(time), alone.sample(time), atol=1e-9)
    moved = LAYOUT.difference(alone.sample(1.5).configuration, reference.sample(1.5).configuration)
    assert {LAYOUT.dof_names[row][:10] for row in np.flatnonzero(np.abs(moved) > 1e-9)} == {
        "right_shou",
        "right_elbo",
    }
    assert made(tmp_path, reach=[REACH]).end == 2.5


def test_a_head_faces_its_point(tmp_path: Path) -> None:
    point = np.array((1.0, 0.8, 1.2))
    reference = made(tmp_path, look=[{"at": 1.0, "until": 2.0, "point": point.tolist()}])
    (place, axes), (_, before) = (
        link_frame("humanoid", reference.sample(time), "neck") for time in (1.5, 0.0)
    )

    way = point - place
    ahead = axes @ (before.T @ (1.0, 0.0, 0.0))  # what was ahead at rest
    np.testing.assert_allclose(ahead, way / np.linalg.norm(way), atol=1e-3)


def test_what_is_out_of_reach_is_said(tmp_path: Path) -> None:
    file = tmp_path / "moves.yaml"
    file.write_text(yaml.safe_dump({"reach": [{**REACH, "point": [2.0, 0.0, 1.0]}]}))

    motion = timeline_motion(HUMANOID, values_of("humanoid", str(file)), read_timeline(str(file)))

    (warning,) = motion.warnings
    assert re.search(r"reach 1: 'right_wrist' stays up to 1\.\d\d m short of its point$", warning)
    place, _ = link_frame("humanoid", motion.reference.sample(1.5), "right_wrist")
    assert place[0] > 0.4  # stretched towards it


# Clips and steering


def test_a_clip_is_itself_carried_to_where_the_character_is(tmp_path: Path) -> None:
    reference = made(tmp_path, clips=[{**WALK, "place": [2.0, -1.0], "heading": 0.7}])
    clip = ClipReference(LAYOUT, read_clip(HUMANOID, "walk"))
    first = clip.sample(0.2)

    assert_same_place(LAYOUT, reference.sample(0.499), made(tmp_path).sample(0.0))
    for time in (0.8, 1.3, 4.0):
        state, own = reference.sample(time), clip.sample(0.2 + time - 0.5)
        np.testing.assert_allclose(  # joints are those of the clip
            state.configuration.position[6:], own.configuration.position[6:], atol=1e-9
        )
        turn = heading(state) - heading(own)
        assert turn == pytest.approx(0.7 - heading(first), abs=0.01)  # it leans a little
        cosine, sine = np.cos(turn), np.sin(turn)
        x, y = own.configuration.position[:2] - first.configuration.position[:2]
        place = (2.0 + cosine * x - sine * y, -1.0 + sine * x + cosine * y)
        np.testing.assert_allclose(state.configuration.position[:2], place, atol=1e-9)


def test_motions_go_over_into_each_other_without_a_jump(tmp_path: Path) -> None:
    reference = made(
        tmp_path,
        clips=[{**WALK, "to": 1.4}, {"at": 4.5, "clip": "punch", "to": 0.8}],
        steering=[{"at": 2.5, "until": 3.5, "velocity": [0.8, 0.0, 0.3]}],
    )
    ends = (0.5, 1.7, 2.5, 4.5, 5.3)

    for time in ends:
        before, after = reference.sample(time - 1e-6), reference.sample(time + 1e-6)
        apart = LAYOUT.difference(before.configuration, after.configuration)
        assert np.abs(apart).max() < 1e-4  # up to 50 rad/s
    still = reference.sample(reference.end + 1.0)
    assert not still.velocity.any() and not still.acceleration.any()
    # a clip that was cut comes to rest where it was, within the time of its blend
    assert not reference.sample(2.2).velocity.any()
    moved = (
        reference.sample(2.2).configuration.position - reference.sample(1.7).configuration.position
    )
    assert np.linalg.norm(moved[:2]) < 0.3
    for time in np.arange(0.0, 6.0, 0.05).tolist():
        assert_consistent(LAYOUT, reference.sample(time))


def test_steering_goes_on_from_where_the_character_is_at_the_speed_that_is_said(
    tmp_path: Path,
) -> None:
    reference = made(
        tmp_path,
        clips=[{**WALK, "place": [3.0, 1.0], "heading": 1.57, "to": 1.0}],
        steering=[
            {"at": 2.0, "until": 5.0, "velocity": [0.8, 0.0, 0.0]},
            {"at": 5.0, "until": 6.0, "velocity": [1.2, 0.0, 0.0]},
        ],
    )
    at = {t: reference.sample(t).configuration.position for t in (1.99, 2.0, 3.5, 5.0, 9.0, 10.0)}

    assert np.linalg.norm(at[2.0] - at[1.99]) < 0.05
    away = at[5.0] - at[3.5]
    assert np.linalg.norm(away[:2]) == pytest.approx(0.8 * 1.5, rel=0.05)
    assert np.arctan2(away[1], away[0]) == pytest.approx(1.57, abs=0.35)  # the clip turns a little
    np.testing.assert_allclose(at[9.0][:2], at[10.0][:2], atol=1e-3)  # it has stopped
    assert reference.end == 6.0


def test_after_steering_it_stands_still_a_while_later(tmp_path: Path) -> None:
    steering = [{"at": 2.0, "until": 6.0, "velocity": [1.2, 0.0, 0.0]}]
    reference = made(tmp_path, steering=steering)

    def moves(start: float, end: float) -> float:
        """The most that any degree of freedom goes, rad or m."""
        places = [reference.sample(t).configuration.position for t in np.arange(start, end, 0.05)]
        return float(np.ptp(places, axis=0).max())

    assert 6.0 < reference.still < 9.0
    assert moves(reference.still, reference.still + 2.0) < 2e-3
    assert moves(reference.still - 0.5, reference.still) > 0.02
    then = made(tmp_path, steering=steering, clips=[{**WALK, "at": 7.0, "to": 1.0}])
    assert then.still == pytest.approx(7.8)


def test_states_are_the_same_however_often_and_in_which_order_they_are_asked_for(
    tmp_path: Path,
) -> None:
    tracks: dict[str, Any] = {
        "keys": [WAVE],
        "steering": [{"at": 0.5, "until": 1.5, "velocity": [0.5, 0.0, 0.0]}],
    }
    times = [tick / RATE for tick in range(0, 720, 9)]
    forwards = made(tmp_path, **tracks)
    wanted = [forwards.sample(time) for time in times]
    other = made(tmp_path, **tracks)
    order = np.random.default_rng(6).permutation(len(times)).tolist()

    for row in [*order, *order]:
        again = other.sample(times[row])
        for name in ("velocity", "acceleration"):
            np.testing.assert_array_equal(getattr(again, name), getattr(wanted[row], name))
        one, two = again.configuration, wanted[row].configuration
        np.testing.assert_array_equal(one.position, two.position)
        np.testing.assert_array_equal(one.orientations_xyzw, two.orientations_xyzw)


# What it cannot do


@pytest.mark.parametrize(
    ("name", "tracks", "sentence"),
    [
        ("humanoid", {"clips": [{"at": 0, "clip": "wlak"}]}, "clips 1: .*'wlak'.*walk"),
        (
            "humanoid",
            {"clips": [{"at": 0, "clip": "kick", "from": 9.0}]},
            "clips 1: from is 9 s; clip 'kick' lasts 1.5",
        ),
        (
            "franka_panda",
            {"steering": [{"at": 0, "until": 1, "velocity": [1, 0, 0]}]},
            "steering 1: reference 'steered' needs a floating base",
        ),
        (
            "humanoid",
            {"steering": [{"at": 0, "until": 1, "velocity": [9, 0, 0]}]},
            r"steering 1: velocity is more than it can, which is at most \[",
        ),
        ("humanoid", {"reach": [{**REACH, "link": "ear"}]}, "reach 1: .*'ear'"),
        ("humanoid", {"reach": [{**REACH, "link": "root"}]}, "reach 1: no joint moves 'root'"),
        ("humanoid", {"look": [{**REACH, "link": "root"}]}, "look 1: no joint turns 'root'"),
        (
            "franka_panda",
            {"look": [{"at": 0, "until": 1, "point": [0, 0, 1]}]},
            "look 1: link is missing",
        ),
        (
            "humanoid",
            {"keys": [{"poses": [{"at": 0, "pose": {"neck_x": 0.1}}]}]},
            "keys 1: poses 1: pose: .*neck_y",
        ),
        (
            "humanoid",
            {"keys": [{"poses": [{"at": 0, "pose": {"elbow": 0.1}}]}]},
            "keys 1: poses 1: pose: .*'elbow'",
        ),
        (
            "humanoid",
            {"keys": [{"poses": [{**STILL, "velocity": {"left_elbow": 1}}]}]},
            "keys 1: poses 1: velocity: no pose of the layer has 'left_elbow'",
        ),
        (
            "humanoid",
            {"keys": [{"poses": [{**STILL, "acceleration": {"left_elbow": 1}}]}]},
            "keys 1: poses 1: acceleration: no pose of the layer has 'left_elbow'",
        ),
        (
            "humanoid",
            {"keys": [{"poses": [{**STILL, "velocity": {"neck_x": 1}}]}]},
            "keys 1: poses 1: velocity: .*neck_y",
        ),
        (
            "humanoid",
            {"keys": [{"poses": [{"at": 0, "pose": {"right_elbow": -2.0}}]}]},
            "keys 1: poses 1: pose.right_elbow is -2; it must be within the joint's limits, 0 to",
        ),
    ],
)
def test_what_a_character_cannot_do_is_refused_in_a_line(
    tmp_path: Path, name: str, tracks: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(MotionError, match=sentence) as caught:
        made(tmp_path, name, **tracks)

    assert "\n" not in str(caught.value)
