"""Motion clips against their files, read here once more and turned by textbook formulas."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller_node.references.base import ReferenceState
from controller_node.references.clip import ClipReference
from msgs_config.arrays import FloatArray
from msgs_config.clips.reading import available_clips, read_clip
from msgs_config.errors import ClipError
from msgs_config.geometry import rotations
from tests.support.physics import character, link_poses, still_world

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
DURATIONS = {  # s
    "walk": 1.27,
    "run": 0.80,
    "jump": 1.77,
    "backflip": 1.75,
    "cartwheel": 2.72,
    "spinkick": 1.28,
    "spin": 4.42,
    "roll": 2.02,
    "dance_a": 1.62,
    "dance_b": 2.53,
    "crawl": 2.93,
    "kick": 1.53,
    "punch": 2.13,
    "getup_faceup": 3.77,
    "getup_facedown": 3.03,
}
CLIPS = sorted(DURATIONS)
HELD = ["getup_facedown", "getup_faceup", "kick", "punch"]
WRAPPED = [clip for clip in CLIPS if clip not in HELD]
BEYOND_LIMITS = ["dance_b", "getup_facedown", "spin", "spinkick"]  # a knee is, in some frame
LIMITS = {  # rad
    "right_knee": (-3.14, 0.0),
    "left_knee": (-3.14, 0.0),
    "right_elbow": (0.0, 3.14),
    "left_elbow": (0.0, 3.14),
}
HINGES = [LAYOUT.joint(name).start for name in LIMITS]
BLEND_TIME = 0.15  # s before the wrap
QUARTER_TURN_ABOUT_X = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])

every_clip = pytest.mark.parametrize("clip", CLIPS)
wrapped_clips = pytest.mark.parametrize("clip", WRAPPED)
held_clips = pytest.mark.parametrize("clip", HELD)


@dataclass(frozen=True)
class Pose:
    """A frame in the z-up world: hinge angles by joint, rotation matrices by ball joint."""

    root: FloatArray  # (3,)
    root_turn: FloatArray  # (3, 3)
    hinges: dict[str, float]
    balls: dict[str, FloatArray]


def content(clip: str) -> dict[str, Any]:
    """What is in a clip's file."""
    text = Path(HUMANOID.clips.pattern.replace("*", clip)).read_text(encoding="utf-8")
    loaded: dict[str, Any] = json.loads(text)
    return loaded


def frame_times(clip: str) -> FloatArray:
    """When each frame comes, s: a frame's first number is how long it lasts."""
    durations = [frame[0] for frame in content(clip)["Frames"]]
    return np.concatenate(([0.0], np.cumsum(durations[:-1])))


def times_between_frames(clip: str) -> FloatArray:
    """The middle between each frame and the next, s; at the frames velocities jump."""
    times = frame_times(clip)
    return (times[:-1] + times[1:]) / 2.0


def frame_pose(frame: list[float]) -> Pose:
    """A frame as its file's format says, by the matrices of a textbook; hinges not clamped."""
    x, y, z = frame[1:4]
    hinges, balls, column = {}, {}, 8
    for name in HUMANOID.clips.joints:
        if name in LIMITS:
            hinges[name] = frame[column]
            column += 1
        else:
            balls[name] = matrix_of_wxyz(frame[column : column + 4])
            column += 4
    assert column == len(frame)
    turn = QUARTER_TURN_ABOUT_X @ matrix_of_wxyz(frame[4:8])
    return Pose(np.array([x, -z, y]), turn, hinges, balls)


def matrix_of_wxyz(quaternion: list[float]) -> FloatArray:
    """The rotation matrix of a quaternion that is rounded, and so not quite of length one."""
    w, x, y, z = np.array(quaternion) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def reference_of(clip: str) -> ClipReference:
    """A clip of the humanoid as a reference."""
    return ClipReference(LAYOUT, read_clip(HUMANOID, clip))


def turn_of(state: ReferenceState, joint: str) -> FloatArray:
    """The rotation matrix of the root or of a ball joint, by its rotation vector."""
    entries = LAYOUT.joint(joint).rotation
    assert entries is not None
    return rotations.matrix(rotations.exp(state.configuration.position[entries]))


def difference(one: ReferenceState, other: ReferenceState) -> FloatArray:
    """What leads from one to the other (n,)."""
    return LAYOUT.difference(one.configuration, other.configuration)


