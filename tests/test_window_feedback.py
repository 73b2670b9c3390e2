"""The feedback that acts window by window: what it looks at, when it answers, its files."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from physics import character

from controller_node.feedback import RespondingReference
from controller_node.motion import make_motion
from controller_node.parameters import PARAMETERS, character_parameters, make_controller
from controller_node.references.clip import ClipReference
from controller_node.references.clip_file import clip_path, read_clip
from controller_node.references.corrected import Corrections
from controller_node.references.corrected_file import read_window_feedback, write_corrected
from controller_node.references.moved import Carry, MovedReference
from controller_node.window_feedback import Deviations, WindowFeedback
from controller_node.window_gains import BALANCE_FEATURES, WindowGains, window_gains
from experiment.samcon.gains_file import check_cycle, read_gains, write_gains
from msgs_config import rotations
from msgs_config.arrays import FloatArray
from msgs_config.errors import CharacterError, ClipError, ConfigurationError, LayoutError
from msgs_config.parameters import resolve
from msgs_config.stamped import StampedState
from msgs_config.tick_clock import TickClock

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
WALK = ClipReference(LAYOUT, read_clip(HUMANOID, "walk"))
DOFS = ("right_hip_x", "right_hip_y", "right_hip_z", "left_knee")
WIDTH = BALANCE_FEATURES + 2 * len(DOFS)
TIME = 0.3
ENDS = (0.1, 0.25, 0.4)


def some_gains(windows: int = 2, size: float = 0.01) -> WindowGains:
    rng = np.random.default_rng(3)
    return WindowGains(
        DOFS,
        np.full(len(DOFS), 0.5),
        rng.uniform(-size, size, (windows, len(DOFS))),
        rng.uniform(-size, size, (windows, len(DOFS), WIDTH)),
    )


def state(time: float, change: Callable[[FloatArray, FloatArray], None]) -> list[FloatArray]:
    """The motion's position and velocity with a change."""
    sample = WALK.sample(time)
    position, velocity = sample.configuration.position.copy(), sample.velocity.copy()
    change(position, velocity)
    return [position, velocity]


def deviations(change: Callable[[FloatArray, FloatArray], None]) -> FloatArray:
    return Deviations(HUMANOID, WALK, DOFS).of(TIME, *state(TIME, change))


def nothing(position: FloatArray, velocity: FloatArray) -> None:
    pass


# What it looks at


def test_the_motion_does_not_deviate_from_itself() -> None:
    assert deviations(nothing).shape == (WIDTH,)
    np.testing.assert_allclose(deviations(nothing), 0.0, atol=1e-12)


def test_a_place_and_a_velocity_are_seen_by_who_looks_ahead() -> None:
    def moved(position: FloatArray, velocity: FloatArray) -> None:
        position[:3] += (0.03, 0.04, -0.02)
        velocity[:3] += (-0.1, 0.2, 0.3)

    found = deviations(moved)

    heading = float(rotations.yaw(WALK.sample(TIME).configuration.orientations_xyzw[0]))
    turn = complex(np.cos(heading), -np.sin(heading))
    assert complex(*found[:2]) == pytest.approx(turn * complex(0.03, 0.04))
    assert complex(*found[3:5]) == pytest.approx(turn * complex(-0.1, 0.2))
    assert found[[2, 5]] == pytest.approx((-0.02, 0.3))
    np.testing.assert_allclose(found[6:], 0.0, atol=1e-12)


def test_tilt_and_spin_are_those_of_the_base_frame_and_joints_their_own() -> None:
    tilt, spin = np.array((0.1, -0.2, 0.15)), np.array((0.2, 0.3, -0.1))
    hip, knee = LAYOUT.joint("right_hip").entries, LAYOUT.joint("left_knee").entries

    def changed(position: FloatArray, velocity: FloatArray) -> None:
        for entries in (slice(3, 6), hip):
            turn = rotations.multiply(rotations.exp(position[entries]), rotations.exp(tilt))
            position[entries] = rotations.log(turn)
            velocity[entries] += spin
        position[knee] -= 0.2
        velocity[knee] += 3.0

    found = deviations(changed)

    np.testing.assert_allclose(found[6:12], (*tilt, *spin), atol=1e-12)
    np.testing.assert_allclose(found[12:16], (*tilt, -0.2), atol=1e-12)
    np.testing.assert_allclose(found[16:], (*spin, 3.0), atol=1e-12)


