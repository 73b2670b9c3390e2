"""A steered reference: where it goes by the laws of motion, and when commands begin and end."""

import math

import numpy as np
import pytest

from controller_node.parameters import PARAMETERS
from controller_node.references.factory import make_motion
from controller_node.references.steering.reference import SteeredReference
from controller_node.references.steering.velocity import VelocityCommand
from msgs_config.errors import ActuatedCharactersError, MotionError
from msgs_config.geometry import rotations
from msgs_config.parameters import resolve
from tests.support.physics import character

HUMANOID = character("humanoid")
RATE = 240
LASTING = {"steering.timeout": 1000.0}


def make(name: str = "humanoid", **settings: object) -> SteeredReference:
    given = {"reference": "steered", "rate": RATE, "steering.acceleration": 0.7, **settings}
    reference = make_motion(character(name), resolve(PARAMETERS, given)).reference
    assert isinstance(reference, SteeredReference)
    return reference


def steer(reference: SteeredReference, *commands: VelocityCommand) -> SteeredReference:
    for command in commands:
        reference = reference.steered(command, 0).reference
    return reference


def test_it_speeds_up_evenly_and_then_goes_on_evenly() -> None:
    reference = steer(make(**LASTING), VelocityCommand(0, 1.4))

    # to 1.4 m/s at 0.7 m/s^2 in 2 s, over v^2 / 2a = 1.4 m
    assert reference.course(2 * RATE).x == pytest.approx(1.4, abs=0.005)
    assert reference.course(2 * RATE).forward == pytest.approx(1.4)
    assert reference.course(5 * RATE).x == pytest.approx(1.4 + 3.0 * 1.4, abs=0.005)
    assert reference.course(5 * RATE).y == 0.0


def test_speed_and_turn_make_a_circle() -> None:
    reference = steer(make(**LASTING), VelocityCommand(0, 1.0, 0.0, 0.5))
    ticks = range(4 * RATE, 16 * RATE, RATE)

    course = reference.course(4 * RATE)
    centre = np.array((course.x, course.y)) + 2.0 * np.array(
        (-math.sin(course.heading), math.cos(course.heading))
    )
    for each in map(reference.course, ticks):
        away = math.dist((each.x, each.y), centre)
        assert away == pytest.approx(2.0, abs=0.005)  # v / omega


