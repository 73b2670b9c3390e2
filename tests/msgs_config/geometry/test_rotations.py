"""The rotations form the group SO(3); Rodrigues' formula and matrix products are the judges."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations

IDENTITY = np.array(rotations.IDENTITY_XYZW)
PROPERTY = settings(max_examples=60, deadline=None)
EXACT = 1e-14  # a few roundings of numbers of about one
SPECIAL_ANGLES = [0.0, 1e-300, 1e-160, 1e-12, 1e-8, 1e-4, 1.0, np.pi - 1e-4, np.pi - 1e-8, np.pi]


def directions() -> st.SearchStrategy[FloatArray]:
    """Unit vectors (3,)."""
    component = st.floats(-1.0, 1.0)
    return (
        st.tuples(component, component, component)
        .map(np.array)
        .filter(lambda vector: np.linalg.norm(vector) > 0.1)
        .map(lambda vector: vector / np.linalg.norm(vector))
    )


def rotation_vectors(largest: float = np.pi) -> st.SearchStrategy[FloatArray]:
    """Rotation vectors (3,), the special angles among them."""
    specials = [angle for angle in SPECIAL_ANGLES if angle <= largest]
    angles = st.one_of(st.sampled_from(specials), st.floats(0.0, largest))
    return st.tuples(directions(), angles).map(lambda pair: pair[0] * pair[1])


def quaternions() -> st.SearchStrategy[FloatArray]:
    """Unit quaternions (4,) of either sign, made without the code under test."""
    component = st.floats(-1.0, 1.0)
    specials = [IDENTITY, -IDENTITY, np.array([0.0, 0.6, 0.8, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])]
    anywhere = (
        st.tuples(component, component, component, component)
        .map(np.array)
        .filter(lambda q: np.linalg.norm(q) > 0.1)
        .map(lambda q: q / np.linalg.norm(q))
    )
    return st.one_of(st.sampled_from(specials), anywhere)


def cross_matrix(vector: FloatArray) -> FloatArray:
    """The matrix (3, 3) whose product with u is the cross product `vector x u`."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rodrigues(vector: FloatArray) -> FloatArray:
    """The rotation matrix of a rotation vector by Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    cross = cross_matrix(vector)
    sine = np.sinc(angle / np.pi)  # sin(angle) / angle
    versine = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2  # (1 - cos(angle)) / angle^2
    return np.eye(3) + sine * cross + versine * cross @ cross


def random_quaternions(*shape: int) -> FloatArray:
    q = np.random.default_rng(7).normal(size=(*shape, 4))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


# The group


@PROPERTY
@given(quaternions(), quaternions(), quaternions())
def test_unit_quaternions_are_a_group(a: FloatArray, b: FloatArray, c: FloatArray) -> None:
    product, inverse = rotations.multiply(a, b), rotations.conjugate(a)

    same = partial(np.testing.assert_allclose, rtol=0.0, atol=EXACT)
    same(rotations.multiply(product, c), rotations.multiply(a, rotations.multiply(b, c)))
    same(rotations.multiply(a, inverse), IDENTITY)
    same(rotations.multiply(inverse, a), IDENTITY)
    same(rotations.conjugate(product), rotations.multiply(rotations.conjugate(b), inverse))
    same(np.linalg.norm(product), 1.0)
    np.testing.assert_array_equal(rotations.multiply(a, IDENTITY), a)
    np.testing.assert_array_equal(rotations.multiply(IDENTITY, a), a)


def test_the_units_multiply_as_hamilton_carved_them() -> None:
    i, j, k, one = np.eye(4)

    for unit in (i, j, k):
        np.testing.assert_array_equal(rotations.multiply(unit, unit), -one)
    np.testing.assert_array_equal(rotations.multiply(rotations.multiply(i, j), k), -one)
    np.testing.assert_array_equal(rotations.multiply(i, j), k)
    np.testing.assert_array_equal(rotations.multiply(j, i), -k)


# Matrices


@PROPERTY
@given(quaternions(), quaternions())
def test_matrices_are_the_group_of_rotations(a: FloatArray, b: FloatArray) -> None:
    matrix = rotations.matrix(a)

    of_product = rotations.matrix(rotations.multiply(a, b))
    np.testing.assert_allclose(of_product, matrix @ rotations.matrix(b), rtol=0.0, atol=EXACT)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), rtol=0.0, atol=EXACT)
    assert np.linalg.det(matrix) == pytest.approx(1.0, abs=EXACT)
    np.testing.assert_array_equal(rotations.matrix(-a), matrix)


@PROPERTY
@given(quaternions(), directions())
def test_rotating_a_vector_is_the_sandwich_product(q: FloatArray, vector: FloatArray) -> None:
    pure = np.append(vector, 0.0)
    sandwich = rotations.multiply(rotations.multiply(q, pure), rotations.conjugate(q))

    rotated = rotations.rotate(q, vector)

    np.testing.assert_allclose(rotated, sandwich[:3], rtol=0.0, atol=EXACT)


@pytest.mark.parametrize(
    ("turn", "x", "y"),
    [
        (rotations.about_z(0.5 * np.pi), [0, 1, 0], [-1, 0, 0]),
        (rotations.ABOUT_X_QUARTER_TURN_XYZW, [1, 0, 0], [0, 0, 1]),  # a y-up model stands
    ],
    ids=["about z", "about x"],
)
def test_quarter_turns_take_axes_to_axes(turn: FloatArray, x: list[int], y: list[int]) -> None:
    np.testing.assert_allclose(rotations.rotate(turn, np.eye(3)[0]), x, atol=EXACT)
    np.testing.assert_allclose(rotations.rotate(turn, np.eye(3)[1]), y, atol=EXACT)


# Exponential and logarithm


@PROPERTY
@given(rotation_vectors(largest=20.0))
def test_exp_agrees_with_the_formula_of_rodrigues(vector: FloatArray) -> None:
    q = rotations.exp(vector)

    np.testing.assert_allclose(rotations.matrix(q), rodrigues(vector), rtol=0.0, atol=1e-13)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=EXACT)


@PROPERTY
@given(rotation_vectors(largest=np.pi - 1e-7))
def test_log_undoes_exp(vector: FloatArray) -> None:
    returned = rotations.log(rotations.exp(vector))

    np.testing.assert_allclose(returned, vector, rtol=0.0, atol=EXACT)


@pytest.mark.parametrize("angle", [1e-140, 1e-100, 1e-12, 1e-8, 1e-4, 0.1])
def test_a_small_rotation_keeps_its_relative_accuracy(angle: float) -> None:
    vector = angle * np.array([0.6, 0.0, -0.8])

    returned = rotations.log(rotations.exp(vector))

    np.testing.assert_allclose(returned, vector, rtol=1e-14, atol=0.0)


@pytest.mark.parametrize("angle", [0.0, 1e-300])
def test_no_rotation_is_the_identity_to_the_bit(angle: float) -> None:
    q = rotations.exp(np.array([0.0, angle, 0.0]))

    np.testing.assert_array_equal(q, IDENTITY)
    np.testing.assert_array_equal(rotations.log(q), np.zeros(3))


@PROPERTY
@given(directions())
def test_half_a_turn_has_two_rotation_vectors_of_which_log_gives_one(axis: FloatArray) -> None:
    returned = rotations.log(rotations.exp(np.pi * axis))

    nearest = min(np.abs(returned - sign * np.pi * axis).max() for sign in (-1.0, 1.0))
    assert nearest < 1e-14


@pytest.mark.parametrize("excess", [1e-9, 1e-3, 1.0, 3.0])
def test_more_than_half_a_turn_is_less_than_half_a_turn_the_other_way(excess: float) -> None:
    axis = np.array([0.0, 0.6, 0.8])

    returned = rotations.log(rotations.exp((np.pi + excess) * axis))

    np.testing.assert_allclose(returned, (excess - np.pi) * axis, rtol=0.0, atol=EXACT)


@PROPERTY
@given(quaternions())
def test_log_is_one_vector_of_at_most_half_a_turn_which_exp_undoes(q: FloatArray) -> None:
    vector = rotations.log(q)

    returned = rotations.exp(vector)
    sign = 1.0 if returned @ q > 0.0 else -1.0
    np.testing.assert_allclose(sign * returned, q, rtol=0.0, atol=EXACT)
    assert np.linalg.norm(vector) <= np.pi * (1.0 + 1e-15)
    np.testing.assert_array_equal(rotations.log(-q), vector)


@PROPERTY
@given(quaternions(), directions())
def test_an_angular_velocity_in_the_child_frame_turns_from_the_right(
    q: FloatArray, velocity: FloatArray
) -> None:
    step = 1e-5
    ahead = rotations.matrix(rotations.multiply(q, rotations.exp(step * velocity)))
    behind = rotations.matrix(rotations.multiply(q, rotations.exp(-step * velocity)))

    derivative = (ahead - behind) / (2.0 * step)

    expected = rotations.matrix(q) @ cross_matrix(velocity)
    np.testing.assert_allclose(derivative, expected, rtol=0.0, atol=1e-9)


@PROPERTY
@given(rotation_vectors(3.0), directions())
def test_the_right_jacobians_inverse_gives_the_rate_of_the_rotation_vector(
    vector: FloatArray, velocity: FloatArray
) -> None:
    step = 1e-5
    ahead, behind = (
        rotations.log(rotations.multiply(rotations.exp(vector), rotations.exp(sign * velocity)))
        for sign in (step, -step)
    )

    rate = rotations.right_jacobian_inverse(vector) @ velocity

    np.testing.assert_allclose(rate, (ahead - behind) / (2.0 * step), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("angle", [0.5, 3.0, 4.0, 6.0])
def test_the_right_jacobians_inverse_undoes_the_right_jacobian(angle: float) -> None:
    """Which is the mean of exp(-s r) over s from 0 to 1, also beyond half a turn."""
    vector = angle * np.array([0.6, 0.0, -0.8])
    shares = (np.arange(2000) + 0.5) / 2000
    jacobian = rotations.matrix(rotations.exp(-shares[:, np.newaxis] * vector)).mean(axis=0)

    product = rotations.right_jacobian_inverse(vector) @ jacobian

    np.testing.assert_allclose(product, np.eye(3), rtol=0.0, atol=1e-5)


# The rates of a rotation vector


@pytest.mark.parametrize("angle", [0.0, 1e-160, 1e-8, 1e-3, 0.5, 3.16, 3.17, 4.0, 6.2])
def test_a_coning_motion_turns_as_its_three_turns_about_axes_do(angle: float) -> None:
    # exp(angle (cos p, sin p, 0)) is Rz(p) Rx(angle) Rz(-p)
    phase, speed = 0.7, 1.3
    towards = np.array([np.cos(phase), np.sin(phase), 0.0])
    across = np.array([-np.sin(phase), np.cos(phase), 0.0])

    velocity, acceleration = rotations.angular_motion(
        angle * towards, angle * speed * across, -angle * speed**2 * towards
    )

    up = np.array([0.0, 0.0, 1.0])
    expected = speed * (np.sin(angle) * across - 2.0 * np.sin(0.5 * angle) ** 2 * up)
    np.testing.assert_allclose(velocity, expected, rtol=1e-13, atol=EXACT)
    expected = -(speed**2) * np.sin(angle) * towards
    np.testing.assert_allclose(acceleration, expected, rtol=1e-13, atol=3.0 * EXACT)


@PROPERTY
@given(rotation_vectors(6.0), directions(), directions())
def test_angular_velocity_and_acceleration_are_the_difference_quotients(
    vector: FloatArray, rate: FloatArray, second_rate: FloatArray
) -> None:
    step = 1e-5

    def moved(time: float) -> tuple[FloatArray, FloatArray]:
        """The rotation vector and its rate at a time, with a third rate of zero."""
        now = vector + time * rate + 0.5 * time**2 * second_rate
        return now, rate + time * second_rate

    velocity, acceleration = rotations.angular_motion(vector, rate, second_rate)
    before, after = moved(-step), moved(step)
    relative = rotations.multiply(
        rotations.conjugate(rotations.exp(before[0])), rotations.exp(after[0])
    )
    np.testing.assert_allclose(rotations.log(relative) / (2.0 * step), velocity, atol=1e-8)
    gained = (
        rotations.angular_motion(*after, second_rate)[0]
        - rotations.angular_motion(*before, second_rate)[0]
    )
    np.testing.assert_allclose(gained / (2.0 * step), acceleration, atol=1e-8)


@PROPERTY
@given(rotation_vectors(), directions(), directions())
def test_the_rates_of_a_rotation_vector_give_the_motion_that_they_are_of(
    vector: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> None:
    rate, second_rate = rotations.rotation_vector_rates(vector, velocity, acceleration)
    motion = rotations.angular_motion(vector, rate, second_rate)

    np.testing.assert_allclose(motion[0], velocity, atol=1e-10)
    np.testing.assert_allclose(motion[1], acceleration, atol=1e-9)


# Angles


@PROPERTY
@given(quaternions(), directions(), st.floats(0.0, np.pi))
def test_the_angle_between_two_rotations_is_that_of_the_turn_between_them(
    q: FloatArray, axis: FloatArray, angle: float
) -> None:
    turned = rotations.multiply(q, rotations.exp(angle * axis))

    for end in (turned, -turned):
        assert rotations.angle_between(q, end) == pytest.approx(angle, abs=1e-13)
        assert rotations.angle_between(end, q) == pytest.approx(angle, abs=1e-13)


@PROPERTY
@given(st.floats(-np.pi, np.pi), st.floats(0.0, 3.0), st.floats(-np.pi, np.pi))
def test_the_yaw_of_a_turn_about_z_after_a_tilt_is_the_turn(
    angle: float, tilt: float, towards: float
) -> None:
    swing = rotations.exp(tilt * np.array([np.cos(towards), np.sin(towards), 0.0]))

    yaw = rotations.yaw(rotations.multiply(rotations.about_z(angle), swing))

    assert np.sin(0.5 * (yaw - angle)) == pytest.approx(0.0, abs=1e-13)  # 2 pi is no difference


@PROPERTY
@given(quaternions(), st.floats(1e-3, 1e3))
def test_normalising_keeps_the_direction(q: FloatArray, length: float) -> None:
    normalised = rotations.normalised(length * q)

    np.testing.assert_allclose(normalised, q, rtol=0.0, atol=EXACT)


# Orders of components and shapes of batches


def test_the_scalar_goes_from_the_front_to_the_back_and_returns() -> None:
    wxyz = np.array([[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0]])

    xyzw = rotations.xyzw_from_wxyz(wxyz)

    np.testing.assert_array_equal(xyzw, [[2.0, 3.0, 4.0, 1.0], [6.0, 7.0, 8.0, 5.0]])
    np.testing.assert_array_equal(rotations.wxyz_from_xyzw(xyzw), wxyz)


UNARY: dict[str, tuple[Callable[[FloatArray], FloatArray], tuple[int, ...]]] = {
    "conjugate": (rotations.conjugate, (4,)),
    "matrix": (rotations.matrix, (3, 3)),
    "log": (rotations.log, (3,)),
    "exp of log": (lambda q: rotations.exp(rotations.log(q)), (4,)),
    "right_jacobian_inverse of log": (
        lambda q: rotations.right_jacobian_inverse(rotations.log(q)),
        (3, 3),
    ),
    "angular_motion along log": (
        lambda q: rotations.angular_motion(rotations.log(q), q[..., :3], q[..., 1:])[1],
        (3,),
    ),
    "rotation_vector_rates at log": (
        lambda q: rotations.rotation_vector_rates(rotations.log(q), q[..., :3], q[..., 1:])[1],
        (3,),
    ),
    "normalised": (rotations.normalised, (4,)),
    "yaw": (rotations.yaw, ()),
    "xyzw_from_wxyz": (rotations.xyzw_from_wxyz, (4,)),
    "wxyz_from_xyzw": (rotations.wxyz_from_xyzw, (4,)),
}
BINARY: dict[str, tuple[Callable[[FloatArray, FloatArray], FloatArray], tuple[int, ...]]] = {
    "multiply": (rotations.multiply, (4,)),
    "rotate": (lambda a, b: rotations.rotate(a, b[..., :3]), (3,)),
    "angle_between": (rotations.angle_between, ()),
}


@pytest.mark.parametrize("shape", [(), (1,), (5,), (2, 3), (0,), (3, 0)])
@pytest.mark.parametrize("name", UNARY)
def test_a_function_of_a_batch_is_the_function_of_each(name: str, shape: tuple[int, ...]) -> None:
    function, result_shape = UNARY[name]
    batch = random_quaternions(*shape)

    result = function(batch)

    assert result.shape == shape + result_shape
    for index in np.ndindex(shape):
        np.testing.assert_allclose(result[index], function(batch[index]), rtol=0.0, atol=EXACT)


@pytest.mark.parametrize(
    ("left", "right"),
    [((), ()), ((5,), (5,)), ((), (5,)), ((5,), ()), ((2, 1), (1, 3)), ((0,), ()), ((0,), (0,))],
)
@pytest.mark.parametrize("name", BINARY)
def test_a_function_of_two_batches_broadcasts_them(
    name: str, left: tuple[int, ...], right: tuple[int, ...]
) -> None:
    function, result_shape = BINARY[name]
    a, b = random_quaternions(*left), random_quaternions(*right)
    shape = np.broadcast_shapes(left, right)

    result = function(a, b)

    assert result.shape == shape + result_shape
    a, b = np.broadcast_to(a, (*shape, 4)), np.broadcast_to(b, (*shape, 4))
    for index in np.ndindex(shape):
        np.testing.assert_allclose(result[index], function(a[index], b[index]), atol=EXACT)


def test_no_function_changes_its_arguments() -> None:
    a, b = random_quaternions(2, 5)
    a_before, b_before = a.copy(), b.copy()

    for unary, _ in UNARY.values():
        unary(a)
    for binary, _ in BINARY.values():
        binary(a, b)

    np.testing.assert_array_equal(a, a_before)
    np.testing.assert_array_equal(b, b_before)
