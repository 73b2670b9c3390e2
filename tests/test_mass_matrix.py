"""The mass matrix from the links' masses and frames, against what the engine's steps show."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from physics import (
    EVERY_CHARACTER,
    LoneWorld,
    acceleration,
    character,
    character_id,
    random_state,
    without_self_collision,
)

from sim_node.mass_matrix import MassMatrix, yielding
from sim_node.mobility import still_settings

WITH_JOINTS = [name for name in EVERY_CHARACTER if character(name).layout.actuated_joint_names]


@pytest.mark.parametrize("name", WITH_JOINTS, ids=character_id)
def test_what_joints_yield_is_what_the_engine_says(name: str) -> None:
    # Arrange
    whole = without_self_collision(name)
    size = whole.layout.size
    position, _ = random_state(whole, np.random.default_rng(1))
    joints = np.eye(size)[6 if whole.layout.has_floating_base else 0 :]
    with LoneWorld(whole, still_settings(gravity=0.0)) as world:
        measured = []
        for effort in joints:
            world.body.set_state(position, np.zeros(size))
            measured.append(acceleration(world, effort) @ joints.T)

    # Act
    found = yielding(MassMatrix(whole).at(position), joints)

    # Assert
    scale = np.abs(measured).max()
    np.testing.assert_allclose(found / scale, np.array(measured) / scale, atol=1e-9)


def test_the_mass_of_the_base_is_that_of_the_whole() -> None:
    whole = character("humanoid")
    position, _ = random_state(whole, np.random.default_rng(2))

    matrix = MassMatrix(whole).at(position)

    np.testing.assert_allclose(matrix[:3, :3], whole.mass * np.eye(3), atol=1e-9)
    np.testing.assert_array_equal(matrix, matrix.T)


@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.integers(1, 4))
def test_yielding_is_j_inverse_m_j_transposed(seed: int, size: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size))
    matrix, rows = root @ root.T + np.eye(size), rng.normal(size=(count, size))

    expected = rows @ np.linalg.solve(matrix, rows.T)

    np.testing.assert_allclose(yielding(matrix, rows), expected, atol=1e-9)
