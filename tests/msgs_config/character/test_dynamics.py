"""What the control laws ask the model: solving, errors, inverse dynamics, and gravity's part.

Judged by dense linear algebra on the mass matrix, by the layout's own difference, and by the
simulator's engine. That both engines agree on mass matrix and bias is `test_engine_agreement.py`.
"""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointLayout
from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from sim_node.physics.probe import still_settings
from sim_node.physics.settings import WorldSettings
from tests.support.physics import (
    DAMPED,
    EVERY_CHARACTER,
    INSTANT,
    LoneWorld,
    acceleration,
    character,
    character_id,
    free_random_state,
    random_state,
    without_self_collision,
)

STATES = 20
PERIOD = 1.0 / 240.0
PROPERTY = settings(max_examples=60, deadline=None)
TURN = character("humanoid").layout.joint("chest").entries
every_character = pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)


@lru_cache
def model_of(name: str) -> DynamicsModel:
    return DynamicsModel(character(name))


def random_scenes(name: str) -> Iterator[tuple[DynamicsModel, FloatArray, FloatArray]]:
    """The model in random states."""
    whole, model, rng = character(name), DynamicsModel(character(name)), np.random.default_rng(1)
    for _ in range(STATES):
        position, velocity = random_state(whole, rng)
        model.update(position, velocity)
        yield model, position, velocity


def engine_damping(whole: Character, velocity: FloatArray) -> FloatArray:
    """The effort (n,) of passive damping, which the engine's world leaves to others."""
    return -whole.passive_damping() * velocity


def difference(layout: JointLayout, start: FloatArray, end: FloatArray) -> FloatArray:
    return layout.difference(layout.configuration(start), layout.configuration(end))


# Yielding


@every_character
def test_what_joints_yield_to_each_others_efforts_is_what_the_engine_says(name: str) -> None:
    # Arrange
    whole, model = without_self_collision(name), DynamicsModel(character(name))
    size = whole.layout.size
    position, _ = random_state(whole, np.random.default_rng(1))
    joints = np.eye(size)[6 if whole.layout.has_floating_base else 0 :]
    with LoneWorld(whole, still_settings(gravity=0.0)) as world:
        measured = []
        for effort in joints:
            world.body.set_state(position, np.zeros(size))
            measured.append(acceleration(world, effort) @ joints.T)

    # Act
    model.update(position, np.zeros(size))
    found = model.delassus_matrix(joints)

    # Assert
    scale = np.abs(measured).max(initial=1e-9)
    expected = np.array(measured).reshape(found.shape)
    np.testing.assert_allclose(found / scale, expected / scale, atol=1e-9)


@every_character
def test_the_delassus_matrix_is_j_inverse_m_j_transposed(name: str) -> None:
    rng = np.random.default_rng(5)
    for model, position, _ in random_scenes(name):
        rows = rng.normal(size=(3, len(position)))

        expected = rows @ np.linalg.solve(model.mass_matrix(), rows.T)

        found = model.delassus_matrix(rows)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


# Solving


@every_character
def test_solving_is_that_of_the_whole_matrix_by_numpy(name: str) -> None:
    damping, rng = character(name).passive_damping(), np.random.default_rng(2)
    for model, position, _ in random_scenes(name):
        force = rng.uniform(-100.0, 100.0, len(position))
        added = rng.uniform(0.0, 10.0, len(position)) * rng.integers(0, 2, len(position))
        period = rng.uniform(0.001, 0.1)

        found = model.solve(force, added, period)

        matrix = model.mass_matrix() + np.diag(period * damping + added)
        expected = np.linalg.solve(matrix, force)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
        np.testing.assert_allclose(matrix @ found, force, rtol=0.0, atol=1e-9)


@every_character
def test_solving_changes_neither_the_mass_matrix_nor_the_bias_nor_its_inputs(name: str) -> None:
    rng = np.random.default_rng(4)
    for model, position, _ in random_scenes(name):
        matrix, bias = model.mass_matrix(), model.bias_force()
        force, added = rng.uniform(0.0, 100.0, (2, len(position)))
        inputs = force.copy(), added.copy()

        first = model.solve(force, added, PERIOD)
        again = model.solve(force, added, PERIOD)

        assert again.tobytes() == first.tobytes()
        assert model.mass_matrix().tobytes() == matrix.tobytes()
        assert model.bias_force().tobytes() == bias.tobytes()
        assert (force.tobytes(), added.tobytes()) == tuple(given.tobytes() for given in inputs)


