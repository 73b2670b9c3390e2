"""The laws of balance, against the motion of the pendulum that they are made for."""

import cmath
import math

import numpy as np
import pytest

from controller_node.behaviours.state_machine import laws

GRAVITY, HEIGHT, STEP_TIME = 9.81, 0.85, 0.4
RATE = laws.pendulum_rate(HEIGHT, GRAVITY)


def falls(
    place: float, speed: float, foot: float, time: float, count: int = 20_000
) -> tuple[float, float]:
    """Place and speed of a linear inverted pendulum after a time, by small steps."""
    step = time / count
    for _ in range(count):
        half = speed + 0.5 * step * RATE * RATE * (place - foot)
        place += step * half
        speed = half + 0.5 * step * RATE * RATE * (place - foot)
    return place, speed


def test_a_body_comes_to_rest_above_a_foot_at_its_extrapolated_centre() -> None:
    foot = laws.extrapolated_centre(0.1, 0.7, RATE)

    place, speed = falls(0.1, 0.7, foot, 1.0)

    # what is left of the way and of the speed decays as exp(-w t)
    assert foot - place == pytest.approx((foot - 0.1) * math.exp(-RATE), rel=1e-3)
    assert speed == pytest.approx(RATE * (foot - place), rel=1e-3)


def test_the_extrapolated_centre_is_where_the_pendulum_takes_it() -> None:
    place, speed = falls(0.02, 0.3, -0.05, STEP_TIME)

    begun = laws.extrapolated_centre(0.02, 0.3, RATE)
    later = laws.extrapolated_later(begun, -0.05, RATE, STEP_TIME)

    assert laws.extrapolated_centre(place, speed, RATE) == pytest.approx(later, rel=1e-6)


@pytest.mark.parametrize("turn", [0.0, 0.5, -1.0])
@pytest.mark.parametrize("velocity", [0j, 0.4 + 0j, 1.2 + 0.3j, -0.3 - 0.2j])
def test_steps_by_the_offsets_of_velocity_and_width_repeat_along_the_bend(
    velocity: complex, turn: float
) -> None:
    """A pendulum that steps by them goes on like that, however it began.

    Hof's two results, and their like where the heading turns at an even rate.
    """
    width, steps = 0.2, 30
    x, y, feet, side = (0.0, 0.9), (0.05, -0.1), [0j], 1.0

    def heading(step: float) -> complex:
        return cmath.exp(1j * turn * STEP_TIME * step)

    for step in range(1, steps + 1):
        x = falls(*x, feet[-1].real, STEP_TIME, 1000)
        y = falls(*y, feet[-1].imag, STEP_TIME, 1000)
        centre = laws.extrapolated_centre(*x, RATE) + 1j * laws.extrapolated_centre(*y, RATE)
        offset = laws.offset_of_velocity(velocity, turn, STEP_TIME, RATE)
        offset -= side * laws.offset_of_width(width, turn, STEP_TIME, RATE)
        feet.append(centre - heading(step) * offset)
        side = -side

    # between the last two landings, of which the first one's foot is on `side`
    way = velocity * sum(STEP_TIME / 1000 * heading(steps - 1 + k / 1000) for k in range(1000))
    beside = side * 0.5j * width
    across = beside * (heading(steps - 0.5) + heading(steps + 0.5))
    assert abs(feet[-1] - feet[-2] - (way - across)) < 2e-4


def test_the_neutral_point_keeps_the_speed() -> None:
    """A leg swept evenly from there through half a stance is below the hip: it pushes no way."""
    assert laws.neutral_placement(2.0, 2.0, 0.3, 0.1) == pytest.approx(0.3)
    assert laws.neutral_placement(2.2, 2.0, 0.3, 0.1) > laws.neutral_placement(2.0, 2.0, 0.3, 0.1)
    assert laws.neutral_placement(0.0, 0.0, 0.3, 0.1) == 0.0


def test_the_pendulums_placement_brings_it_to_rest_upright() -> None:
    """All energy of the speed goes into the rise to the top of the arc, and none is left."""
    speed = 0.8
    ahead = laws.pendulum_placement(speed, HEIGHT, GRAVITY)

    length = math.hypot(ahead, HEIGHT)
    assert GRAVITY * (length - HEIGHT) == pytest.approx(0.5 * speed * speed, rel=1e-9)


def test_feedback_steps_to_where_the_body_goes() -> None:
    assert laws.feedback_angle(0.4, 0.1, 0.5, 0.5, 0.2) == pytest.approx(0.4 + 0.05 + 0.1)
    assert laws.feedback_angle(0.4, -0.1, -0.5, 0.5, 0.2) < 0.4


def test_a_stance_hip_balances_torso_and_swing_hip() -> None:
    # the torques on the torso of both hips together are what was wanted of it
    torso, swing = 35.0, -12.0
    stance = laws.stance_hip_torque(torso, swing)

    assert -(stance + swing) == pytest.approx(torso)


def test_an_arrival_is_by_the_cubic_through_both_ends() -> None:
    way, speed, last, time = 0.03, -0.5, 0.4, 0.2
    # the coefficients of x(t), lowest first, of x(0), x'(0), x(T) and x'(T)
    ends = np.array(
        (
            (1.0, 0.0, 0.0, 0.0),
            (0.0, 1.0, 0.0, 0.0),
            (1.0, time, time**2, time**3),
            (0.0, 1.0, 2.0 * time, 3.0 * time**2),
        )
    )
    cubic = np.linalg.solve(ends, (0.0, speed, way, last))

    assert laws.arrival_acceleration(way, speed, last, time) == pytest.approx(2.0 * cubic[2])


def test_a_smooth_step_begins_and_ends_at_rest() -> None:
    step = 1e-4
    assert (laws.smooth_step(0.0), laws.smooth_step(0.5), laws.smooth_step(1.0)) == (0.0, 0.5, 1.0)
    assert laws.smooth_step(step) < step * step
    assert 1.0 - laws.smooth_step(1.0 - step) < step * step
    assert (laws.clearance(0.0), laws.clearance(0.5), laws.clearance(1.5)) == (0.0, 1.0, 0.0)


def test_a_movement_carries_on_at_its_first_velocity_and_ends_at_rest() -> None:
    step = 1e-4
    slope = [
        (laws.carried_on(share + step) - laws.carried_on(share - step)) / (2.0 * step)
        for share in (step, 1.0 - step)
    ]

    assert laws.carried_on(0.0) == laws.carried_on(1.0) == laws.carried_on(1.5) == 0.0
    assert slope == pytest.approx([1.0, 0.0], abs=1e-5)
    # neither end has an acceleration
    for share in (0.0, 1.0 - 2.0 * step):
        near = [laws.carried_on(share + k * step) for k in range(3)]
        assert (near[2] - 2.0 * near[1] + near[0]) / step**2 == pytest.approx(0.0, abs=0.02)


def test_a_foot_that_is_led_back_has_its_last_velocity_at_the_end_and_from_there_on() -> None:
    shares = (0.0, 0.2, 0.5, 0.9, 1.0)

    # it is the other movement, seen from the other end
    for share in shares:
        assert laws.led_back(share) == pytest.approx(-laws.carried_on(1.0 - share), abs=1e-12)
    assert laws.led_back(1.25) == 0.25
