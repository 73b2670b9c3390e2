"""What a policy is to keep: clips, and drives of all moods."""

import math

import numpy as np
import pytest

from actuated_characters.training.exercises import Exercise, random_drive
from controller_node.references.steering.velocity import SteeringLimits, VelocityRegion
from msgs_config.errors import ActuatedCharactersError

LIMITS = SteeringLimits()


def velocities(drive: str) -> np.ndarray:
    """Ahead, to the left, turn and time (m, 4)."""
    return np.array(
        [[float(each) for each in part.replace("@", ",").split(",")] for part in drive.split()]
    )


def test_a_drive_has_all_moods() -> None:
    forward, left, turn, time = velocities(random_drive(LIMITS, 960.0, 0)).T

    assert time[0] == 0.0 and 956.0 < time[-1] < 960.0
    assert 1.0 <= np.diff(time).min() < 1.5 and 3.5 < np.diff(time).max() <= 4.01
    assert forward.max() > 2.2 and forward.min() < -0.3
    assert left.min() < -0.2 and left.max() > 0.2
    assert turn.min() < -0.6 and turn.max() > 0.6
    assert ((forward == 0.0) & (left == 0.0) & (turn == 0.0)).sum() > 5
    assert ((forward > 0.3) & (turn == 0.0)).sum() > 10


@pytest.mark.parametrize(
    "limits",
    [
        LIMITS,
        SteeringLimits(speed=0.2, turn_rate=0.118),
        SteeringLimits(speed=0.0, turn_rate=0.0),
        SteeringLimits(region=VelocityRegion(ahead=1.0, back=0.0, aside=0.0, turn=0.3)),
    ],
)
def test_a_drive_keeps_the_limits_and_is_told_by_its_seed(limits: SteeringLimits) -> None:
    drive = random_drive(limits, 120.0, 3)

    assert drive == random_drive(limits, 120.0, 3)
    assert drive != random_drive(limits, 120.0, 4)
    forward, left, turn, _ = velocities(drive).T
    assert forward.max() <= min(limits.speed, limits.region.ahead)
    assert -forward.min() <= limits.region.back
    assert abs(left).max() <= limits.region.aside
    assert abs(turn).max() <= min(limits.turn_rate, limits.region.turn)


@pytest.mark.parametrize("seconds", [0.05, 1.0, 60.0])
def test_every_mood_begins_before_the_end(seconds: float) -> None:
    for seed in range(300):
        *_, time = velocities(random_drive(LIMITS, seconds, seed)).T
        assert time[0] == 0.0 and time[-1] < seconds - 0.01


def test_how_long_a_command_holds_does_not_matter() -> None:
    long, short = (
        Exercise("humanoid", "steered").plan(9.0, {}, {"steering.timeout": timeout}, 1)
        for timeout in (1.0, 0.1)
    )

    assert long[1] == short[1]
    ends = [plan.reference.sample(8.9).configuration.position for plan, _ in (long, short)]
    np.testing.assert_array_equal(*ends)


def test_it_is_played_within_the_limits() -> None:
    slow = {"steering.speed": 0.8}

    assert Exercise("humanoid", "steered").options(slow) == ["--cmd-vel", "0.8,0,0@0"]


def test_a_steered_run_goes_where_the_drive_says() -> None:
    plan, sent = Exercise("humanoid", "steered").plan(10.0, {}, {}, 1)
    way = np.array([plan.reference.sample(t).configuration.position[:2] for t in (0.0, 9.9)])

    again, _ = Exercise("humanoid", "steered").plan(10.0, {}, {}, 1)
    other, _ = Exercise("humanoid", "steered").plan(10.0, {}, {}, 2)
    end, same, another = (
        each.reference.sample(9.9).configuration.position[:2] for each in (plan, again, other)
    )

    assert len(sent) > 2
    assert np.linalg.norm(way[1] - way[0]) > 0.5
    np.testing.assert_array_equal(end, same)
    assert np.linalg.norm(end - another) > 0.5


@pytest.mark.parametrize(
    ("name", "begins", "tried", "options"),
    [
        ("walk", 1.27, 60.0, ["--clip", "walk"]),
        ("kick", 1.533, 1.533, ["--clip", "kick"]),
        ("steered", 960.0, 60.0, ["--cmd-vel", "1,0,0@0"]),
    ],
)
def test_how_long_it_is_and_how_it_is_played(
    name: str, begins: float, tried: float, options: list[str]
) -> None:
    exercise = Exercise("humanoid", name)

    assert math.isclose(exercise.cycle_s, begins, abs_tol=0.05)
    assert math.isclose(exercise.tried_s, tried, abs_tol=0.05)
    assert exercise.options({}) == options


def test_a_clip_that_is_not_there_is_said() -> None:
    with pytest.raises(ActuatedCharactersError, match="wlak"):
        _ = Exercise("humanoid", "wlak").cycle_s