def test_the_passive_damping_of_the_periods_end_is_in_what_is_solved() -> None:
    """Else the characters above would be as well off without it: one has a damping of 5."""
    model, position, _ = next(random_scenes(DAMPED))
    force, nothing = np.ones(len(position)), np.zeros(len(position))

    with_damping, without = model.solve(force, nothing, 0.1), model.solve(force, nothing, 0.0)

    assert np.abs(with_damping - without).max() > 0.01 * np.abs(without).max()


# Errors


@every_character
def test_the_error_is_the_layouts_difference(name: str) -> None:
    whole, model, rng = character(name), model_of(name), np.random.default_rng(5)
    for _ in range(STATES):
        (start, _), (end, _) = random_state(whole, rng), random_state(whole, rng)
        before = start.copy(), end.copy()

        error = model.compute_error(start, end)

        expected = difference(whole.layout, start, end)
        np.testing.assert_allclose(error, expected, rtol=0.0, atol=1e-12)
        assert (start.tobytes(), end.tobytes()) == tuple(given.tobytes() for given in before)
        np.testing.assert_allclose(model.compute_error(start, start), 0.0, rtol=0.0, atol=1e-15)


def unit_vectors() -> st.SearchStrategy[FloatArray]:
    component = st.floats(-1.0, 1.0)
    return (
        st.tuples(component, component, component)
        .map(np.array)
        .filter(lambda vector: bool(np.linalg.norm(vector) > 0.1))
        .map(lambda vector: vector / np.linalg.norm(vector))
    )


ANGLES = st.one_of(
    st.sampled_from([0.0, 1e-300, 1e-12, 1e-8, 1e-4, np.pi - 1e-4, np.pi - 1e-8, np.pi]),
    st.floats(0.0, np.pi),
)
TURNS = st.tuples(unit_vectors(), ANGLES).map(lambda pair: pair[0] * pair[1])


@given(TURNS, TURNS)
@PROPERTY
def test_rotations_of_any_angle_have_the_error_that_leads_from_one_to_the_other(
    start_turn: FloatArray, end_turn: FloatArray
) -> None:
    """At an angle of pi apart there are two, of opposite signs; either leads there."""
    layout, rest = character("humanoid").layout, np.array(character("humanoid").rest_position)
    start, end = rest.copy(), rest.copy()
    start[TURN], end[TURN] = start_turn, end_turn

    error = model_of("humanoid").compute_error(start, end)

    reached = rotations.matrix(rotations.exp(start_turn)) @ rotations.matrix(
        rotations.exp(error[TURN])
    )
    np.testing.assert_allclose(
        reached, rotations.matrix(rotations.exp(end_turn)), rtol=0.0, atol=1e-12
    )
    assert np.linalg.norm(error[TURN]) <= np.pi + 1e-12
    expected = difference(layout, start, end)
    if np.linalg.norm(expected[TURN]) < np.pi - 1e-6:
        np.testing.assert_allclose(error, expected, rtol=0.0, atol=1e-12)


def test_asking_for_an_error_leaves_the_state_alone() -> None:
    rng = np.random.default_rng(7)
    for model, position, _ in random_scenes("humanoid"):
        before = model.mass_matrix(), model.bias_force(), *model.link_poses()

        model.compute_error(rng.uniform(-1.0, 1.0, len(position)), position)

        after = model.mass_matrix(), model.bias_force(), *model.link_poses()
        assert all(a.tobytes() == b.tobytes() for a, b in zip(after, before, strict=True))


# Inverse dynamics


@every_character
def test_inverse_dynamics_is_mass_times_acceleration_plus_bias(name: str) -> None:
    rng = np.random.default_rng(8)
    for model, position, _ in random_scenes(name):
        wanted = rng.uniform(-20.0, 20.0, len(position))
        bias = model.bias_force()

        effort = model.inverse_dynamics(wanted)

        expected = model.mass_matrix() @ wanted + bias
        tolerance = 1e-12 * (1.0 + np.abs(expected).max())
        np.testing.assert_allclose(effort, expected, rtol=0.0, atol=tolerance)
        assert model.bias_force().tobytes() == bias.tobytes()
        assert model.inverse_dynamics(np.zeros(len(position))).tolist() == bias.tolist()