def test_it_is_the_same_wherever_the_motion_begins() -> None:
    carry = Carry(turn=0.7, x=2.0, y=-1.0)
    elsewhere = MovedReference(LAYOUT, WALK, carry)
    turn = rotations.about_z(carry.turn)

    def changed(position: FloatArray, velocity: FloatArray) -> None:
        position[:3] += (0.03, 0.04, -0.02)
        velocity[:3] += (-0.1, 0.2, 0.3)
        position[LAYOUT.joint("left_knee").entries] += 0.1

    position, velocity = state(TIME, changed)
    position, velocity = position.copy(), velocity.copy()
    position[:3] = np.add(rotations.rotate(turn, position[:3]), (carry.x, carry.y, 0.0))
    velocity[:3] = rotations.rotate(turn, velocity[:3])
    base = rotations.multiply(turn, rotations.exp(position[3:6]))
    position[3:6] = rotations.log(base)

    found = Deviations(HUMANOID, elsewhere, DOFS).of(TIME, position, velocity)

    np.testing.assert_allclose(found, deviations(changed), atol=1e-9)


def test_a_fixed_base_or_a_part_of_a_joint_is_refused() -> None:
    with pytest.raises(CharacterError, match="floating base"):
        Deviations(character("franka_panda"), WALK, ("panda_joint1",))
    with pytest.raises(LayoutError, match="comes in parts"):
        Deviations(HUMANOID, WALK, DOFS[:2])
    with pytest.raises(LayoutError, match="'root' is moved"):
        Deviations(HUMANOID, WALK, LAYOUT.dof_names[:6])


# When it answers


def responses(feedback: WindowFeedback, *times: float, size: float = 0.02) -> list[FloatArray]:
    """Responses at times to states that deviate ever more."""

    def shifted(count: int) -> Callable[[FloatArray, FloatArray], None]:
        def change(position: FloatArray, velocity: FloatArray) -> None:
            position[0] += size * count

        return change

    return [feedback.response(time, *state(time, shifted(n))) for n, time in enumerate(times, 1)]


def feedback(gains: WindowGains) -> WindowFeedback:
    return WindowFeedback(Deviations(HUMANOID, WALK, gains.dofs), gains, ENDS)


def test_it_holds_what_a_windows_first_state_called_for() -> None:
    gains = some_gains()

    first, held, second, held_too = responses(feedback(gains), 0.1, 0.2, 0.25, 0.26)

    wanted = np.zeros(LAYOUT.size)
    features = Deviations(HUMANOID, WALK, DOFS).of(
        0.1, *state(0.1, lambda position, _: position.__setitem__(0, position[0] + 0.02))
    )
    wanted[LAYOUT.indices(DOFS)] = gains.constants[1] + gains.gains[1] @ features
    np.testing.assert_allclose(first, wanted, atol=1e-15)
    np.testing.assert_array_equal(held, first)
    np.testing.assert_array_equal(held_too, second)
    assert not np.array_equal(first, second)


def test_a_window_whose_first_state_was_missed_begins_with_the_next_one() -> None:
    late, held = responses(feedback(some_gains()), 0.12, 0.2)
    (same,) = responses(feedback(some_gains()), 0.12)

    np.testing.assert_array_equal(late, same)
    np.testing.assert_array_equal(held, late)


def test_a_new_episode_begins_anew_and_the_same_state_gets_the_same_answer() -> None:
    acting = feedback(some_gains())
    before = responses(acting, 0.0, 0.05)
    again = responses(acting, 0.0, 0.0, 0.05)

    np.testing.assert_array_equal(again[0], before[0])
    assert not np.array_equal(again[1], before[0])  # a first state counts whenever it comes
    np.testing.assert_array_equal(again[2], again[1])


def test_a_new_episode_whose_first_state_was_missed_begins_anew() -> None:
    acting = feedback(some_gains())
    reference = RespondingReference(WALK, acting)
    (before,) = responses(acting, 0.0)

    reference.begin_episode()
    (late,) = responses(acting, 0.05, size=0.04)

    assert not np.array_equal(late, before)
    np.testing.assert_array_equal(late, responses(feedback(some_gains()), 0.05, size=0.04)[0])


def test_a_controller_that_begins_an_episode_has_forgotten_the_one_before() -> None:
    values = resolve(PARAMETERS + character_parameters(HUMANOID), {"root_assistance": False})
    clock = TickClock(240)

    def answers(*pairs: tuple[int, int]) -> list[FloatArray]:
        """To states of so many ticks in episodes that begin at a tick, shifted ever further."""
        reference = RespondingReference(WALK, feedback(some_gains(size=0.1)))
        acting = make_controller(HUMANOID, reference, values)
        found = []
        for count, (tick, first) in enumerate(pairs, 1):
            position, velocity = state((tick - first) / 240, nothing)
            position[0] += 0.02 * count * (tick != 510)
            stamped = StampedState(clock.stamp_ns(tick), position, velocity, None)
            found.append(acting.answer(stamped, clock.stamp_ns(first))[0])
        return found

    (fresh,) = answers((510, 500))
    *_, after_another = answers((1, 1), (5, 1), (510, 500))

    np.testing.assert_array_equal(after_another, fresh)


