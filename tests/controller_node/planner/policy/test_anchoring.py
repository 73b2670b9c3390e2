"""Where the reference's world goes, compiled for trainings: what plain Python says, to the bit."""

import math

import numpy as np
import pytest

from controller_node.planner.anchor import Anchor, PlanarState
from controller_node.planner.compiled.anchoring import advance_anchor
from controller_node.planner.compiled.decorator import compiled
from msgs_config.geometry import rotations

FAST = compiled(advance_anchor)


def arguments(seed: int) -> tuple[complex | float, ...]:
    """Any arguments: near and far, at rest and on the way, just pushed and long calm."""
    rng = np.random.default_rng(seed)

    def pair(scale: float) -> complex:
        return complex(*(scale * rng.normal(size=2)))

    wanted, wanted_velocity = pair(3.0), pair(rng.choice((0.0, 0.01, 1.0)))
    centre = wanted + pair(rng.choice((0.0, 0.1, 0.5)))
    velocity = wanted_velocity + pair(rng.choice((0.0, 0.3, 1.0)))
    time = float(rng.uniform(0.0, 5.0))
    calm_from, settled_from = (float(each) for each in time + rng.uniform(-1.0, 1.0, 2))
    place, yaw = (0j, 0.0) if seed % 7 == 0 else (pair(1.0), float(rng.uniform(-4.0, 4.0)))
    off, turn = float(rng.normal()), float(rng.choice((0.0, 0.01, 0.5)))
    elapsed = float(rng.choice((0.0, 1 / 240, 1 / 30, 0.5, 4.0)))
    anchor = (place, yaw, calm_from, settled_from)
    soon = wanted_velocity + pair(rng.choice((0.0, 0.5)))
    return *anchor, centre, velocity, off, wanted, wanted_velocity, soon, turn, time, elapsed


def bits(results: tuple[complex | float, ...]) -> bytes:
    """All bits of what comes out, the sign of a zero among them."""
    return np.array(results, complex).tobytes()


def test_compiled_it_has_the_bits_of_plain_python() -> None:
    moved = 0
    for seed in range(3000):
        given = arguments(seed)
        plain = advance_anchor(*given)  # type: ignore[arg-type]
        assert bits(FAST(*given)) == bits(plain), given  # type: ignore[arg-type]
        moved += plain[:2] != given[:2]
    assert 1000 < moved < 3000


@pytest.mark.parametrize("seed", range(20))
def test_an_anchor_advances_by_it(seed: int) -> None:
    given = arguments(seed)
    place, yaw, calm_from, settled_from, centre, velocity, off, wanted, wanted_velocity = given[:9]
    velocity_soon, turn, time, elapsed = given[9:]
    state = PlanarState(centre, velocity, rotations.about_z(float(np.real(off))))  # type: ignore[arg-type]
    target = PlanarState(wanted, wanted_velocity, rotations.about_z(0.0), turn)  # type: ignore[arg-type]
    soon = PlanarState(0j, velocity_soon, rotations.about_z(0.0))  # type: ignore[arg-type]

    anchor = Anchor(place, yaw, calm_from, settled_from)  # type: ignore[arg-type]
    found = anchor.advanced(state, target, soon, time, elapsed)  # type: ignore[arg-type]

    expected = FAST(*given)  # type: ignore[arg-type]
    assert math.isclose(found.yaw, expected[1], abs_tol=1e-12)
    assert abs(found.place - expected[0]) < 1e-9
    assert (found.calm_from, found.settled_from) == expected[2:]
