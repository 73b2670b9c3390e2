"""The balance feedback: what it looks at, what it answers, and that it acts."""

from collections.abc import Callable

import numpy as np
import pytest
from physics import character

from controller_node.controller import Controller
from controller_node.feedback import Feedback, RespondingReference, responding
from controller_node.feedback_gains import FEATURES, OUTPUTS, FeedbackGains, checked_gains
from controller_node.parameters import PARAMETERS, character_parameters, make_controller
from controller_node.references.clip import ClipReference
from controller_node.references.clip_file import read_clip
from msgs_config import rotations
from msgs_config.arrays import FloatArray
from msgs_config.errors import CharacterError, ConfigurationError
from msgs_config.parameters import resolve
from msgs_config.stamped import StampedState
from msgs_config.tick_clock import TickClock

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
WALK = ClipReference(LAYOUT, read_clip(HUMANOID, "walk"))
RIGHT_SWINGS, LEFT_SWINGS = 0.85, 0.2  # s, when that foot is 0.1 m above the other


def moved(time: float, change: Callable[[FloatArray, FloatArray], None]) -> FloatArray:
    """The motion's state with a change, and what a feedback of all gains 1 answers to it, apart.

    One row a feature: the response of one gain alone, summed over the degrees of freedom.
    """
    state = WALK.sample(time)
    position, velocity = state.configuration.position.copy(), state.velocity.copy()
    change(position, velocity)
    rows = []
    for feature in FEATURES[:-2]:  # the last two do not depend on the state
        gains = FeedbackGains.of({f"{leg}.hip_x.{feature}": 1.0 for leg in ("stance", "swing")})
        response = Feedback(HUMANOID, WALK, gains).response(time, position, velocity)
        rows.append(response[LAYOUT.joint("right_hip").start])
    return np.array(rows)


def heading(time: float) -> float:
    return float(rotations.yaw(WALK.sample(time).configuration.orientations_xyzw[0]))


def test_the_motion_itself_gets_no_response() -> None:
    found = moved(0.3, lambda position, velocity: None)

    np.testing.assert_allclose(found, 0.0, atol=1e-12)


def test_a_shift_is_seen_as_the_root_sees_it() -> None:
    def shift(position: FloatArray, velocity: FloatArray) -> None:
        position[:3] += (0.03, 0.04, -0.02)

    found = dict(zip(FEATURES[:-2], moved(0.3, shift), strict=True))

    turn = complex(np.cos(heading(0.3)), -np.sin(heading(0.3)))
    seen = turn * complex(0.03, 0.04)
    assert found.pop("centre_x") == pytest.approx(seen.real)
    assert found.pop("centre_y") == pytest.approx(seen.imag)
    assert found.pop("centre_z") == pytest.approx(-0.02)
    np.testing.assert_allclose(list(found.values()), 0.0, atol=1e-12)  # the foot moves along


def test_a_velocity_is_the_centre_of_masss() -> None:
    def faster(position: FloatArray, velocity: FloatArray) -> None:
        velocity[:3] += (0.3, -0.4, 0.2)

    found = dict(zip(FEATURES[:-2], moved(0.3, faster), strict=True))

    seen = complex(np.cos(heading(0.3)), -np.sin(heading(0.3))) * complex(0.3, -0.4)
    assert found.pop("centre_vx") == pytest.approx(seen.real)
    assert found.pop("centre_vy") == pytest.approx(seen.imag)
    assert found.pop("centre_vz") == pytest.approx(0.2)
    np.testing.assert_allclose(list(found.values()), 0.0, atol=1e-12)


def test_a_tilt_and_a_spin_are_those_of_the_base_frame() -> None:
    tilt, spin = np.array((0.1, -0.2, 0.15)), np.array((0.2, 0.3, -0.1))

    def tilted(position: FloatArray, velocity: FloatArray) -> None:
        turn = rotations.multiply(rotations.exp(position[3:6]), rotations.exp(tilt))
        position[3:6] = rotations.log(turn)
        velocity[3:6] += spin

    found = moved(0.3, tilted)

    names = list(FEATURES)
    np.testing.assert_allclose(found[names.index("tilt_x") :][:3], tilt, atol=1e-12)
    np.testing.assert_allclose(found[names.index("spin_x") :][:3], spin, atol=1e-12)


@pytest.mark.parametrize(
    ("time", "swings", "stands"),
    [(RIGHT_SWINGS, "right", "left"), (LEFT_SWINGS, "left", "right")],
)
@pytest.mark.parametrize("joint", ["hip", "ankle"])
def test_each_leg_gets_the_gains_of_what_it_does(
    time: float, swings: str, stands: str, joint: str
) -> None:
    state = WALK.sample(time)
    velocity = state.velocity.copy()
    velocity[:3] += rotations.rotate(rotations.about_z(heading(time)), np.array((0.1, 0.0, 0.0)))
    gains = {f"swing.{joint}_z.centre_vx": 2.0, f"stance.{joint}_y.centre_vx": -3.0}
    feedback = Feedback(HUMANOID, WALK, FeedbackGains.of(gains))

    response = feedback.response(time, state.configuration.position, velocity)

    wanted = np.zeros(LAYOUT.size)
    wanted[LAYOUT.dof_names.index(f"{swings}_{joint}_z")] = 0.2
    wanted[LAYOUT.dof_names.index(f"{stands}_{joint}_y")] = -0.3
    np.testing.assert_allclose(response, wanted, atol=1e-12)


