"""How often a character fell, and what its controller says that it is doing."""

import numpy as np
import pytest

from actuated_characters.metrics.falls import reader_for
from actuated_characters.viewer.drawing.name_tag import FallCounter, mode_of
from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.messages.state import StampedState

STEP = 0.1  # s between two pictures
CHARACTER = load_character("humanoid")
STANDING = np.array(CHARACTER.rest_position)


def counter() -> FallCounter:
    reader = reader_for(CHARACTER)
    assert reader is not None
    return FallCounter(reader)


def lying() -> FloatArray:
    position = STANDING.copy()
    position[2] = 0.1
    return position


def show(counter: FallCounter, positions: list[FloatArray], first: int = 0) -> int:
    for number, position in enumerate(positions, first):
        rest = np.zeros_like(position)
        counter.take(StampedState(round(1e9 * STEP * (number + 1)), position, rest, rest))
    return counter.count


def test_a_fall_counts_once_and_the_next_one_after_it_stood() -> None:
    falls = counter()

    assert show(falls, 3 * [STANDING]) == 0
    assert show(falls, 10 * [lying()], 3) == 1
    assert show(falls, 3 * [STANDING] + 10 * [lying()], 13) == 2


def test_a_moment_on_the_ground_is_no_fall() -> None:
    assert show(counter(), [STANDING, lying(), lying(), STANDING]) == 0


def test_a_simulator_that_began_anew_begins_with_no_falls() -> None:
    falls = counter()
    show(falls, 10 * [lying()])

    assert show(falls, [STANDING]) == 0


def test_a_new_episode_has_no_falls_where_its_stamps_go_on() -> None:
    falls = counter()
    show(falls, 10 * [lying()])
    falls.begin_episode()

    assert show(falls, [STANDING], 10) == 0
    assert show(falls, 10 * [lying()], 11) == 1


@pytest.mark.parametrize(
    ("text", "mode"),
    [
        ('{"mode": "LIMP", "stamp_ns": 1}', "LIMP"),
        ('{"mode": "STATE", "state": "crouch"}', "crouch"),
        ("{}", ""),
        ("no JSON", ""),
        ("[]", ""),
    ],
)
def test_a_mode_is_read_from_its_message(text: str, mode: str) -> None:
    assert mode_of(text) == mode