def assert_at(state: ReferenceState, pose: Pose) -> None:
    """The state is the pose, its hinges within their limits."""
    position = state.configuration.position
    np.testing.assert_allclose(position[:3], pose.root, atol=1e-9)
    np.testing.assert_allclose(turn_of(state, "root"), pose.root_turn, atol=1e-9)
    for name, angle in pose.hinges.items():
        clamped = np.clip(angle, *LIMITS[name])
        assert position[LAYOUT.joint(name).start] == pytest.approx(clamped, abs=1e-9)
    for name, turn in pose.balls.items():
        np.testing.assert_allclose(turn_of(state, name), turn, atol=1e-9)


def turn_a_cycle(clip: str) -> float:
    """The turn about the vertical from the first frame to the last, rad."""
    frames = content(clip)["Frames"]
    relative = frame_pose(frames[-1]).root_turn @ frame_pose(frames[0]).root_turn.T
    _, _, z, w = quaternion_of(relative)
    return float(2.0 * np.arctan2(z, w))


def quaternion_of(matrix: FloatArray) -> tuple[float, float, float, float]:
    """Quaternion xyzw of a turn by less than half a circle."""
    w = 0.5 * np.sqrt(1.0 + np.trace(matrix))
    skew = (matrix - matrix.T) / (4.0 * w)
    return float(skew[2, 1]), float(skew[0, 2]), float(skew[1, 0]), float(w)


# --- frames --------------------------------------------------------------------------------------


def test_all_clips_of_the_humanoid_are_known() -> None:
    assert set(available_clips(HUMANOID)) == set(CLIPS)


@every_clip
def test_times_durations_and_wrapping_are_the_files(clip: str) -> None:
    frames = read_clip(HUMANOID, clip)

    np.testing.assert_allclose(frames.times, frame_times(clip), rtol=0.0, atol=1e-12)
    assert frames.times[-1] == pytest.approx(DURATIONS[clip], abs=0.01)
    assert frames.wraps == (clip in WRAPPED) == (content(clip)["Loop"] == "wrap")


@pytest.mark.slow
@every_clip
def test_a_reference_is_at_each_frame_when_its_time_comes(clip: str) -> None:
    # Arrange
    reference, times = reference_of(clip), frame_times(clip)
    undisturbed = times[-1] - BLEND_TIME if clip in WRAPPED else times[-1]
    assert undisturbed > 0.6 * times[-1]

    for time, frame in zip(times, content(clip)["Frames"], strict=True):
        if time <= undisturbed:
            # Act
            state = reference.sample(float(time))

            # Assert
            assert_at(state, frame_pose(frame))


@every_clip
def test_a_configurations_two_forms_are_the_same_rotations(clip: str) -> None:
    reference = reference_of(clip)
    for time in np.linspace(0.0, 3.0 * DURATIONS[clip], 50):
        configuration = reference.sample(time).configuration
        again = LAYOUT.configuration(configuration.position)

        angles = rotations.angle_between(configuration.orientations_xyzw, again.orientations_xyzw)
        assert angles.max() < 1e-9


def test_the_walk_is_upright_in_the_z_up_world_and_goes_along_x() -> None:
    # Arrange
    reference = reference_of("walk")
    times = np.linspace(0.0, DURATIONS["walk"], 20, endpoint=False)
    with still_world(HUMANOID) as world:
        for time in times:
            # Act
            position = reference.sample(time).configuration.position
            world.body.set_state(position, np.zeros(LAYOUT.size))
            origins, _ = link_poses(world.body, HUMANOID)

            # Assert
            heights = {
                link.joint.name: origin[2]
                for link, origin in zip(HUMANOID.links, origins, strict=True)
            }
            assert heights["root"] == pytest.approx(0.85, abs=0.05)
            assert heights["neck"] > heights["chest"] > heights["root"] > heights["left_knee"]
            assert heights["left_knee"] > heights["left_ankle"] > 0.0
    start, end = (reference.sample(time).configuration.position for time in (0.0, 10.0))
    assert end[0] - start[0] > 5.0