def test_sides_are_mirrored() -> None:
    state = WALK.sample(LEFT_SWINGS)
    gains = FeedbackGains.of({"swing.hip_x.side": 0.2, "stance.hip_x.side": 0.1})

    response = Feedback(HUMANOID, WALK, gains).response(
        LEFT_SWINGS, state.configuration.position, state.velocity
    )

    assert response[LAYOUT.dof_names.index("left_hip_x")] == 0.2
    assert response[LAYOUT.dof_names.index("right_hip_x")] == -0.1


def test_a_response_has_a_bound() -> None:
    state = WALK.sample(LEFT_SWINGS)
    velocity = state.velocity + np.where(LAYOUT.mask(("root",)), 50.0, 0.0)
    gains = FeedbackGains.of({"swing.hip_z.centre_vx": 9.0, "stance.ankle_x.spin_x": -9.0})

    response = Feedback(HUMANOID, WALK, gains).response(
        LEFT_SWINGS, state.configuration.position, velocity
    )

    assert response.max() == 0.6
    assert response.min() == -0.6


def controller(reference: RespondingReference | ClipReference, law: str) -> Controller:
    values = resolve(
        PARAMETERS + character_parameters(HUMANOID), {"law": law, "root_assistance": False}
    )
    return make_controller(HUMANOID, reference, values)


@pytest.mark.parametrize("law", ["pd", "p", "pid"])
def test_a_response_is_an_error_more_to_the_law(law: str) -> None:
    gains = {"swing.hip_z.centre_vx": 0.1, "stance.knee.one": -0.1}
    feedback = Feedback(HUMANOID, WALK, FeedbackGains.of(gains))
    sample, clock = WALK.sample(0.1), TickClock(240)
    velocity = sample.velocity + np.where(LAYOUT.mask(("root",)), 0.1, 0.0)
    state = StampedState(clock.stamp_ns(25), sample.configuration.position, velocity, None)
    first = clock.stamp_ns(1)
    time = 0.1

    plain, reference = controller(WALK, law).answer(state, first)
    answered, same = controller(RespondingReference(WALK, feedback), law).answer(state, first)

    response = feedback.response(time, state.position, velocity)
    stiffness = np.zeros(LAYOUT.size)
    for joint in LAYOUT.joints[1:]:
        stiffness[joint.entries] = HUMANOID.gains[joint.name].stiffness
    assert np.count_nonzero(response) == 2
    np.testing.assert_allclose(answered - plain, stiffness * response, atol=1e-9)
    np.testing.assert_array_equal(reference.position, same.position)


def test_without_feedback_a_reference_is_itself() -> None:
    assert responding(WALK, []) is WALK


def test_responses_of_several_feedbacks_add_up() -> None:
    one, other = (
        Feedback(HUMANOID, WALK, FeedbackGains.of({f"stance.{joint}.one": gain}))
        for joint, gain in (("hip_x", 0.1), ("knee", -0.2))
    )
    state = WALK.sample(LEFT_SWINGS)
    seen = LEFT_SWINGS, state.configuration.position, state.velocity

    both = RespondingReference(WALK, one, other).response(*seen)

    np.testing.assert_array_equal(both, one.response(*seen) + other.response(*seen))
    assert np.count_nonzero(both) == 2


def test_gains_stand_where_their_names_say() -> None:
    gains = FeedbackGains.of({"stance.ankle_y.spin_z": 2.0, "swing.hip_x.centre_x": 3})

    assert gains.stance.shape == gains.swing.shape == (len(OUTPUTS), len(FEATURES))
    assert gains.stance[OUTPUTS.index("ankle_y"), FEATURES.index("spin_z")] == 2.0
    assert gains.swing[OUTPUTS.index("hip_x"), FEATURES.index("centre_x")] == 3.0
    assert np.count_nonzero(gains.stance) == np.count_nonzero(gains.swing) == 1


@pytest.mark.parametrize(
    ("gains", "reason"),
    [
        ({"swing.hip_z": 1.0}, "must be LEG.OUTPUT.FEATURE"),
        ({"third.hip_z.tilt_x": 1.0}, "unknown leg 'third'"),
        ({"swing.elbow.tilt_x": 1.0}, "unknown output 'elbow'"),
        ({"swing.hip_z.tilt_w": 1.0}, "unknown feature 'tilt_w'"),
        ({"swing.hip_z.tilt_x": "much"}, "is 'much'; it must be a number"),
        ({"swing.hip_z.tilt_x": True}, "is True; it must be a number"),
        ({"swing.hip_z.tilt_x": float("nan")}, "is nan; it must be a number"),
        ({"swing.hip_z.tilt_x": 1e9}, "from -100 to 100"),
    ],
)
def test_wrong_gains_are_refused(gains: dict[str, object], reason: str) -> None:
    with pytest.raises(ConfigurationError, match=reason):
        checked_gains(gains)


@pytest.mark.parametrize("name", ["franka_panda", "laikago"])
def test_a_character_without_two_legs_has_no_feedback(name: str) -> None:
    with pytest.raises(CharacterError, match="feedback needs"):
        Feedback(character(name), WALK, FeedbackGains.of({}))
