"""What a policy is told: the same wherever the world is, and nothing of a state that fits."""

import math

import numpy as np
import pytest

from controller_node.control_laws import GainArrays
from controller_node.parameters import resolve_for
from controller_node.planner.compiled.observation import (
    FRAME_VECTORS,
    ObservationScales,
    find_deviation,
    heading,
    observe,
    write_frame,
)
from controller_node.planner.compiled.rollout import features_against, features_of
from controller_node.planner.contact_model import ContactModel
from controller_node.references.factory import make_motion
from msgs_config.arrays import FloatArray, SingleArray
from msgs_config.character.model import Placement
from msgs_config.geometry import rotations
from tests.support.physics import character, random_state

HUMANOID = character("humanoid")
N = HUMANOID.layout.size
MODEL = ContactModel(HUMANOID, period_s=1 / 240, gravity=9.81, friction=0.45)
NOTHING = np.zeros(N)
BODY = MODEL.body(GainArrays(NOTHING, NOTHING, NOTHING, HUMANOID.effort_limits()))
ENGINE = MODEL.engine()
CENTRE = 2 * N - 6
FRAME = FRAME_VECTORS + 3 * len(HUMANOID.end_effectors) + N - 6
FRAMES = 3
PLAIN = ObservationScales(
    np.ones(MODEL.feature_count), np.zeros((FRAMES, FRAME)), np.ones((FRAMES, FRAME)), CENTRE
)
CLIPPED_AT = 5.0  # scales

State = tuple[FloatArray, FloatArray]  # MuJoCo's position (q,), velocity (n,)


def a_state(seed: int) -> State:
    """Any state near the origin."""
    position, velocity = random_state(HUMANOID, np.random.default_rng(seed))
    return MODEL.position_of(position), velocity


def moved(state: State, shift: FloatArray, turn: float) -> State:
    """A state of a world that is turned about z, and then shifted over the ground."""
    position, velocity = state[0].copy(), state[1].copy()
    about_z = rotations.about_z(turn)
    position[:3] = rotations.rotate(about_z, position[:3]) + shift
    root = rotations.multiply(about_z, rotations.xyzw_from_wxyz(position[3:7]))
    position[3:7] = rotations.wxyz_from_xyzw(root)
    velocity[:3] = rotations.rotate(about_z, velocity[:3])
    return position, velocity


def deviation_of(state: State, wanted: State) -> FloatArray:
    """Deviation (f,) of a state from the reference's."""
    found, features = np.zeros((2, MODEL.feature_count))
    features_of(found, *wanted, BODY, ENGINE)
    features_against(features, *state, wanted[0], BODY, ENGINE)
    deviation = np.empty(MODEL.feature_count)
    find_deviation(deviation, features, found, heading(wanted[0], MODEL.left), CENTRE)
    return deviation


def observed(
    state: State, reference: list[State], scales: ObservationScales = PLAIN
) -> SingleArray:
    """The observation of a state and of the reference, whose first frame is now."""
    frames = np.empty((len(reference), FRAME))
    for row, (position, velocity) in zip(frames, reference, strict=True):
        features = np.zeros(MODEL.feature_count)
        features_of(features, position, velocity, BODY, ENGINE)
        joints = MODEL.message_position(position)[6:]
        write_frame(row, position, joints, features, CENTRE)
    observation = np.full(MODEL.feature_count + frames.size, np.nan, np.float32)
    deviation = deviation_of(state, reference[0])
    observe(observation, deviation, frames, heading(reference[0][0], MODEL.left), scales)
    return observation


@pytest.mark.parametrize("name", ["humanoid", "laikago"])
@pytest.mark.parametrize("yaw", [-3.0, -0.4, 0.0, 2.0])
def test_what_pitches_over_backwards_keeps_its_heading(name: str, yaw: float) -> None:
    whole = character(name)
    model = ContactModel(whole, period_s=1 / 240, gravity=9.81, friction=0.45)
    position = np.array(whole.rest_position)
    standing = rotations.exp(position[3:6])

    for about, angles in ((1, np.linspace(-6.0, 6.0, 25)), (0, np.linspace(-1.5, 1.5, 7))):
        for angle in angles:
            leaning = rotations.exp(angle * np.eye(3)[about])
            root = rotations.multiply(rotations.about_z(yaw), rotations.multiply(leaning, standing))
            position[3:6] = rotations.log(root)
            found = heading(model.position_of(position), model.left)
            assert found == pytest.approx(yaw, abs=1e-9), (about, angle)


