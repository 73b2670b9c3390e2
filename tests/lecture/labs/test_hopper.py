"""The hop of lab 5: its reference, and windows that do not depend on the world."""

import numpy as np
import pytest

from lecture.labs.hopper import FOOT, JOINTS, WINDOW, advance, errors, hop, hopper, worlds
from lecture.labs.simulated import RATE
from msgs_config.character.dynamics import DynamicsModel


@pytest.mark.parametrize("speed", [0.9, 1.0, 1.2])
def test_the_reference_hops_from_standing_to_standing(speed: float) -> None:
    reference = hop(speed)

    assert (len(reference) - 1) * WINDOW / RATE == pytest.approx(2.4 / speed, abs=WINDOW / RATE)
    assert reference[0].tolist() == [0.0, 0.0, 0.0, 0.03, 0.0, 0.0]
    assert reference[-1] == pytest.approx([0.25, 0.0, 0.0, 0.03, 0.0, 0.0])
    assert 0.05 < reference[:, 1].max() <= 0.1
    assert reference[:, 1].min() == 0.0


def test_a_window_leads_to_the_same_state_in_whichever_world() -> None:
    """So the replay of one world repeats what the search has found in many."""
    character, rng = hopper(), np.random.default_rng(3)
    targets = hop(1.0)[1:9, np.newaxis, FOOT:] + rng.uniform(-0.5, 0.5, (8, 7, JOINTS))
    parents = rng.integers(0, 7, (8, 7))
    with worlds(character, 7) as many, worlds(character, 1) as one:
        for batch in (many, one):
            start = hop(1.0)[:1].repeat(len(batch), axis=0)
            batch.reset(position=start, velocity=np.zeros(start.shape))
        path = [4]
        for row in parents[:0:-1]:
            path.append(int(row[path[-1]]))
        for window, sample in enumerate(path[::-1]):
            advance(many, parents[window], targets[window])
            advance(one, np.zeros(1, dtype=np.intp), targets[window, sample : sample + 1])
            assert many.motion[sample].tobytes() == one.motion[0].tobytes()


def test_errors_are_of_the_centre_of_mass_by_hand() -> None:
    """A foot that slides moves all; a trunk that leans moves 37 of 57.2 kg on 0.3 m."""
    character = hopper()
    at = np.zeros((2, 6))
    at[0, 0], at[1, 5] = 0.2, 0.5
    velocity = np.zeros((2, 6))
    velocity[0, 0], velocity[1, 5] = 1.5, 2.0

    off = errors(DynamicsModel(character), at, velocity, np.zeros(6), np.zeros(6))

    share = 37.0 / 57.2 * 0.3
    sine, cosine = np.sin(0.5), np.cos(0.5)
    assert off.centre == pytest.approx(
        np.array([[0.2, 0.0], [share * sine, share * (cosine - 1.0)]])
    )
    assert off.centre_velocity == pytest.approx(
        np.array([[1.5, 0.0], [2.0 * share * cosine, -2.0 * share * sine]])
    )
    assert off.distances() == pytest.approx(np.hypot(*off.centre.T))
    assert off.joints.tolist() == [[0.0, 0.0, 0.0], [0.0, 0.0, 0.5]]
    assert off.foot.tolist() == [[0.2, 0.0, 0.0], [0.0, 0.0, 0.0]]


def test_a_heavier_hopper_has_more_mass() -> None:
    masses = [sum(link.mass for link in hopper(factor).links) for factor in (1.0, 1.1)]

    assert masses == pytest.approx([57.2, 1.1 * 57.2])