def test_windows_of_a_cycle_take_turns_and_after_the_last_one_there_is_none() -> None:
    gains, features = some_gains(2), np.zeros(WIDTH)

    np.testing.assert_array_equal(gains.offset(0, features), gains.constants[0])
    np.testing.assert_array_equal(gains.offset(5, features), gains.constants[1])
    assert not responses(feedback(gains), 0.4)[0].any()
    assert not responses(feedback(gains), 7.0)[0].any()


def test_a_response_has_a_bound() -> None:
    gains = some_gains(size=50.0)

    (found,) = responses(feedback(gains), 0.1)

    assert np.abs(found).max() == 0.5


# Files


def content(**changes: Any) -> dict[str, Any]:
    return {**some_gains().content(), **changes}


def test_gains_are_their_content_and_their_file(tmp_path: Path) -> None:
    file = tmp_path / "some.json"
    write_gains(file, some_gains())

    for found in (window_gains(json.loads(json.dumps(content()))), read_gains(str(file))):
        assert found.content() == some_gains().content()
        assert found.windows == 2


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"dofs": []}, "dofs must be names"),
        ({"dofs": ["right_knee", 3]}, "dofs must be names"),
        ({"largest": [0.1]}, r"largest are \(1,\); they must be \(4\)"),
        ({"largest": [-0.1, 0.1, 0.1, 0.1]}, "largest must be 0 rad or more"),
        ({"constants": []}, "constants are"),
        ({"constants": np.zeros((0, 4))}, "0 windows a cycle"),
        ({"constants": [["a"] * 4]}, "rows of numbers"),
        ({"constants": [["1"] * 4] * 2}, "rows of numbers"),
        ({"largest": [True] * 4}, "rows of numbers"),
        ({"constants": [[0.1] * 4, [0.1]]}, "rows of numbers"),
        ({"gains": [[[0.0] * WIDTH] * 4]}, r"gains are \(1, 4, 20\); they must be \(2, 4, 20\)"),
        ({"gains": np.full((2, 4, WIDTH), np.nan)}, "not finite"),
    ],
)
def test_malformed_gains_are_refused(changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(ConfigurationError, match=reason):
        window_gains(content(**changes))


@pytest.mark.parametrize("whole", [[], {"dofs": ["right_knee"]}, None])
def test_what_is_no_gains_is_refused(whole: object) -> None:
    with pytest.raises(ConfigurationError, match="must have dofs, largest, constants, gains"):
        window_gains(whole)


def test_a_file_that_is_none_is_refused_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"missing\.json: no such file"):
        read_gains(str(tmp_path / "missing.json"))
    with pytest.raises(ConfigurationError, match="one of walk@480"):
        read_gains("stroll")
    for text in ("[", "[" * 100_000):
        (tmp_path / "some.json").write_text(text, encoding="utf-8")
        with pytest.raises(ConfigurationError, match="not JSON"):
            read_gains(str(tmp_path / "some.json"))


def test_a_cycle_of_other_windows_is_refused() -> None:
    check_cycle(2, 2)
    with pytest.raises(ConfigurationError, match="has 2 windows a cycle; here a cycle has 3"):
        check_cycle(2, 3)


def corrected(tmp_path: Path, by_window: WindowGains) -> Path:
    file = tmp_path / "walk.json"
    corrections = Corrections(ENDS, np.zeros((len(ENDS), LAYOUT.size)))
    clip = clip_path(HUMANOID, "walk")
    write_corrected(file, clip, LAYOUT, corrections, {}, {}, by_window)
    return file


def test_a_corrected_clip_brings_it(tmp_path: Path) -> None:
    file = corrected(tmp_path, some_gains())
    values = resolve(
        PARAMETERS + character_parameters(HUMANOID), {"reference": "clip", "clip": str(file)}
    )

    reference = make_motion(HUMANOID, values).reference

    assert isinstance(reference, RespondingReference)
    seen = 0.1, *state(0.1, nothing)
    np.testing.assert_array_equal(reference.response(*seen), feedback(some_gains()).response(*seen))


def test_a_corrected_clip_whose_feedback_moves_the_root_is_refused(tmp_path: Path) -> None:
    dofs = LAYOUT.dof_names[:6]
    width = BALANCE_FEATURES + 12
    root = WindowGains(dofs, np.ones(6), np.zeros((1, 6)), np.zeros((1, 6, width)))
    values = resolve(
        PARAMETERS + character_parameters(HUMANOID),
        {"reference": "clip", "clip": str(corrected(tmp_path, root))},
    )

    with pytest.raises(LayoutError, match="'root' is moved"):
        make_motion(HUMANOID, values)


def test_a_corrected_clip_whose_feedback_is_malformed_is_refused(tmp_path: Path) -> None:
    file = corrected(tmp_path, some_gains())
    whole = json.loads(file.read_text(encoding="utf-8"))
    del whole["WindowFeedback"]["gains"]
    file.write_text(json.dumps(whole), encoding="utf-8")

    with pytest.raises(ClipError, match="WindowFeedback: window feedback must have dofs"):
        read_window_feedback(HUMANOID, str(file))