# --- velocities ----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("cycle", [0, 3])
@every_clip
def test_a_velocity_is_the_rate_of_change_of_the_configuration(clip: str, cycle: int) -> None:
    # Arrange
    reference, eps = reference_of(clip), 1e-6
    balls = ["root", *frame_pose(content(clip)["Frames"][0]).balls]
    scalars = [0, 1, 2, *HINGES]
    for time in times_between_frames(clip) + cycle * frame_times(clip)[-1]:
        before, now, after = (reference.sample(t) for t in (time - eps, time, time + eps))

        # Act
        rate = after.configuration.position - before.configuration.position

        # Assert
        np.testing.assert_allclose(now.velocity[scalars], rate[scalars] / (2 * eps), atol=1e-6)
        spins, velocities = [], []
        for name in balls:
            turned = turn_of(after, name) - turn_of(before, name)
            spin = turn_of(now, name).T @ turned / (2 * eps)  # of the child, in the child frame
            spins.append([spin[2, 1], spin[0, 2], spin[1, 0]])
            velocities.append(now.velocity[LAYOUT.joint(name).rotation])
        np.testing.assert_allclose(velocities, spins, atol=1e-6)


# --- going on ------------------------------------------------------------------------------------


@wrapped_clips
def test_a_wrapped_clip_goes_on_without_a_jump(clip: str) -> None:
    reference, period = reference_of(clip), frame_times(clip)[-1]
    for cycle in (1, 2, 7):
        before, after = (reference.sample(cycle * period + eps) for eps in (-1e-9, 1e-9))

        assert np.abs(difference(before, after)).max() < 1e-6


@wrapped_clips
def test_joints_and_height_repeat_every_cycle(clip: str) -> None:
    reference, period = reference_of(clip), frame_times(clip)[-1]
    for time in times_between_frames(clip)[::7]:
        first, later = (reference.sample(time + cycle * period) for cycle in (0, 4))

        np.testing.assert_allclose(difference(first, later)[6:], 0.0, atol=1e-9)
        assert later.configuration.position[2] == pytest.approx(first.configuration.position[2])
        np.testing.assert_allclose(later.velocity[6:], first.velocity[6:], atol=1e-9)


@wrapped_clips
def test_each_cycle_is_the_one_before_carried_to_its_end(clip: str) -> None:
    """The closed form of n cycles is n times one step: turn about the start, then move."""
    # Arrange
    reference, period = reference_of(clip), frame_times(clip)[-1]
    poses = [frame_pose(frame) for frame in content(clip)["Frames"]]
    angle = turn_a_cycle(clip)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    start, end = poses[0].root, poses[-1].root * [1.0, 1.0, 0.0] + poses[0].root * [0.0, 0.0, 1.0]
    for time in times_between_frames(clip)[::7]:
        state = reference.sample(time)
        place, axes = state.configuration.position[:3], turn_of(state, "root")
        speed = state.velocity[:3]
        for cycle in range(1, 6):
            # Act
            state = reference.sample(time + cycle * period)
            place, axes, speed = end + turn @ (place - start), turn @ axes, turn @ speed

            # Assert
            np.testing.assert_allclose(state.configuration.position[:3], place, atol=1e-7)
            np.testing.assert_allclose(turn_of(state, "root"), axes, atol=1e-7)
            np.testing.assert_allclose(state.velocity[:3], speed, atol=1e-7)


@pytest.mark.parametrize("clip", [clip for clip in WRAPPED if clip not in BEYOND_LIMITS])
def test_the_gap_at_the_wrap_is_closed_without_a_rush(clip: str) -> None:
    """A gap g that is blended over time T by the smooth step adds at most 1.5 g / T of speed."""
    # Arrange
    reference, times, middles = reference_of(clip), frame_times(clip), times_between_frames(clip)
    poses = [frame_pose(frame) for frame in content(clip)["Frames"]]
    blended = np.flatnonzero(middles > times[-1] - BLEND_TIME)
    for name in LIMITS:
        angles = np.array([pose.hinges[name] for pose in poses])

        # Act
        own = (np.diff(angles) / np.diff(times))[blended]
        column = LAYOUT.joint(name).start
        velocities = [reference.sample(time).velocity[column] for time in middles[blended]]

        # Assert
        gap = abs(angles[-1] - angles[0])
        assert np.abs(velocities - own).max() <= 1.5 * gap / BLEND_TIME + 1e-9


@held_clips
def test_a_clip_that_does_not_wrap_holds_its_last_frame(clip: str) -> None:
    reference, end = reference_of(clip), frame_times(clip)[-1]
    last = frame_pose(content(clip)["Frames"][-1])
    for time in (end, end + 1e-9, end + 1.0, 1000.0):
        state = reference.sample(float(time))

        assert_at(state, last)
        np.testing.assert_array_equal(state.velocity, np.zeros(LAYOUT.size))