@pytest.mark.parametrize(("name", "way"), [("humanoid", 0.0), ("laikago", 0.5 * math.pi)])
def test_what_walks_faces_where_it_goes(name: str, way: float) -> None:
    values = resolve_for(character(name), {"reference": "clip", "clip": "walk"})
    walk = make_motion(character(name), values).reference
    model = ContactModel(character(name), period_s=1 / 240, gravity=9.81, friction=0.45)
    for time in np.arange(0.0, 2.0, 0.05):
        position = model.position_of(walk.sample(time).configuration.position)
        assert heading(position, model.left) == pytest.approx(way, abs=0.25)


def test_where_a_character_is_placed_changes_nothing_of_where_its_left_is() -> None:
    placed = HUMANOID.placed(Placement(1.0, 2.0, 0.0, 0.9))
    model = ContactModel(placed, period_s=1 / 240, gravity=9.81, friction=0.45)

    np.testing.assert_allclose(model.left, MODEL.left, atol=1e-15)
    position = model.position_of(np.array(placed.rest_position))
    assert heading(position, model.left) == pytest.approx(0.9)


@pytest.mark.parametrize("seed", range(8))
def test_wherever_the_world_is_it_is_told_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    state, *reference = (a_state(100 * seed + number) for number in range(1 + FRAMES))
    shift, turn = np.append(rng.uniform(-1000.0, 1000.0, 2), 0.0), rng.uniform(-math.pi, math.pi)

    here = observed(state, reference)
    there = observed(moved(state, shift, turn), [moved(frame, shift, turn) for frame in reference])

    np.testing.assert_allclose(there, here, atol=5e-6)
    assert abs(here).max() > 1.0
    alone = observed(moved(state, shift, turn), reference)
    assert abs(alone - here).max() > 0.1


@pytest.mark.parametrize("seed", range(3))
def test_a_state_that_is_the_references_deviates_by_nothing(seed: int) -> None:
    state = a_state(seed)

    assert not deviation_of(state, state).any()
    assert not observed(state, [state] * FRAMES)[: MODEL.feature_count].any()


def test_the_first_frame_is_now_and_vectors_are_from_the_centre_of_mass() -> None:
    state = moved(a_state(3), np.array((7.0, -3.0, 0.0)), 0.0)
    features = np.zeros(MODEL.feature_count)
    features_of(features, *state, BODY, ENGINE)
    facing = heading(state[0], MODEL.left)

    wide = PLAIN._replace(frame_scale=np.full((FRAMES, FRAME), 10.0))
    told = 10.0 * observed(state, [state] * FRAMES, wide)[MODEL.feature_count :]

    frames = told.reshape(FRAMES, FRAME)
    assert (frames == frames[0]).all()
    centre, back = features[CENTRE : CENTRE + 3], rotations.about_z(-facing)
    ends = features[CENTRE + 9 :].reshape(-1, 3) - centre
    axes = rotations.matrix(rotations.xyzw_from_wxyz(state[0][3:7]))
    velocity = features[CENTRE + 3 : CENTRE + 6]
    vectors = rotations.rotate(back, np.array((velocity, axes[:, 0], axes[:, 2], *ends)))
    wanted = (0.0, 0.0, centre[2], *vectors.ravel(), *MODEL.message_position(state[0])[6:])
    np.testing.assert_allclose(frames[0], wanted, atol=1e-5)


def test_nothing_is_more_than_five_scales_off() -> None:
    rng = np.random.default_rng(8)
    state, *reference = (a_state(number) for number in range(1 + FRAMES))
    fine = ObservationScales(
        rng.uniform(0.01, 0.3, MODEL.feature_count),
        rng.normal(size=(FRAMES, FRAME)),
        rng.uniform(0.01, 0.3, (FRAMES, FRAME)),
        CENTRE,
    )
    size = MODEL.feature_count
    scale = np.concatenate((fine.deviation, fine.frame_scale.ravel()))
    mean = np.concatenate((np.zeros(size), fine.frame_mean.ravel()))
    wide = ObservationScales(
        np.full(size, 100.0), np.zeros((FRAMES, FRAME)), np.full((FRAMES, FRAME), 100.0), CENTRE
    )

    found, whole = observed(state, reference, fine), 100.0 * observed(state, reference, wide)

    expected = np.clip((whole - mean) / scale, -CLIPPED_AT, CLIPPED_AT)
    np.testing.assert_allclose(found, expected, atol=5e-3)
    assert 0.2 < np.mean(abs(found) == CLIPPED_AT) < 0.95
