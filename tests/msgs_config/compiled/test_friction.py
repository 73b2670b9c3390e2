"""What contacts ask for along a surface, and what that takes off the normal."""

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.compiled.friction import ask_for_friction

FREELY, MOST = 10.0, 0.3  # m/s^2, and a share of what a contact pushes back with


def asked(normal: float, along: tuple[float, float], friction: float = 0.5) -> FloatArray:
    """What is asked for of a contact that without constraints falls at 10 m/s^2."""
    rows = np.array([1.0, 2.0, normal, *along])  # two rows of something else come first
    smooth = np.array([7.0, 7.0, -10.0, 3.0, 4.0])
    ask_for_friction(rows, smooth, np.array([[friction, 0.0]]), np.array([2], dtype=np.int32))
    assert rows[:2].tolist() == [1.0, 2.0]
    return rows[2:]


def test_what_a_contact_can_give_is_asked_for() -> None:
    assert asked(0.0, (6.0, -8.0)).tolist() == [0.0, 6.0, -8.0]


@pytest.mark.parametrize("normal", [0.0, 100.0, 1000.0])
def test_what_will_be_missing_is_taken_off_the_normal(normal: float) -> None:
    up, *along = asked(normal, (60.0, -80.0)).tolist()

    size = np.hypot(*along)
    assert up == pytest.approx(normal - 0.5 * (size - FREELY))
    assert along[1] / along[0] == pytest.approx(-80.0 / 60.0)
    # it goes on pressing, and asks for no more than that leaves room for
    assert normal - up <= MOST * (normal + 10.0) * (1.0 + 1e-12)
    assert size == pytest.approx(min(100.0, FREELY + MOST * (normal + 10.0) / 0.5))


def test_what_is_pulled_off_faster_asks_for_little_and_is_pressed_no_less() -> None:
    up, *along = asked(-20.0, (60.0, -80.0)).tolist()

    assert up == -20.0
    assert np.hypot(*along) == pytest.approx(FREELY)


def test_a_contact_without_rows_is_left_out() -> None:
    rows = np.array([1.0, 50.0, 50.0])

    ask_for_friction(rows, np.zeros(3), np.array([[0.5, 0.0]]), np.array([-1], dtype=np.int32))

    assert rows.tolist() == [1.0, 50.0, 50.0]
