"""What is sent of an input of some size, and how it is said; all numbers by hand."""

import pytest

from actuated_characters.runs.planned.pins import PlannedPin
from actuated_characters.runs.planned.throws import PlannedThrow
from actuated_characters.runs.planned.velocities import PlannedVelocity
from actuated_characters.runs.planned.wrenches import PlannedPush
from actuated_characters.shrink.inputs import (
    Event,
    Input,
    PinInput,
    PushInput,
    Setting,
    SettingInput,
    ThrowInput,
    VelocityInput,
    velocity_inputs,
    without_needless_stops,
)
from msgs_config.messages.throw import ProjectileThrow

RATE = 240  # Hz


def push(force: tuple[float, ...], torque: tuple[float, ...] = (0.0, 0.0, 0.0)) -> PlannedPush:
    return PlannedPush(5, "chest", (*force, *torque), (0.0, 0.0, 0.1))


def pushed(*rows: int, planned: PlannedPush, is_at_centre: bool = True) -> PushInput:
    return PushInput(rows[0], RATE, [(row, planned) for row in rows], is_at_centre)


def setting(before: object, value: object) -> SettingInput:
    return SettingInput(120, RATE, "some.name", before, value)


def contents(given: Input, size: float) -> list[object]:
    return [event.content for event in given.events(size)]


def test_a_push_is_sent_before_its_tick_with_a_share_of_its_force() -> None:
    given = pushed(504, planned=push((0.0, 300.0, -60.0)))

    assert given.events(1.0) == [Event(505, push((0.0, 300.0, -60.0)))]
    assert given.events(0.25) == [Event(505, push((0.0, 75.0, -15.0)))]
    assert not given.events(0.0)


def test_an_option_says_a_number_to_the_bit() -> None:
    given = pushed(0, planned=push((1.0 / 3.0, -141.7, 0.0)))

    assert given.describe(1.0) == "--push chest:0.3333333333333333,-141.7,0@0"
    assert -141.7 * 0.712 == -100.89039999999999  # as floats have it
    assert given.describe(0.712) == "--push chest:0.237333333333,-100.8904,0@0"
    assert contents(given, 0.712) == [push((0.237333333333, -100.8904, 0.0))]


def test_a_push_is_said_as_run_takes_it() -> None:
    given = pushed(504, planned=push((0.0, 300.0, -60.0)))

    assert given.describe(0.25) == "--push chest:0,75,-15@2.1"


def test_a_long_push_is_an_option_for_each_part() -> None:
    given = pushed(0, 24, planned=push((10.0, 0.0, 0.0)))

    assert [event.stop for event in given.events(1.0)] == [1, 25]
    assert given.describe(1.0) == "--push chest:10,0,0@0 --push chest:10,0,0@0.1"


def test_a_push_that_no_option_can_say_is_in_words() -> None:
    given = pushed(240, planned=push((8.0, 0.0, 0.0), (0.0, 0.0, 2.0)), is_at_centre=False)

    assert given.describe(0.5) == (
        "push on 'chest' at 1 s of 4,0,0 N, torque 0,0,1 N m at the link's point 0,0,0.1 m"
    )


def test_a_lighter_ball_flies_the_same_way() -> None:
    ball = ProjectileThrow(2.0, 0.1, (2.0, 0.0, 1.0), (-8.0, 0.0, 0.5))
    given = ThrowInput(48, RATE, PlannedThrow(7, ball))

    lighter = ProjectileThrow(0.5, 0.1, (2.0, 0.0, 1.0), (-8.0, 0.0, 0.5))
    assert given.events(0.25) == [Event(49, PlannedThrow(7, lighter))]
    assert given.describe(0.25) == (
        "a ball with a radius of 0.1 m of 0.5 kg, let go at 0.2 s at 2,0,1 m with -8,0,0.5 m/s"
    )


def test_a_ball_is_never_lighter_than_one_can_be() -> None:
    ball = ProjectileThrow(0.002, 0.1, (2.0, 0.0, 1.0), (-8.0, 0.0, 0.5))

    (sent,) = contents(ThrowInput(0, RATE, PlannedThrow(1, ball)), 0.1)

    assert isinstance(sent, PlannedThrow)
    assert sent.throw.mass == 0.001


@pytest.mark.parametrize(
    ("before", "value", "size", "sent"),
    [
        (1.0, 0.2, 0.5, 0.6),
        (0.0, 8.0, 0.125, 1.0),
        (10, 20, 0.26, 13),
        ([0.0, 1.0], [1.0, 3.0], 0.5, [0.5, 2.0]),
        ("pd", "zero", 1.0, "zero"),
    ],
)
def test_a_changed_parameter_goes_a_share_of_its_way(
    before: object, value: object, size: float, sent: object
) -> None:
    assert setting(before, value).events(size) == [Event(120, Setting("some.name", sent))]


@pytest.mark.parametrize(
    ("before", "value"),
    [("pd", "zero"), (False, True), (float("inf"), 10.0), ([1.0], [1.0, 2.0]), (1.0, "x")],
)
def test_what_has_nothing_between_has_no_size(before: object, value: object) -> None:
    assert not setting(before, value).is_scalable


def test_numbers_have_a_size() -> None:
    for before, value in ((1.0, 2.0), (1, 2), ([0.0, 1.0], [1.0, 1.0])):
        assert setting(before, value).is_scalable


def test_to_let_go_of_a_pin_is_always_sent() -> None:
    held = PinInput(10, RATE, PlannedPin(1, "chest", (0.0, 0.0, 1.0), 400.0))
    let_go = PinInput(20, RATE, PlannedPin(2, "chest", (0.0, 0.0, 0.0), 0.0))

    assert not held.events(0.0)
    assert held.events(0.5) == [Event(11, PlannedPin(1, "chest", (0.0, 0.0, 1.0), 200.0))]
    assert let_go.events(0.0) == [Event(21, let_go.pin)]
    assert not let_go.can_be_left_out


def velocity(stamp_ns: int, forward: float, turn: float = 0.0) -> PlannedVelocity:
    return PlannedVelocity(stamp_ns, forward, 0.0, turn)


def steered(*velocities: PlannedVelocity) -> list[VelocityInput]:
    """Of velocities that are all sent before the first state, a stamp of n counting from row 10 n.

    This is how a run sends those of `--cmd-vel`.
    """
    rows = {each.stamp_ns: 10 * each.stamp_ns for each in velocities}
    return velocity_inputs([(0, each) for each in velocities], rows, RATE)


def test_a_repeated_velocity_is_one_input() -> None:
    found = steered(velocity(1, 0.6), velocity(2, 0.6), velocity(3, 0.3, 0.4), velocity(4, 0.0))

    assert [each.row for each in found] == [10, 30, 40]
    assert [each.can_be_left_out for each in found] == [True, True, False]
    assert found[1].describe(0.5) == "--cmd-vel 0.15,0,0.2@0.125"


def test_a_velocity_that_is_left_out_is_one_stop() -> None:
    first, second, third = steered(
        velocity(1, 0.6), velocity(2, 0.3), velocity(3, 0.3), velocity(4, 0.8)
    )

    events = [*first.events(1.0), *second.events(0.0), *third.events(0.5)]

    assert without_needless_stops(events) == [
        Event(0, velocity(1, 0.6)),
        Event(0, velocity(2, 0.0)),
        Event(0, velocity(4, 0.4)),
    ]


def test_without_any_velocity_there_is_no_stop() -> None:
    first, stop = steered(velocity(1, 0.6), velocity(2, 0.0))

    assert without_needless_stops([*first.events(0.0), *stop.events(0.0)]) == []
