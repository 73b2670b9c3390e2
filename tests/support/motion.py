"""What the tests of the references share: difference quotients, and characters to move."""

from collections.abc import Callable, Iterable

import numpy as np

from controller_node.references.base import ReferenceState
from controller_node.references.curve import Knots
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.character.model import Character
from tests.support.physics import FLOATING_TURNED_FRAMES, TURNED_FRAMES, character, random_state

MOVED = ["humanoid", "franka_panda", *TURNED_FRAMES]
"""Characters that have, together, every type of joint."""

FLOATING = ["humanoid", FLOATING_TURNED_FRAMES]
Sample = Callable[[float], ReferenceState]

_HALF_STEP = 1e-5  # s, of a central difference


def assert_moves_as_it_says(
    layout: JointLayout, sample: Sample, times: Iterable[float], tolerance: float = 1e-6
) -> None:
    """Velocity and acceleration are the difference quotients, in the layout's own terms."""
    for time in times:
        before, now, after = (sample(time + step) for step in (-_HALF_STEP, 0.0, _HALF_STEP))
        moved = layout.difference(before.configuration, after.configuration)
        gained = after.velocity - before.velocity
        scale = 1.0 + np.abs(now.velocity).max() + np.abs(now.acceleration).max()
        for quotient, given in ((moved, now.velocity), (gained, now.acceleration)):
            np.testing.assert_allclose(
                quotient / (2.0 * _HALF_STEP), given, rtol=0.0, atol=tolerance * scale**2
            )
        assert_consistent(layout, now)


def assert_consistent(layout: JointLayout, state: ReferenceState) -> None:
    """The position is message form of the same rotations: vectors no longer than pi."""
    position = state.configuration.position
    vectors = position[layout.rotation_entries]
    assert np.all(np.linalg.norm(vectors, axis=-1) <= np.pi + 1e-12)
    apart = layout.difference(state.configuration, layout.configuration(position))
    np.testing.assert_allclose(apart, 0.0, atol=1e-12)


def assert_same_place(
    layout: JointLayout, one: ReferenceState, other: ReferenceState, atol: float = 1e-12
) -> None:
    """Two states are of one configuration."""
    apart = layout.difference(one.configuration, other.configuration)
    np.testing.assert_allclose(apart, 0.0, atol=atol)


def assert_same_motion(
    layout: JointLayout, one: ReferenceState, other: ReferenceState, atol: float = 1e-10
) -> None:
    """Two states agree in configuration, velocity and acceleration."""
    assert_same_place(layout, one, other, atol)
    np.testing.assert_allclose(one.velocity, other.velocity, rtol=0.0, atol=atol)
    np.testing.assert_allclose(one.acceleration, other.acceleration, rtol=0.0, atol=10.0 * atol)


def random_knots(whole: Character, times: FloatArray, seed: int = 3) -> Knots:
    """Knots with positions within the limits, velocities and accelerations of a few units."""
    rng = np.random.default_rng(seed)
    states = [random_state(whole, rng) for _ in times]
    positions = np.array([position for position, _ in states])
    velocities = np.array([velocity for _, velocity in states])
    accelerations = rng.uniform(-3.0, 3.0, positions.shape)
    return Knots(times, whole.layout.configuration(positions), velocities, accelerations)


def loaded(name: str) -> tuple[Character, JointLayout]:
    """A character and its layout."""
    whole = character(name)
    return whole, whole.layout
