"""What keys and the button ask a steered character for, and until when."""

import math

import pytest

from actuated_characters.viewer.controls.drive import KEYS, DrivingInput, Key, Velocity
from msgs_config.messages import typed


def key(name: str, modifier: str | None = None) -> Key:
    (found,) = [each for each in KEYS if (each.key, each.modifier) == (name, modifier)]
    return found


AHEAD, LEFT, RIGHT, SPACE = map(key, ("arrowup", "arrowleft", "arrowright", "space"))
RUN = key("arrowup", "shift")
STILL = Velocity()


def pressed(presses: list[tuple[float, Key]]) -> DrivingInput:
    found = DrivingInput()
    for time, each in presses:
        found = found.press(each, time)
    return found


def repeated(
    each: Key, first: float, last: float, *, delay: float = 0.5
) -> list[tuple[float, Key]]:
    """The presses of a key that is held from one time to another, as a system repeats it."""
    count = max(math.floor((last - first - delay) / 0.033) + 1, 0)
    return [(first, each), *((first + delay + 0.033 * number, each) for number in range(count))]


@pytest.mark.parametrize("delay", [0.25, 0.5, 0.66])
def test_a_held_key_asks_without_a_gap_and_stops_soon_after_it_is_let_go(delay: float) -> None:
    presses = repeated(AHEAD, 10.0, 13.0, delay=delay)

    for number, (time, _) in enumerate(presses[1:], 1):
        assert pressed(presses[:number]).until > time
    last = presses[-1][0]
    assert pressed(presses).velocity == Velocity(1.0)
    assert pressed(presses).until == pytest.approx(last + 0.4)


def test_keys_are_combined_and_the_repeats_of_the_last_one_keep_the_others() -> None:
    both = pressed([*repeated(AHEAD, 0.0, 1.0), *repeated(LEFT, 1.0, 3.0)])

    assert both.velocity == Velocity(1.0, 0.0, 0.8)
    assert both.until > 3.0
    assert both.press(RIGHT, 3.0).velocity == Velocity(1.0, 0.0, -0.8)


def test_what_is_over_counts_no_more() -> None:
    assert pressed([(0.0, AHEAD), (5.0, LEFT)]).velocity == Velocity(0.0, 0.0, 0.8)


def test_shift_runs_while_it_is_held_in_a_curve_too() -> None:
    running = pressed([*repeated(RUN, 0.0, 1.0), (1.0, key("arrowleft", "shift"))])

    assert running.velocity == Velocity(2.2, 0.0, 0.8)
    assert running.press(LEFT, 1.05).velocity == Velocity(1.0, 0.0, 0.8)


def test_space_stops_at_once() -> None:
    assert pressed([*repeated(RUN, 0.0, 1.0), (1.0, LEFT), (1.1, SPACE)]).velocity == STILL


def test_the_button_asks_for_a_velocity_while_it_sends() -> None:
    found = DrivingInput().hold(Velocity(0.5, 0.1, -0.2), 4.0)

    assert found.velocity == Velocity(0.5, 0.1, -0.2)
    assert 4.2 < found.until < 4.6  # two of its messages may be late


def test_the_message_has_the_velocity_in_the_characters_own_frame() -> None:
    twist = typed.decode(Velocity(1.0, 0.2, -0.8).encode(), typed.TWIST)

    assert (twist.linear.x, twist.linear.y, twist.linear.z) == (1.0, 0.2, 0.0)
    assert (twist.angular.x, twist.angular.y, twist.angular.z) == (0.0, 0.0, -0.8)
