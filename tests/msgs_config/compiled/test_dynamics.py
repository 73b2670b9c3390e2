"""The compiled law and model have the bits of the same functions called one by one."""

import copy
import pickle
from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from controller_node.control_laws import stable_pd_effort
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.compiled import dynamics as compiled
from tests.support.physics import character, random_state

PERIOD = 1.0 / 240.0


def random_gains(rng: np.random.Generator, size: int) -> tuple[FloatArray, FloatArray]:
    return rng.uniform(0.0, 500.0, size), rng.uniform(0.0, 50.0, size)


@pytest.mark.parametrize("name", ["humanoid", "laikago", "pendulum"])
@pytest.mark.parametrize("is_moved", [False, True], ids=["plain", "offset and feedforward"])
def test_the_law_has_the_bits_of_its_equation(name: str, is_moved: bool) -> None:
    whole = character(name)
    model, rng, size = DynamicsModel(whole), np.random.default_rng(4), whole.layout.size
    for _ in range(200):
        position, velocity = random_state(whole, rng)
        desired, desired_velocity = random_state(whole, rng)
        stiffness, damping = random_gains(rng, size)
        offset = rng.normal(size=size) if is_moved else None
        feedforward = rng.normal(size=size) if is_moved else None

        found = model.stable_pd(
            position,
            velocity,
            desired,
            desired_velocity,
            stiffness,
            damping,
            PERIOD,
            offset,
            feedforward,
        )

        model.update(position, velocity)
        error = model.error_of_state(desired)
        expected = stable_pd_effort(
            model,
            stiffness,
            damping,
            error if offset is None else error + offset,
            velocity,
            desired_velocity,
            PERIOD,
            0.0 if feedforward is None else feedforward,
        )
        np.testing.assert_array_equal(found, expected)


def test_a_state_is_taken_over_as_mujoco_does() -> None:
    whole = character("humanoid")
    model, rng = DynamicsModel(whole), np.random.default_rng(5)
    position, velocity = random_state(whole, rng)
    model.update(position, velocity)

    data = mujoco.MjData(model._model)
    data.qpos[:] = model._identity
    mujoco.mj_integratePos(model._model, data.qpos, position, 1.0)
    data.qvel[:] = velocity
    mujoco.mj_kinematics(model._model, data)
    mujoco.mj_comPos(model._model, data)
    mujoco.mj_crb(model._model, data)
    mujoco.mj_comVel(model._model, data)

    for part in ("qpos", "qvel", "xpos", "xquat", "subtree_com", "M", "cvel"):
        np.testing.assert_array_equal(getattr(model._data, part), getattr(data, part))


@pytest.mark.parametrize(
    "given",
    [
        lambda array: np.repeat(array, 2)[::2],
        lambda array: np.flip(array[::-1].copy()),
        lambda array: np.frombuffer(array.tobytes()),
        lambda array: array.tolist(),
    ],
    ids=["every second entry", "from the end", "read-only", "Python's floats"],
)
def test_any_array_is_read_as_the_one_it_equals(
    given: Callable[[FloatArray], FloatArray],
) -> None:
    whole = character("humanoid")
    model, rng = DynamicsModel(whole), np.random.default_rng(6)
    arrays = [*random_state(whole, rng), *random_state(whole, rng)]
    arrays += random_gains(rng, whole.layout.size)

    found = model.stable_pd(*[given(each) for each in arrays], PERIOD)

    np.testing.assert_array_equal(found, model.stable_pd(*arrays, PERIOD))


@pytest.mark.parametrize("make", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_a_copy_takes_over_states_of_its_own(
    make: Callable[[DynamicsModel], DynamicsModel],
) -> None:
    whole = character("humanoid")
    model, rng = DynamicsModel(whole), np.random.default_rng(7)
    first, second = random_state(whole, rng), random_state(whole, rng)
    model.update(*first)

    other = make(model)
    other.update(*second)

    fresh = DynamicsModel(whole)
    fresh.update(*first)
    np.testing.assert_array_equal(model.mass_matrix(), fresh.mass_matrix())
    fresh.update(*second)
    np.testing.assert_array_equal(other.mass_matrix(), fresh.mass_matrix())


@pytest.mark.parametrize("kind", [np.float32, int])
def test_other_numbers_are_taken_as_the_doubles_that_they_equal(kind: type) -> None:
    whole = character("humanoid")
    model, rng = DynamicsModel(whole), np.random.default_rng(8)
    others = [
        (3.0 * each).astype(kind) for each in (*random_state(whole, rng), *random_state(whole, rng))
    ]
    doubles = [each.astype(float) for each in others]
    gains = random_gains(rng, whole.layout.size)

    found = model.stable_pd(*others, *gains, PERIOD)
    np.testing.assert_array_equal(found, model.stable_pd(*doubles, *gains, PERIOD))

    model.update(*others[:2])
    bias = model.bias_force()
    model.update(*doubles[:2])
    np.testing.assert_array_equal(bias, model.bias_force())


def test_nothing_more_is_compiled_for_other_numbers() -> None:
    model, singles = DynamicsModel(character("pendulum")), np.zeros(1, dtype=np.float32)
    with pytest.raises(TypeError, match="No matching definition"):
        compiled.take_state(model.view, singles, singles)


@pytest.mark.parametrize("length", [0, 3, 50])
def test_a_position_of_another_length_is_refused(length: int) -> None:
    whole = character("humanoid")
    model, size = DynamicsModel(whole), whole.layout.size
    right, wrong = np.zeros(size), np.zeros(length)

    with pytest.raises(ValueError, match="one entry a degree of freedom"):
        model.update(wrong, right)
    with pytest.raises(ValueError, match="one entry a degree of freedom"):
        model.stable_pd(right, right, wrong, right, right, right, PERIOD)