# --- limits --------------------------------------------------------------------------------------


@every_clip
def test_joints_stay_within_their_limits_at_all_times(clip: str) -> None:
    reference = reference_of(clip)
    lower, upper = np.array(list(LIMITS.values())).T
    for time in np.linspace(0.0, 2.0 * DURATIONS[clip], 1000):
        angles = reference.sample(time).configuration.position[HINGES]

        assert (angles >= lower - 1e-12).all() and (angles <= upper + 1e-12).all(), time


@every_clip
def test_joints_that_had_to_be_clamped_are_named(clip: str) -> None:
    # Arrange
    poses = [frame_pose(frame) for frame in content(clip)["Frames"]]

    # Act
    clamped = read_clip(HUMANOID, clip).clamped

    # Assert
    expected = {
        name
        for name, (lower, upper) in LIMITS.items()
        if not all(lower <= pose.hinges[name] <= upper for pose in poses)
    }
    assert set(clamped) == expected
    assert bool(clamped) == (clip in BEYOND_LIMITS)


# --- errors --------------------------------------------------------------------------------------

NO_TURN = [1.0, 0.0, 0.0, 0.0]
ROW = [0.1, 0.0, 0.9, 0.0, *NO_TURN]
COLUMN: dict[str, int] = {}  # where each joint begins in a frame
for joint_name in HUMANOID.clips.joints:
    COLUMN[joint_name] = len(ROW)
    ROW += [0.0] if joint_name in LIMITS else NO_TURN


def row(**changes: float) -> list[float]:
    """A frame of 0.1 s without a turn, with the columns `c0`, `c1`, ... changed."""
    changed = list(ROW)
    for name, value in changes.items():
        changed[int(name.removeprefix("c"))] = value
    return changed


WrittenClip = Callable[[str], str]


@pytest.fixture
def written(tmp_path: Path) -> WrittenClip:
    """Writes a clip's text into a file, and gives the file's path."""

    def write(text: str) -> str:
        path = tmp_path / "clip.txt"
        path.write_text(text)
        return str(path)

    return write


def clip_text(frames: object, loop: object = "wrap") -> str:
    return json.dumps({"Loop": loop, "Frames": frames})


def test_a_clip_may_be_a_file_of_ones_own(written: WrittenClip) -> None:
    frames = read_clip(HUMANOID, written(clip_text([row(), row(c1=0.5), row(c1=1.0)], "none")))

    np.testing.assert_allclose(frames.times, [0.0, 0.1, 0.2])
    np.testing.assert_allclose(frames.positions[:, :3], [[0, 0, 0.9], [0.5, 0, 0.9], [1, 0, 0.9]])
    assert not frames.wraps


def knee_clip(angles: list[float], duration: float) -> str:
    """A wrapped clip that moves the right knee alone."""
    knee = f"c{COLUMN['right_knee']}"
    return clip_text([row(c0=duration, **{knee: angle}) for angle in angles])


@pytest.mark.parametrize("duration", [0.01, 0.05, 0.2])
def test_a_short_clip_too_goes_on_without_a_jump(written: WrittenClip, duration: float) -> None:
    # Arrange
    path = written(knee_clip([-1.0, -0.5, -0.2], duration))
    reference = ClipReference(LAYOUT, read_clip(HUMANOID, path))
    for cycle in (1, 2):
        # Act
        before, after = (reference.sample(cycle * 2 * duration + eps) for eps in (-1e-9, 1e-9))

        # Assert
        assert np.abs(difference(before, after)).max() < 1e-6


