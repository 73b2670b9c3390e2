"""Compiled code reads a state with the doubles of plain Python, wherever its parts stand."""

import numpy as np

from msgs_config.compiled.message_form import read_motion
from msgs_config.geometry import rotations, scalars


def test_a_state_is_read_with_the_same_bits() -> None:
    rng = np.random.default_rng(5)
    for size in (1e-6, 0.3, 3.0):
        turns = [rotations.exp(size * vector) for vector in rng.normal(size=(2, 3))]
        numbers, velocity = rng.normal(size=4), rng.normal(size=10)
        in_mujoco = [rotations.wxyz_from_xyzw(turn) for turn in turns]
        # a floating base, a hinge, and a ball joint
        position = np.concatenate((numbers[:3], in_mujoco[0], numbers[3:], in_mujoco[1]))
        places = [
            np.array(each, dtype=np.intp) for each in ([3, 8], [3, 7], [0, 1, 2, 7], [0, 1, 2, 6])
        ]

        found = read_motion(position, velocity, *places)

        vectors = [scalars.log(tuple(turn.tolist())) for turn in turns]
        expected = [*numbers[:3], *vectors[0], numbers[3], *vectors[1]]
        assert found[0].tobytes() == np.array(expected).tobytes()
        assert found[1].tobytes() == velocity.tobytes()