def test_it_goes_sideways_in_its_own_frame() -> None:
    turned = steer(make(**LASTING), VelocityCommand(0, 0.0, 0.0, 1.0))
    heading = turned.course(3 * RATE).heading
    reference = steer(turned, VelocityCommand(3 * RATE, 0.0, 0.3, 0.0))

    way = [reference.course(tick) for tick in (6 * RATE, 8 * RATE)]
    x, y = way[1].x - way[0].x, way[1].y - way[0].y
    assert math.hypot(x, y) == pytest.approx(0.6, abs=1e-6)
    left = way[1].heading + 0.5 * math.pi
    assert math.remainder(math.atan2(y, x) - left, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert heading > 2.0


def test_the_root_is_where_the_course_is() -> None:
    reference = steer(make(**LASTING), VelocityCommand(0, 1.2, 0.0, 0.4))

    for time in (1.0, 3.0, 7.5):
        course = reference.course(round(time * RATE))
        root = reference.sample(time).configuration.position[:2]
        assert root == pytest.approx((course.x, course.y), abs=0.08)  # it sways


def lean_of(reference: SteeredReference, start: float) -> tuple[float, float]:
    """How far the character leans ahead and to the left, rad: a second's mean from `start` s on."""
    leans = []
    for tick in range(round(start * RATE), round((start + 1.0) * RATE)):
        course = reference.course(tick)
        turn = reference.sample(tick / RATE).configuration.orientations_xyzw[0]
        upright = reference._gait.at(course.pace, course.phase)[0].orientations_xyzw[0]
        lean = rotations.multiply(turn, rotations.conjugate(upright))
        x, y, z = rotations.rotate(lean, np.array((0.0, 0.0, 1.0))).tolist()
        cosine, sine = math.cos(course.heading), math.sin(course.heading)
        leans.append((math.atan2(cosine * x + sine * y, z), math.atan2(cosine * y - sine * x, z)))
    ahead, left = np.mean(leans, axis=0)
    return float(ahead), float(left)


def test_it_leans_into_a_bend_as_a_bicycle_does() -> None:
    straight = steer(make(**LASTING), VelocityCommand(0, 2.0))
    bend = steer(make(**LASTING), VelocityCommand(0, 2.0, 0.0, -0.6))

    assert lean_of(straight, 5.0) == pytest.approx((0.0, 0.0), abs=1e-6)
    ahead, left = lean_of(bend, 5.0)
    assert left == pytest.approx(-math.atan(2.0 * 0.6 / 9.81), abs=1e-3)  # v omega / g
    assert ahead == pytest.approx(0.0, abs=1e-3)


def test_it_leans_ahead_to_speed_up_and_back_to_slow_down() -> None:
    reference = make(**{**LASTING, "steering.braking": 1.5})
    reference = steer(reference, VelocityCommand(0, 2.1), VelocityCommand(5 * RATE, 0.0))

    assert lean_of(reference, 1.5) == pytest.approx((math.atan(0.35 / 9.81), 0.0), abs=2e-3)
    assert lean_of(reference, 5.4)[0] < -0.06  # of atan(0.75 / 9.81) = 0.076
    assert lean_of(reference, 8.0) == pytest.approx((0.0, 0.0), abs=1e-4)


def test_leaning_the_root_stays_above_the_course_and_comes_lower() -> None:
    bend = steer(make(**LASTING), VelocityCommand(0, 2.0, 0.0, 0.9))
    course = bend.course(6 * RATE)

    position = bend.sample(6.0).configuration.position
    upright = bend._gait.at(course.pace, course.phase)[0].position
    assert math.dist(position[:2], (course.x, course.y)) < 0.02  # it sways
    lean = math.atan(2.0 * 0.9 / 9.81)
    assert position[2] == pytest.approx(math.cos(lean) * upright[2], abs=1e-3)


def test_its_velocity_leads_from_each_tick_to_the_next() -> None:
    reference = steer(make(**LASTING), VelocityCommand(0, 1.7, 0.1, -0.6))

    for tick in range(0, 3 * RATE, 37):
        now, following = (reference.sample(each / RATE) for each in (tick, tick + 1))
        moved = HUMANOID.layout.difference(now.configuration, following.configuration)
        assert moved * RATE == pytest.approx(now.velocity, abs=1e-9)


def test_a_command_acts_from_its_tick_on_and_changes_nothing_before() -> None:
    without = make(**LASTING)
    reference = steer(without, VelocityCommand(100, 0.8))

    for tick in range(101):
        assert reference.course(tick) == without.course(tick)
    assert reference.course(101).forward > 0.0


def test_without_another_command_it_stops() -> None:
    reference = steer(make(**{"steering.timeout": 0.5}), VelocityCommand(0, 0.7))

    speeds = [reference.course(tick).forward for tick in range(3 * RATE)]
    assert max(speeds) == pytest.approx(0.35)  # half a second at 0.7 m/s^2
    assert np.argmax(speeds) == RATE // 2
    assert speeds[RATE:] == [0.0] * len(speeds[RATE:])


def test_a_repeated_command_goes_on_and_is_another_motion_only_after_its_timeout() -> None:
    reference = make(**{"steering.timeout": 0.5})
    first = reference.steered(VelocityCommand(0, 0.7), 0)
    second = first.reference.steered(VelocityCommand(60, 0.7), 60)

    assert (first.since, second.since) == (0, 120)
    for tick in range(60, 121):
        assert second.reference.course(tick) == first.reference.course(tick)
    assert second.reference.course(170).forward > first.reference.course(170).forward


def test_it_does_not_matter_when_a_command_becomes_known() -> None:
    early = steer(make(**LASTING), VelocityCommand(0, 1.0), VelocityCommand(300, 0.5, 0.0, 0.7))
    late = steer(make(**LASTING), VelocityCommand(0, 1.0))
    late.sample(5.0)
    late = late.steered(VelocityCommand(300, 0.5, 0.0, 0.7), 299).reference

    for tick in (299, 300, 301, 900):
        assert late.course(tick) == early.course(tick)
        ours, theirs = (each.sample(tick / RATE) for each in (late, early))
        assert ours.configuration.position.tolist() == theirs.configuration.position.tolist()


def test_looking_back_gives_the_same_as_before() -> None:
    reference = steer(make(**LASTING), VelocityCommand(0, 1.0, 0.0, 0.3))
    early = reference.course(500)

    reference.course(20_000)

    assert reference.course(500) == early


def test_commands_are_kept_within_the_limits() -> None:
    reference = make(**{"steering.speed": 2.0, "steering.turn_rate": 0.8})

    taken = reference.steered(VelocityCommand(0, 9.0, -9.0, -9.0), 0).command
    assert (taken.forward, taken.left, taken.turn) == (2.0, -0.3, -0.8)
    assert reference.steered(VelocityCommand(0, -9.0), 0).command.forward == -0.6


@pytest.mark.parametrize("numbers", [(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0)])
def test_a_number_that_is_not_finite_is_rejected(numbers: tuple[float, float, float]) -> None:
    with pytest.raises(MotionError, match="it must be finite"):
        make().steered(VelocityCommand(0, *numbers), 0)


def test_a_flood_of_commands_to_come_is_rejected() -> None:
    reference = make()

    with pytest.raises(MotionError, match="yet to begin"):
        for tick in range(2000):
            reference = reference.steered(VelocityCommand(10 + tick, 0.5), 0).reference


@pytest.mark.slow
def test_commands_of_a_long_run_are_forgotten() -> None:
    reference = make()
    for tick in range(0, 60_000, 20):  # more than may wait
        reference = reference.steered(VelocityCommand(tick, 0.5), tick).reference
    assert reference.course(60_000).forward == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("name", "settings", "says"),
    [
        ("pendulum", {}, "needs a floating base"),
        ("humanoid", {"steering.walk": "nowhere"}, "'nowhere'"),
        ("humanoid", {"steering.run": "getup_facedown"}, "'getup_facedown'"),
        ("humanoid", {"steering.walk": "run", "steering.run": "walk"}, "must be faster"),
    ],
)
def test_what_cannot_be_steered_is_rejected(
    name: str, settings: dict[str, object], says: str
) -> None:
    with pytest.raises(ActuatedCharactersError, match=says):
        make(name, **settings)


def test_it_brakes_at_another_rate_than_it_speeds_up() -> None:
    settings = {"steering.acceleration": 0.5, "steering.braking": 2.0, **LASTING}
    reference = steer(make(**settings), VelocityCommand(0, 1.0), VelocityCommand(3 * RATE, 0.0))

    speeds = [reference.course(tick).forward for tick in range(4 * RATE)]
    assert speeds[RATE] == pytest.approx(0.5)
    assert speeds[3 * RATE + RATE // 4] == pytest.approx(0.5)
    assert speeds[3 * RATE + RATE // 2 + 1] == 0.0


def test_a_commanded_rest_pose_goes_where_it_is_told_to_whatever_the_character() -> None:
    reference = steer(make("laikago", reference="commanded"), VelocityCommand(0, 0.5, 0.0, 0.2))

    state = reference.sample(0.9)

    np.testing.assert_array_equal(
        state.configuration.position[6:], character("laikago").rest_position[6:]
    )
    speed, climb = np.linalg.norm(state.velocity[:2]), state.velocity[2]
    assert abs(speed - 0.5) < 1e-3 and abs(climb) < 1e-3
    assert abs(state.velocity[5] - 0.2) < 1e-3