def test_closing_the_gap_at_the_wrap_breaks_no_limit(written: WrittenClip) -> None:
    # Arrange: straight just before the end, and the gap to the first frame is towards straight
    path = written(knee_clip([-0.5] * 30 + [0.0, -1.0], 0.02))
    reference = ClipReference(LAYOUT, read_clip(HUMANOID, path))
    knee = LAYOUT.joint("right_knee").start

    # Act
    angles = [reference.sample(t).configuration.position[knee] for t in np.arange(0.0, 1.2, 0.002)]

    # Assert
    assert max(angles) <= 1e-12
    assert min(angles) >= -1.0 - 1e-12


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        pytest.param("walk, please", "not a motion clip; it must be JSON", id="not JSON"),
        pytest.param("[" * 100_000, "not a motion clip", id="nested too deep"),
        pytest.param("[1, 2]", "not a motion clip", id="a list"),
        pytest.param('{"Loop": "wrap"}', "'Frames'", id="no frames"),
        pytest.param(json.dumps({"Frames": [ROW, ROW]}), "'Loop'", id="no loop"),
        pytest.param(
            clip_text([ROW, ROW], "often"), "Loop is 'often'.*'wrap' or 'none'", id="loop"
        ),
        pytest.param(clip_text([ROW, ROW], ["wrap"]), "Loop is .*'wrap' or 'none'", id="list loop"),
        pytest.param(clip_text([]), "two frames or more", id="no frame"),
        pytest.param(clip_text([ROW]), "two frames or more", id="one frame"),
        pytest.param(clip_text([ROW, ROW[:-1]]), "equal length", id="uneven frames"),
        pytest.param(clip_text([ROW[:-1]] * 2), "43 numbers.*'humanoid' needs 44", id="too few"),
        pytest.param(clip_text([[*ROW, 1.0]] * 2), "45 numbers.*needs 44", id="too many"),
        pytest.param(clip_text([ROW[:5]] * 2), "5 numbers.*needs 44", id="far too few"),
        pytest.param(clip_text([["a", "b"]] * 2), "not a motion clip", id="words"),
        pytest.param(clip_text([ROW, row(c9=np.nan)]), "frame 1 .*not finite", id="NaN"),
        pytest.param(clip_text([row(c0=np.inf), ROW]), "frame 0 .*not finite", id="infinity"),
        pytest.param(clip_text([ROW, row(c1=10**400)]), "clip.txt: ", id="huge"),
        pytest.param(clip_text([ROW, row(c4=1e300)]), "clip.txt: frame 1", id="huge turn"),
        pytest.param(clip_text([ROW, row(c0=0.0), ROW]), "frame 1 lasts 0.0 s", id="no duration"),
        pytest.param(clip_text([row(c0=-0.1), ROW]), "frame 0 lasts -0.1 s", id="backwards"),
        pytest.param(clip_text([ROW, row(c4=0.0)]), "frame 1: .*'root' has length 0", id="no turn"),
        pytest.param(
            clip_text([row(c8=0.0), ROW]), "frame 0: .*'chest' has length 0", id="no ball"
        ),
    ],
)
def test_a_malformed_clip_is_one_clear_line(
    written: WrittenClip, text: str, complaint: str
) -> None:
    path = written(text)

    with pytest.raises(ClipError, match=complaint) as caught:
        read_clip(HUMANOID, path)

    assert str(caught.value).startswith(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "clip", "words"),
    [
        ("humanoid", "wlak", r"'wlak'.*backflip, cartwheel.*walk"),
        ("humanoid", "/nowhere/clip.txt", r"/nowhere/clip\.txt: No such file"),
        ("lift", "walk", "'lift' has no clips"),
    ],
)
def test_a_clip_that_is_not_there_is_refused(name: str, clip: str, words: str) -> None:
    with pytest.raises(ClipError, match=words):
        read_clip(character(name), clip)


@pytest.mark.parametrize("clip", ["walk", "spin", "kick"])
def test_states_sampled_together_are_those_sampled_one_by_one(clip: str) -> None:
    reference = reference_of(clip)
    times = [0.3 * DURATIONS[clip] + number * 0.37 for number in range(20)]  # over cycles, the end

    together = reference.samples(times)

    assert len(together) == len(times)
    for time, state in zip(times, together, strict=True):
        alone = reference.sample(time)
        pairs = (
            (state.configuration.position, alone.configuration.position),
            (state.configuration.orientations_xyzw, alone.configuration.orientations_xyzw),
            (state.velocity, alone.velocity),
            (state.acceleration, alone.acceleration),
        )
        assert all(ours.tobytes() == its.tobytes() for ours, its in pairs)


@pytest.mark.parametrize("name", ["walk.bvh", "WALK.BVH", "walk.fbx"])
def test_motion_that_is_no_clip_is_said_with_what_to_do(name: str, tmp_path: Path) -> None:
    (tmp_path / name).touch()

    with pytest.raises(ClipError, match=f"{name} is .*, not a clip; .*motion import"):
        read_clip(HUMANOID, str(tmp_path / name))
