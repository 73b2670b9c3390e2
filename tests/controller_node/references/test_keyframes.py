"""Keyframes: the path that they describe, and files of them that are refused with one line."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from controller_node.references.base import ReferenceState
from controller_node.references.curve import REST_TIME
from controller_node.references.files.keyframes import Keyframes, read_keyframes
from controller_node.references.keyframes import KeyframesReference, overshoots
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.character.model import Character, Placement
from msgs_config.errors import MotionError
from msgs_config.geometry import rotations
from tests.support.motion import (
    MOVED,
    assert_moves_as_it_says,
    assert_same_motion,
    assert_same_place,
    loaded,
    random_knots,
)
from tests.support.physics import character, character_id

PANDA, HUMANOID = character("franka_panda"), character("humanoid")
TIMES = np.array([0.2, 0.9, 1.3, 2.0, 3.1])  # s
PERIOD = 3.6  # s
INSTANT = 1e-9  # s
JOINTS = ["panda_joint1", "panda_joint2", "panda_joint3"]
every_moved = pytest.mark.parametrize("name", MOVED, ids=character_id)
both_ends = pytest.mark.parametrize("period", [None, PERIOD], ids=["ends", "loops"])


def random_keyframes(whole: Character, smooth: bool, period: float | None) -> Keyframes:
    return Keyframes(TIMES, random_knots(whole, TIMES).configurations, smooth, period)


def still_at(layout: JointLayout, keyframes: Keyframes, number: int) -> ReferenceState:
    whole, still = keyframes.configurations, np.zeros(layout.size)
    place = GeneralizedPosition(whole.position[number], whole.orientations_xyzw[number])
    return ReferenceState(place, still, still)


def written(directory: Path, content: object) -> str:
    """The path of a file with this content."""
    path = directory / "moves.yaml"
    text = content if isinstance(content, str) else yaml.safe_dump(content)
    path.write_text(text, encoding="utf-8")
    return str(path)


def read(directory: Path, *frames: dict[str, Any], whole: Character = PANDA, **keys: Any) -> Any:
    return read_keyframes(whole, written(directory, {"keyframes": list(frames), **keys}))


def at(time: object, **pose: object) -> dict[str, Any]:
    return {"time": time, "pose": pose}


def panda(keyframes: Keyframes, name: str) -> FloatArray:
    """The column of one joint."""
    column: FloatArray = keyframes.configurations.position[:, PANDA.layout.joint(name).start]
    return column


# The path


@both_ends
@pytest.mark.parametrize("smooth", [True, False], ids=["smooth", "linear"])
@every_moved
def test_velocity_and_acceleration_are_the_difference_quotients(
    name: str, smooth: bool, period: float | None
) -> None:
    whole, layout = loaded(name)
    reference = KeyframesReference(layout, random_keyframes(whole, smooth, period))
    times = np.random.default_rng(4).uniform(0.0, 8.0, 40)
    knots = TIMES if period is None else np.concatenate([TIMES, TIMES + PERIOD, TIMES + 2 * PERIOD])
    times = times[np.abs(times[:, np.newaxis] - knots).min(axis=1) > 1e-3]

    assert_moves_as_it_says(layout, reference.sample, times.tolist())


@both_ends
@pytest.mark.parametrize("smooth", [True, False], ids=["smooth", "linear"])
@every_moved
def test_it_is_at_each_keyframe_when_its_time_comes(
    name: str, smooth: bool, period: float | None
) -> None:
    whole, layout = loaded(name)
    keyframes = random_keyframes(whole, smooth, period)
    reference = KeyframesReference(layout, keyframes)

    for number, time in enumerate(TIMES.tolist()):
        place = still_at(layout, keyframes, number)
        assert_same_place(layout, reference.sample(time), place)
        assert_same_place(layout, reference.sample(time - INSTANT), place, atol=1e-6)


@both_ends
@every_moved
def test_a_smooth_path_is_continuous_to_the_acceleration(name: str, period: float | None) -> None:
    whole, layout = loaded(name)
    reference = KeyframesReference(layout, random_keyframes(whole, True, period))
    later = [] if period is None else (TIMES + PERIOD).tolist()

    for time in [*TIMES.tolist(), *later]:
        before, after = reference.sample(time - INSTANT), reference.sample(time + INSTANT)
        assert_same_motion(layout, before, after, atol=1e-5)


@every_moved
def test_a_path_that_does_not_loop_begins_and_ends_at_rest(name: str) -> None:
    whole, layout = loaded(name)
    keyframes = random_keyframes(whole, True, None)
    reference = KeyframesReference(layout, keyframes)

    for time, number in ((0.0, 0), (0.2, 0), (3.1 - INSTANT, -1), (3.1, -1), (50.0, -1)):
        resting = still_at(layout, keyframes, number)
        assert_same_motion(layout, reference.sample(time), resting, atol=1e-5)


@every_moved
def test_a_loop_is_periodic(name: str) -> None:
    whole, layout = loaded(name)
    reference = KeyframesReference(layout, random_keyframes(whole, True, PERIOD))

    for time in (0.0, 0.1, 0.2, 1.7, 3.3, PERIOD - INSTANT):
        for cycle in (1, 2, 1000):
            later = reference.sample(time + cycle * PERIOD)
            assert_same_motion(layout, reference.sample(time), later, atol=1e-8)
    moves = reference.sample(0.2)
    assert np.abs(moves.velocity).min() > 1e-6


def test_a_loop_does_not_stop_for_an_instant_as_its_time_rounds() -> None:
    keyframes = random_keyframes(PANDA, True, PERIOD)
    reference = KeyframesReference(PANDA.layout, keyframes)
    expected = reference.sample(0.2).velocity

    for time in (np.nextafter(0.2, 0.0), np.nextafter(0.2 + PERIOD, 0.0), 0.2 + 3.0 * PERIOD):
        np.testing.assert_allclose(reference.sample(float(time)).velocity, expected, atol=1e-6)


def test_a_parabola_is_followed_exactly_between_inner_keyframes() -> None:
    layout = PANDA.layout
    start, slope, half = 0.1, 0.3, -0.2
    values = np.tile((start + slope * TIMES + half * TIMES**2)[:, np.newaxis], (1, layout.size))
    reference = KeyframesReference(layout, Keyframes(TIMES, layout.configuration(values), True))

    for time in np.linspace(TIMES[1], TIMES[-2], 9).tolist():
        state = reference.sample(time)
        expected = start + slope * time + half * time**2
        np.testing.assert_allclose(state.configuration.position, expected, atol=1e-12)
        np.testing.assert_allclose(state.velocity, slope + 2.0 * half * time, atol=1e-12)
        np.testing.assert_allclose(state.acceleration, 2.0 * half, atol=1e-11)


@both_ends
@every_moved
def test_it_has_its_own_rates_and_stays_continuous(name: str, period: float | None) -> None:
    whole, layout = loaded(name)
    knots = random_knots(whole, TIMES)
    assert knots.velocities is not None
    given, forced = knots.velocities.copy(), 5.0 * knots.velocities[::-1]
    given[1], given[3, layout.joints[-1].entries] = np.nan, np.nan
    forced[2], forced[0, layout.joints[-1].entries] = np.nan, np.nan
    keyframes = random_keyframes(whole, True, period)
    reference, automatic, moving = (
        KeyframesReference(layout, replace(keyframes, velocities=each, accelerations=other))
        for each, other in ((given, forced), (None, None), (given, None))
    )

    times = TIMES.tolist() if period is None else [*TIMES, *(TIMES + PERIOD)]
    for time in times:
        before, after = reference.sample(time - INSTANT), reference.sample(time + INSTANT)
        assert_same_motion(layout, before, after, atol=1e-4)
    for row, own_row, own in zip([*given, *given], [*forced, *forced], times, strict=False):
        expected = np.where(np.isnan(row), automatic.sample(own).velocity, row)
        np.testing.assert_allclose(reference.sample(own).velocity, expected, atol=1e-9)
        expected = np.where(np.isnan(own_row), moving.sample(own).acceleration, own_row)
        at_rest = period is None and own == times[-1]  # from then on it stands, if it does not move
        if not at_rest or not np.isnan(own_row).any():
            np.testing.assert_allclose(reference.sample(own).acceleration, expected, atol=1e-7)
    inside = np.random.default_rng(4).uniform(0.25, 3.0, 30)
    inside = inside[np.abs(inside[:, np.newaxis] - TIMES).min(axis=1) > 1e-3]
    assert_moves_as_it_says(layout, reference.sample, inside.tolist())


@both_ends
@every_moved
def test_without_a_velocity_of_its_own_not_a_bit_changes(name: str, period: float | None) -> None:
    whole, layout = loaded(name)
    keyframes = random_keyframes(whole, True, period)
    none = np.full((len(TIMES), layout.size), np.nan)
    one, other = (
        KeyframesReference(layout, each)
        for each in (keyframes, replace(keyframes, velocities=none, accelerations=none))
    )

    for time in np.linspace(0.0, 5.0, 101).tolist():
        ours, theirs = one.sample(time), other.sample(time)
        np.testing.assert_array_equal(ours.configuration.position, theirs.configuration.position)
        np.testing.assert_array_equal(ours.velocity, theirs.velocity)
        np.testing.assert_array_equal(ours.acceleration, theirs.acceleration)


def test_a_cubic_with_its_velocities_is_followed_exactly_between_inner_keyframes() -> None:
    layout = PANDA.layout
    cubic = Polynomial([0.1, 0.3, -0.2, 0.05])

    def columns(values: FloatArray) -> FloatArray:
        return np.tile(values[:, np.newaxis], (1, layout.size))

    configurations = layout.configuration(columns(cubic(TIMES)))
    keyframes = Keyframes(TIMES, configurations, True, None, columns(cubic.deriv()(TIMES)))
    reference = KeyframesReference(layout, keyframes)

    for time in np.linspace(TIMES[1], TIMES[-2], 9).tolist():
        state = reference.sample(time)
        np.testing.assert_allclose(state.configuration.position, cubic(time), atol=1e-12)
        np.testing.assert_allclose(state.velocity, cubic.deriv()(time), atol=1e-12)
        np.testing.assert_allclose(state.acceleration, cubic.deriv(2)(time), atol=1e-11)


def test_a_quintic_with_its_rates_is_followed_exactly() -> None:
    layout = PANDA.layout
    quintic = Polynomial([0.1, 0.3, -0.2, 0.05, 0.04, -0.01])

    def columns(order: int) -> FloatArray:
        values = quintic.deriv(order)(TIMES) if order else quintic(TIMES)
        return np.tile(values[:, np.newaxis], (1, layout.size))

    configurations = layout.configuration(columns(0))
    reference = KeyframesReference(
        layout, Keyframes(TIMES, configurations, True, None, columns(1), columns(2))
    )

    for time in np.linspace(TIMES[0], TIMES[-1], 9).tolist():
        state = reference.sample(time)
        np.testing.assert_allclose(state.configuration.position, quintic(time), atol=1e-12)
        np.testing.assert_allclose(state.velocity, quintic.deriv()(time), atol=1e-11)
        np.testing.assert_allclose(state.acceleration, quintic.deriv(2)(time), atol=1e-10)


@pytest.mark.parametrize("count", [1, 2])
def test_a_keyframe_that_moves_at_an_end_comes_from_rest_and_to_rest(
    tmp_path: Path, count: int
) -> None:
    frames = [{**at(1.0 + n), "velocity": {"panda_joint1": 0.4}} for n in range(count)]
    keyframes = read(tmp_path, *frames)
    reference = KeyframesReference(PANDA.layout, keyframes)
    last = float(count)

    assert reference.sample(1.0).velocity[0] == pytest.approx(0.4)
    assert reference.sample(last - INSTANT).velocity[0] == pytest.approx(0.4, abs=1e-6)
    for time in (1.0 - REST_TIME - INSTANT, last + REST_TIME + INSTANT):
        resting = still_at(PANDA.layout, keyframes, 0)
        assert_same_motion(PANDA.layout, reference.sample(time), resting, atol=1e-5)


def test_a_steady_turn_is_followed_exactly_between_inner_keyframes() -> None:
    layout = HUMANOID.layout
    axis = np.array([0.48, -0.6, 0.64])
    positions = np.tile(np.array(HUMANOID.rest_position), (len(TIMES), 1))
    positions[:, layout.rotation_entries] = 0.9 * TIMES[:, np.newaxis, np.newaxis] * axis
    keyframes = Keyframes(TIMES, layout.configuration(positions), True)
    reference = KeyframesReference(layout, keyframes)

    for time in np.linspace(TIMES[1], TIMES[-2], 9).tolist():
        state = reference.sample(time)
        expected = rotations.exp(0.9 * time * axis)
        apart = rotations.angle_between(state.configuration.orientations_xyzw, expected)
        np.testing.assert_allclose(apart, 0.0, atol=1e-12)
        turning = state.velocity[layout.rotation_entries]
        np.testing.assert_allclose(turning, np.tile(0.9 * axis, (len(turning), 1)), atol=1e-12)


def test_two_keyframes_are_joined_by_the_quintic_from_rest_to_rest(tmp_path: Path) -> None:
    keyframes = read(tmp_path, at(0.0, panda_joint1=0.2), at(2.0, panda_joint1=1.0))
    reference = KeyframesReference(PANDA.layout, keyframes)

    for s in (0.0, 0.1, 0.5, 0.77, 1.0):
        position = reference.sample(2.0 * s).configuration.position
        expected = 0.2 + 0.8 * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
        assert position[PANDA.layout.joint("panda_joint1").start] == pytest.approx(expected)


@both_ends
def test_one_keyframe_is_held(tmp_path: Path, period: float | None) -> None:
    keys = {} if period is None else {"loop": True, "period": period}
    keyframes = read(tmp_path, at(1.0, panda_joint1=0.2), **keys)
    reference = KeyframesReference(PANDA.layout, keyframes)

    for time in (0.0, 0.5, 1.0, 3.0, 9.9):
        resting = still_at(PANDA.layout, keyframes, 0)
        assert_same_motion(PANDA.layout, reference.sample(time), resting)


# The file


def test_what_a_pose_leaves_out_keeps_its_value(tmp_path: Path) -> None:
    keyframes = read(
        tmp_path,
        at(0, panda_joint1=0.3, panda_joint2=-0.2),
        at(0.5),
        {"time": 0.7},
        at(1.0, panda_joint1=-0.3),
    )

    rest = np.array(PANDA.rest_position)
    np.testing.assert_array_equal(panda(keyframes, "panda_joint1"), [0.3, 0.3, 0.3, -0.3])
    np.testing.assert_array_equal(panda(keyframes, "panda_joint2"), [-0.2] * 4)
    others = np.ones(PANDA.layout.size, dtype=np.bool_)
    others[[PANDA.layout.joint(name).start for name in JOINTS[:2]]] = False
    for row in keyframes.configurations.position:
        np.testing.assert_array_equal(row[others], rest[others])
    np.testing.assert_array_equal(keyframes.times, [0.0, 0.5, 0.7, 1.0])
    assert keyframes.smooth and keyframes.period is None


def test_linear_and_loop_are_taken_from_the_file(tmp_path: Path) -> None:
    keyframes = read(
        tmp_path, at(0.0, panda_joint1=0.3), interpolation="linear", loop=True, period=2
    )

    assert not keyframes.smooth and keyframes.period == 2.0


def test_a_ball_joint_and_a_root_are_given_as_in_messages(tmp_path: Path) -> None:
    pose = {"chest_x": 0.1, "chest_y": -0.2, "chest_z": 0.3, "root_z": 1.5}
    keyframes = read(tmp_path, at(0.0, **pose), whole=HUMANOID)
    layout, position = HUMANOID.layout, keyframes.configurations.position[0]

    np.testing.assert_array_equal(position[layout.joint("chest").entries], [0.1, -0.2, 0.3])
    assert position[2] == 1.5
    expected = layout.configuration(position).orientations_xyzw
    np.testing.assert_allclose(
        rotations.angle_between(keyframes.configurations.orientations_xyzw[0], expected),
        0.0,
        atol=1e-12,
    )


def test_a_root_moves_where_the_character_was_placed(tmp_path: Path) -> None:
    placement = Placement(x=2.0, y=-1.0, z=0.5, yaw=0.8)
    frames = [at(0.0), at(1.0, root_x=0.4), at(2.0, root_rx=0.1, root_ry=0.2, root_rz=0.3)]
    own = read(tmp_path, *frames, whole=HUMANOID).configurations
    placed = read(tmp_path, *frames, whole=HUMANOID.placed(placement)).configurations

    turn = np.array([[np.cos(0.8), -np.sin(0.8), 0.0], [np.sin(0.8), np.cos(0.8), 0.0], [0, 0, 1]])
    np.testing.assert_allclose(
        placed.position[:, :3], own.position[:, :3] @ turn.T + [2.0, -1.0, 0.5], atol=1e-12
    )
    np.testing.assert_allclose(
        rotations.matrix(placed.orientations_xyzw[:, 0]),
        turn @ rotations.matrix(own.orientations_xyzw[:, 0]),
        atol=1e-12,
    )
    from_vectors = HUMANOID.layout.configuration(placed.position).orientations_xyzw
    np.testing.assert_allclose(
        rotations.angle_between(from_vectors, placed.orientations_xyzw), 0.0, atol=1e-12
    )
    np.testing.assert_array_equal(placed.position[:, 6:], own.position[:, 6:])
    np.testing.assert_array_equal(placed.orientations_xyzw[:, 1:], own.orientations_xyzw[:, 1:])


def test_a_path_that_swings_beyond_a_limit_is_noted_with_joint_time_and_size(
    tmp_path: Path,
) -> None:
    upper = PANDA.position_bounds()[1][PANDA.layout.joint("panda_joint1").start]
    values = [0.0, float(upper), float(upper), 0.0]
    frames = [at(float(time), panda_joint1=value) for time, value in enumerate(values)]

    smooth = read(tmp_path, *frames)

    reference = KeyframesReference(PANDA.layout, smooth)
    times = np.linspace(0.0, 3.0, 3001)
    path = [reference.sample(time).configuration.position[0] for time in times.tolist()]
    worst = int(np.argmax(path))
    assert path[worst] > upper + 0.1, "this path must overshoot for the test to mean anything"
    (warning,) = overshoots(PANDA, smooth)
    assert "'panda_joint1'" in warning and f"{path[worst] - upper:.2g} rad" in warning
    assert f"{times[worst]:.3g} s" in warning and "\n" not in warning
    assert not overshoots(PANDA, read(tmp_path, *frames, interpolation="linear"))
    within = [at(float(time), panda_joint1=0.5 * value) for time, value in enumerate(values)]
    assert not overshoots(PANDA, read(tmp_path, *within))


def test_a_note_of_a_loop_tells_the_time_as_the_file_does(tmp_path: Path) -> None:
    upper = float(PANDA.position_bounds()[1][0])
    frames = [at(1.0, panda_joint1=upper), at(1.5, panda_joint1=0.0)]
    keyframes = read(tmp_path, *frames, at(5.5, panda_joint1=upper), loop=True, period=6.0)

    (warning,) = overshoots(PANDA, keyframes)
    reference = KeyframesReference(PANDA.layout, keyframes)
    times = np.linspace(1.0, 7.0, 6001)  # one period from the first keyframe on
    path = [reference.sample(time).configuration.position[0] for time in times.tolist()]
    told = float(warning.split(" s;")[0].split(" at ")[1])
    assert max(path) > upper + 0.01
    assert told == pytest.approx(times[int(np.argmax(path))], abs=0.05)


# What is refused

GOOD = {"time": 0.0, "pose": {"panda_joint1": 0.3}}
REFUSED: dict[str, tuple[object, list[str]]] = {
    "nothing": ({}, ["keyframes", "missing", "one keyframe or more"]),
    "empty": ({"keyframes": []}, ["keyframes", "list", "one keyframe or more"]),
    "no list": ({"keyframes": GOOD}, ["keyframes", "dict", "one keyframe or more"]),
    "no mapping": ("[1, 2]", ["mapping"]),
    "not YAML": ("keyframes: [", ["not valid YAML"]),
    "unknown key": ({"keyframes": [GOOD], "looop": True}, ["looop", "did you mean 'loop'"]),
    "a number as key": ({"keyframes": [GOOD], 3: True}, ["unknown key '3'"]),
    "interpolation": ({"keyframes": [GOOD], "interpolation": "cubic"}, ["cubic", "'smooth'"]),
    "loop": ({"keyframes": [GOOD], "loop": 1}, ["loop is 1", "true or false"]),
    "no period": ({"keyframes": [GOOD], "loop": True}, ["period is missing", "number"]),
    "period alone": ({"keyframes": [GOOD], "period": 2.0}, ["period", "loop: true"]),
    "short period": (
        {"keyframes": [at(2.0)], "loop": True, "period": 2.0},
        ["period is 2.0", "more than", "2 s"],
    ),
    "keyframe type": ({"keyframes": [GOOD, 4]}, ["keyframe 2 is 4", "mapping"]),
    "keyframe key": ({"keyframes": [{"time": 0.0, "poses": {}}]}, ["keyframe 1", "'poses'"]),
    "no time": ({"keyframes": [{"pose": {}}]}, ["keyframe 1: time is missing"]),
    "time type": ({"keyframes": [at("soon")]}, ["keyframe 1: time", "'soon'", "number"]),
    "time before 0": ({"keyframes": [at(-1.0)]}, ["keyframe 1: time is -1.0", "from 0"]),
    "time nan": ({"keyframes": [at(float("nan"))]}, ["keyframe 1: time is nan"]),
    "unsorted": ({"keyframes": [at(1.0), at(0.5)]}, ["keyframe 2", "0.5", "later", "1 s"]),
    "repeated": ({"keyframes": [at(0.0), at(1.0), at(1.0)]}, ["keyframe 3", "later", "1 s"]),
    "pose type": ({"keyframes": [{"time": 0.0, "pose": [1]}]}, ["keyframe 1: pose", "list"]),
    "unknown DoF": (
        {"keyframes": [at(0.0, panda_joint11=0.1)]},
        ["keyframe 1", "'panda_joint11'", "did you mean 'panda_joint1'"],
    ),
    "a number as DoF": ({"keyframes": [{"time": 0, "pose": {1: 2}}]}, ["keyframe 1", "'1'"]),
    "value type": ({"keyframes": [at(0.0, panda_joint1="up")]}, ["panda_joint1 is 'up'"]),
    "flag": ({"keyframes": [at(0.0, panda_joint1=True)]}, ["panda_joint1 is True", "number"]),
    "infinite": ({"keyframes": [at(0.0, panda_joint1=float("inf"))]}, ["panda_joint1 is inf"]),
    "huge": ({"keyframes": [at(0.0, panda_joint1=10**300)]}, ["panda_joint1", "number"]),
    "null": ({"keyframes": [at(0.0, panda_joint1=None)]}, ["panda_joint1 is missing"]),
    "velocity type": ({"keyframes": [{**GOOD, "velocity": 3}]}, ["keyframe 1: velocity is 3"]),
    "velocity unknown": (
        {"keyframes": [{**GOOD, "velocity": {"panda_joint11": 1.0}}]},
        ["keyframe 1: velocity", "'panda_joint11'"],
    ),
    "velocity value": (
        {"keyframes": [{**GOOD, "velocity": {"panda_joint1": "fast"}}]},
        ["keyframe 1: velocity.panda_joint1 is 'fast'", "number"],
    ),
    "acceleration value": (
        {"keyframes": [{**GOOD, "acceleration": {"panda_joint1": "fast"}}]},
        ["keyframe 1: acceleration.panda_joint1 is 'fast'", "number"],
    ),
    "acceleration linear": (
        {"keyframes": [{**GOOD, "acceleration": {"panda_joint1": 1}}], "interpolation": "linear"},
        ["acceleration is for 'interpolation: smooth'"],
    ),
    "velocity linear": (
        {"keyframes": [{**GOOD, "velocity": {"panda_joint1": 1}}], "interpolation": "linear"},
        ["velocity is for 'interpolation: smooth'"],
    ),
    "beyond limits": (
        {"keyframes": [at(0.0), at(1.0, panda_joint1=3.5)]},
        ["keyframe 2: pose.panda_joint1 is 3.5", "limits", "rad"],
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_file_that_is_wrong_is_refused_with_what_would_be_right(
    tmp_path: Path, case: str
) -> None:
    content, words = REFUSED[case]
    path = written(tmp_path, content)

    with pytest.raises(MotionError) as caught:
        read_keyframes(PANDA, path)

    line = str(caught.value)
    assert "\n" not in line and path in line
    for word in words:
        assert word in line, line


def test_a_rotation_vector_in_parts_is_refused(tmp_path: Path) -> None:
    for pose, missing in (
        ({"chest_x": 0.1, "chest_z": 0.1}, "'chest_y'"),
        ({"root_rx": 0.1}, "'root_ry'"),
    ):
        with pytest.raises(MotionError, match=f"keyframe 2: pose: {missing} is missing"):
            read(tmp_path, at(0.0), at(1.0, **pose), whole=HUMANOID)


def test_a_velocity_of_a_rotation_in_parts_is_refused(tmp_path: Path) -> None:
    frame = {**at(0.0), "velocity": {"chest_x": 0.1}}
    with pytest.raises(MotionError, match=r"keyframe 1: velocity: .*chest_y") as caught:
        read(tmp_path, frame, whole=HUMANOID)

    assert "\n" not in str(caught.value)


def test_a_rest_pose_beyond_limits_is_not_the_files_fault(tmp_path: Path) -> None:
    # a URDF alone has its rest pose at zero, wherever the limits are
    lower, upper = PANDA.position_bounds()
    for rest in (upper[1] + 1.0, lower[1] - 1.0):
        beyond = replace(PANDA, rest_position=(0.0, float(rest), *PANDA.rest_position[2:]))

        keyframes = read(tmp_path, at(0.0), at(1.0, panda_joint1=0.5), whole=beyond)

        assert not overshoots(beyond, keyframes)


SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.just(0.5)
)
POSES = st.one_of(SCALARS, st.dictionaries(st.sampled_from([*JOINTS, "no"]), SCALARS, max_size=3))
FRAMES = st.one_of(
    SCALARS,
    st.fixed_dictionaries(
        {},
        optional={
            **{"time": SCALARS, "pose": POSES, "velocity": POSES, "acceleration": POSES},
            "x": SCALARS,
        },
    ),
)
FILES = st.fixed_dictionaries(
    {"keyframes": st.one_of(SCALARS, st.lists(FRAMES, max_size=4))},
    optional={"loop": SCALARS, "period": SCALARS, "interpolation": SCALARS},
)


@pytest.mark.slow
@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(FILES)
def test_whatever_a_file_says_is_refused_in_one_line_or_followed_within_reason(
    tmp_path: Path, content: dict[str, Any]
) -> None:
    path = written(tmp_path, content)
    try:
        keyframes = read_keyframes(PANDA, path)
    except MotionError as error:
        assert "\n" not in str(error).replace(path, "")
        return
    reference = KeyframesReference(PANDA.layout, keyframes)
    lower, upper = PANDA.position_bounds()
    given_columns = keyframes.configurations.position[:, :3]
    assert np.all((given_columns >= lower[:3] - 1e-9) & (given_columns <= upper[:3] + 1e-9))
    for time in (0.0, 0.3, float(keyframes.times[-1])):
        state = reference.sample(time)
        for array in (state.configuration.position, state.velocity, state.acceleration):
            assert np.isfinite(array).all()
