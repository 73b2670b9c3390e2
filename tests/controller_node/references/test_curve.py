"""Curves against polynomials in closed form, difference quotients and turns about one axis."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from controller_node.references.base import ReferenceState
from controller_node.references.curve import Curve, Knots
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.geometry import rotations
from tests.support.motion import (
    FLOATING,
    MOVED,
    assert_consistent,
    assert_moves_as_it_says,
    assert_same_place,
    loaded,
    random_knots,
)
from tests.support.physics import character_id

TIMES = np.array([0.5, 1.1, 1.3, 2.4])  # s
JUST_BEFORE = 1e-9  # s
DEGREES = {1: "linear", 3: "cubic", 5: "quintic"}

every_moved = pytest.mark.parametrize("name", MOVED, ids=character_id)
every_degree = pytest.mark.parametrize("degree", DEGREES)


def of_degree(knots: Knots, degree: int) -> Knots:
    """The knots with no more than what makes segments of this degree."""
    if degree < 5:
        knots = replace(knots, accelerations=None)
    return replace(knots, velocities=None) if degree < 3 else knots


def times_within(count: int = 40) -> FloatArray:
    """Random times between the knots, none so near to one that a difference spans it."""
    times = np.random.default_rng(5).uniform(TIMES[0], TIMES[-1], count)
    near = np.abs(times[:, np.newaxis] - TIMES).min(axis=1) < 1e-3
    return times[~near]


def at_knot(layout: JointLayout, knots: Knots, number: int) -> ReferenceState:
    whole = knots.configurations
    still = np.zeros(layout.size)
    place = GeneralizedPosition(whole.position[number], whole.orientations_xyzw[number])
    return ReferenceState(place, still, still)


@every_degree
@every_moved
def test_velocity_and_acceleration_are_the_difference_quotients(name: str, degree: int) -> None:
    whole, layout = loaded(name)
    curve = Curve(layout, of_degree(random_knots(whole, TIMES), degree))

    assert_moves_as_it_says(layout, curve.sample, times_within())


@every_degree
def test_a_polynomial_of_its_degree_is_met_exactly(degree: int) -> None:
    _, layout = loaded("franka_panda")
    rng = np.random.default_rng(8)
    polynomials = [Polynomial(rng.normal(size=degree + 1)) for _ in range(layout.size)]

    def values(times: FloatArray, order: int) -> FloatArray:
        return np.array([p.deriv(order)(times) if order else p(times) for p in polynomials]).T

    knots = Knots(TIMES, layout.configuration(values(TIMES, 0)), values(TIMES, 1), values(TIMES, 2))
    curve = Curve(layout, of_degree(knots, degree))

    for time in times_within().tolist():
        state = curve.sample(time)
        at = np.array([time])
        np.testing.assert_allclose(state.configuration.position, values(at, 0)[0], atol=1e-12)
        np.testing.assert_allclose(state.velocity, values(at, 1)[0], atol=1e-11)
        np.testing.assert_allclose(state.acceleration, values(at, 2)[0], atol=1e-9)


@pytest.mark.parametrize("angle", [1e-12, 1e-6, 1e-3, 1.0, 3.0])
@pytest.mark.parametrize("name", FLOATING, ids=character_id)
def test_a_turn_about_one_axis_is_that_of_a_hinge(name: str, angle: float) -> None:
    whole, layout = loaded(name)
    rng = np.random.default_rng(2)
    rest = layout.configuration(np.array(whole.rest_position))
    axes = rng.normal(size=(len(layout.rotation_entries), 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    turned = rotations.multiply(rest.orientations_xyzw, rotations.exp(angle * axes))
    still = np.zeros((2, layout.size))
    ends = GeneralizedPosition(
        np.tile(rest.position, (2, 1)), np.array([rest.orientations_xyzw, turned])
    )
    curve = Curve(layout, Knots(np.array([0.0, 2.0]), ends, still, still))
    rest_to_rest = angle * Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])

    for s in np.linspace(0.0, 0.999, 14).tolist():
        state = curve.sample(2.0 * s)
        expected = rotations.multiply(
            rest.orientations_xyzw, rotations.exp(float(rest_to_rest(s)) * axes)
        )
        velocity, acceleration = np.zeros((2, layout.size))
        velocity[layout.rotation_entries] = rest_to_rest.deriv(1)(s) / 2.0 * axes
        acceleration[layout.rotation_entries] = rest_to_rest.deriv(2)(s) / 4.0 * axes
        atol = 1e-14 + 1e-12 * angle
        np.testing.assert_allclose(
            rotations.angle_between(state.configuration.orientations_xyzw, expected),
            0.0,
            atol=1e-14 if angle < 1.0 else 1e-12,
        )
        np.testing.assert_allclose(state.velocity, velocity, rtol=1e-9, atol=atol)
        np.testing.assert_allclose(state.acceleration, acceleration, rtol=1e-9, atol=10.0 * atol)


@pytest.mark.parametrize("name", FLOATING, ids=character_id)
def test_linear_means_a_constant_angular_velocity_the_shorter_way_round(name: str) -> None:
    whole, layout = loaded(name)
    knots = of_degree(random_knots(whole, TIMES), 1)
    curve = Curve(layout, knots)
    entries = layout.rotation_entries

    for number in range(len(TIMES) - 1):
        duration = TIMES[number + 1] - TIMES[number]
        states = [curve.sample(TIMES[number] + share * duration) for share in (0.0, 0.3, 0.9)]
        for state in states:
            np.testing.assert_allclose(state.velocity, states[0].velocity, atol=1e-12)
            np.testing.assert_allclose(state.acceleration, 0.0, atol=1e-12)
        turned = np.linalg.norm(states[0].velocity[entries], axis=1) * duration
        assert np.all(turned <= np.pi + 1e-9)


@every_moved
def test_it_rests_before_its_first_knot_and_from_its_last_one_on(name: str) -> None:
    whole, layout = loaded(name)
    knots = random_knots(whole, TIMES)
    curve = Curve(layout, knots)

    for time, number in ((-3.0, 0), (0.4999, 0), (2.4, -1), (2.5, -1), (1e9, -1)):
        state = curve.sample(time)
        assert_same_place(layout, state, at_knot(layout, knots, number))
        np.testing.assert_array_equal(state.velocity, 0.0)
        np.testing.assert_array_equal(state.acceleration, 0.0)
        assert_consistent(layout, state)


@every_moved
def test_knots_that_are_equal_or_nearly_so_keep_it_where_it_is(name: str) -> None:
    whole, layout = loaded(name)
    one = random_knots(whole, TIMES[:1]).configurations.position[0]
    for apart in (0.0, 1e-300, 1e-12):
        positions = np.tile(one, (4, 1))
        positions[1::2] += apart
        still = np.zeros((4, layout.size))
        curve = Curve(layout, Knots(TIMES, layout.configuration(positions), still, still))

        for time in times_within().tolist():
            state = curve.sample(time)
            np.testing.assert_allclose(state.velocity, 0.0, atol=1e-10)
            np.testing.assert_allclose(state.acceleration, 0.0, atol=1e-9)


@every_moved
def test_parts_of_different_degrees_join(name: str) -> None:
    whole, layout = loaded(name)
    knots = random_knots(whole, TIMES)

    def part(rows: slice) -> Knots:
        whole_knots = knots.configurations
        assert knots.velocities is not None and knots.accelerations is not None
        return Knots(
            TIMES[rows],
            GeneralizedPosition(whole_knots.position[rows], whole_knots.orientations_xyzw[rows]),
            knots.velocities[rows],
            knots.accelerations[rows],
        )

    quintic, cubic = part(slice(0, 2)), of_degree(part(slice(1, 4)), 3)
    joined = Curve(layout, quintic, cubic)

    for time in times_within().tolist():
        alone = Curve(layout, quintic if time < TIMES[1] else cubic)
        ours, other = joined.sample(time), alone.sample(time)
        np.testing.assert_array_equal(ours.configuration.position, other.configuration.position)
        np.testing.assert_array_equal(ours.velocity, other.velocity)
        np.testing.assert_array_equal(ours.acceleration, other.acceleration)


def test_the_path_of_one_coordinate_is_that_of_the_states() -> None:
    whole, layout = loaded("humanoid")
    curve = Curve(layout, random_knots(whole, TIMES))
    knee = layout.joint("right_knee").start

    times, values = curve.coordinate(knee, np.array([0.0, 0.25, 0.9]))

    assert times.shape == values.shape == (3, 3)
    for time, value in zip(times.ravel().tolist(), values.ravel().tolist(), strict=True):
        position = curve.sample(time).configuration.position
        assert position[knee] == pytest.approx(value, abs=1e-12)


def test_what_a_sample_holds_is_the_callers_own() -> None:
    whole, layout = loaded("humanoid")
    curve = Curve(layout, random_knots(whole, TIMES))
    first = curve.sample(1.0)
    copied = first.configuration.position.copy()

    curve.sample(1.2)
    curve.sample(5.0)

    np.testing.assert_array_equal(first.configuration.position, copied)
