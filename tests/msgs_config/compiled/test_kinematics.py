"""Inverse kinematics: the Jacobian against finite differences."""

import numpy as np
import pytest

from controller_node.references.posing import Posing
from msgs_config.compiled import kinematics
from msgs_config.geometry import rotations
from tests.support.physics import character

STEP = 1e-6  # rad or m


@pytest.mark.parametrize("name", ["humanoid", "franka_panda", "laikago", "kuka"])
@pytest.mark.parametrize("seed", range(3))
def test_a_point_and_its_link_move_as_the_jacobian_says(name: str, seed: int) -> None:
    whole, rng = character(name), np.random.default_rng(seed)
    body, size = Posing(whole)._body, whole.layout.size
    bases = rotations.exp(rng.normal(size=(len(whole.links), 3)))
    point, q = rng.normal(size=3), rng.normal(size=size)
    link, columns = len(whole.links) - 1, np.zeros((size, 6))

    def at(coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        frames = np.empty((len(whole.links), 7))
        kinematics.find_frames(body, bases, coordinates, frames)
        return np.array(kinematics.point_of(frames, link, point)), frames[link, 3:]

    frames = np.empty((len(whole.links), 7))
    kinematics.find_frames(body, bases, q, frames)
    kinematics.write_jacobian(body, frames, q, link, point, 1.0, 1.0, columns)

    for entry in range(size):
        moved = STEP * np.eye(size)[entry]
        (before, turn_before), (after, turn_after) = at(q - moved), at(q + moved)
        turn = rotations.log(rotations.multiply(turn_after, rotations.conjugate(turn_before)))
        expected = np.concatenate((after - before, turn)) / (2.0 * STEP)
        assert columns[entry] == pytest.approx(expected, abs=1e-8)