@every_character
def test_the_engine_accelerates_by_an_effort_as_inverse_dynamics_asked_for(name: str) -> None:
    whole = without_self_collision(name)
    model, rng = DynamicsModel(whole), np.random.default_rng(9)
    with LoneWorld(whole, WorldSettings(step_s=INSTANT, ground=False)) as world:
        for _ in range(STATES):
            position, velocity = free_random_state(world.body, whole, rng)
            model.update(position, velocity)
            wanted = rng.uniform(-20.0, 20.0, len(position))
            effort = model.inverse_dynamics(wanted)

            measured = acceleration(world, effort + engine_damping(whole, velocity))

            np.testing.assert_allclose(measured, wanted, rtol=0.0, atol=1e-4)


# Gravity


@every_character
def test_gravity_is_the_bias_at_rest_and_leaves_the_state_alone(name: str) -> None:
    at_rest = DynamicsModel(character(name))
    for model, position, velocity in random_scenes(name):
        matrix, bias = model.mass_matrix(), model.bias_force()
        energy = model.kinetic_energy()

        force = model.gravity_force()

        at_rest.update(position, np.zeros_like(velocity))
        assert force.tolist() == at_rest.bias_force().tolist()
        assert model.bias_force().tobytes() == bias.tobytes()
        assert model.mass_matrix().tobytes() == matrix.tobytes()
        assert model.kinetic_energy() == energy
        assert model.gravity_force().tobytes() == force.tobytes()


@every_character
def test_gravity_holds_the_engine_still(name: str) -> None:
    whole = without_self_collision(name)
    model, rng = DynamicsModel(whole), np.random.default_rng(10)
    with LoneWorld(whole, WorldSettings(step_s=INSTANT, ground=False)) as world:
        position, velocity = free_random_state(world.body, whole, rng)
        model.update(position, velocity)  # it moves, and that is not to count
        world.body.set_state(position, np.zeros_like(velocity))

        measured = acceleration(world, model.gravity_force())

    np.testing.assert_allclose(measured, 0.0, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("gravity", [0.0, 1.62, 9.81])
def test_a_floating_base_is_held_by_its_weight(gravity: float) -> None:
    whole = character("humanoid")
    model = DynamicsModel(whole, gravity)
    model.update(*random_state(whole, np.random.default_rng(11)))

    force = model.gravity_force()

    np.testing.assert_allclose(force[:3], [0.0, 0.0, whole.mass * gravity], rtol=1e-12, atol=1e-12)


# The state


@every_character
def test_a_state_that_is_taken_over_leaves_no_trace_of_the_one_before(name: str) -> None:
    whole, rng = character(name), np.random.default_rng(12)
    used, state = DynamicsModel(whole), random_state(whole, rng)
    for _ in range(5):
        used.update(*random_state(whole, rng))
        used.solve(np.ones(whole.layout.size), np.ones(whole.layout.size), PERIOD)
        used.inverse_dynamics(np.ones(whole.layout.size))
    fresh = DynamicsModel(whole)

    used.update(*state)
    fresh.update(*(array.copy() for array in state))
    for array in state:  # the arrays are the caller's
        array[:] = 0.0

    for one, other in (
        (used.mass_matrix(), fresh.mass_matrix()),
        (used.bias_force(), fresh.bias_force()),
        (used.gravity_force(), fresh.gravity_force()),
        *zip(used.link_poses(), fresh.link_poses(), strict=True),
    ):
        assert one.tobytes() == other.tobytes()


@every_character
def test_the_drift_of_a_link_is_the_rate_of_its_jacobian(name: str) -> None:
    body = character(name)
    layout, step = body.layout, 1e-6
    position, velocity = random_state(body, np.random.default_rng(5))
    turned, model = layout.rotation_entries, DynamicsModel(body)
    link = len(body.links) - 1

    def jacobian_after(time: float) -> FloatArray:
        there = position + time * velocity
        there[turned] = rotations.log(
            rotations.multiply(
                rotations.exp(position[turned]), rotations.exp(time * velocity[turned])
            )
        )
        model.update(there, velocity)
        return model.link_jacobian(link)

    rate = (jacobian_after(step) - jacobian_after(-step)) / (2.0 * step)
    model.update(position, velocity)

    np.testing.assert_allclose(model.link_drift(link), rate @ velocity, atol=1e-4)
