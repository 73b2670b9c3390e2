"""Velocities that are planned before a run: sent in time, acted on, and replayed."""

from pathlib import Path

import pytest

from actuated_characters.bags.recording import read_recording
from actuated_characters.replay.replay import replay
from actuated_characters.replay.through_topics import replay_states
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.files import write_planned
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.runs.planned.velocities import (
    PlannedVelocity,
    plan_velocities,
    read_velocities,
)
from controller_node.references.steering.reference import SteeredReference
from msgs_config.errors import ConfigurationError
from msgs_config.messages.clock import TickClock
from tests.support.runs import run_plan_here

RATE = 240
CLOCK = TickClock(RATE)


def plan_of(seconds: float, **controller: object) -> RunPlan:
    return make_plan("humanoid", seconds, {"reference": "steered"}, {"rate": RATE}, controller)


def test_each_velocity_has_the_stamp_of_its_tick_and_is_repeated_until_the_next() -> None:
    plan = plan_of(3.0, **{"steering.timeout": 1.0})

    _, planned = plan_velocities(plan, "0.8,0,0.3@0.25 0,0,0@1.5")

    # twice within the timeout, so that a lost tick or two do not stop it; a stop only once
    ticks = [60, 180, 300, 360]
    assert [each.stamp_ns for each in planned] == [CLOCK.stamp_ns(1 + tick) for tick in ticks]
    assert planned[2] == PlannedVelocity(CLOCK.stamp_ns(301), 0.8, 0.0, 0.3)
    assert planned[3] == PlannedVelocity(CLOCK.stamp_ns(361), 0.0, 0.0, 0.0)


def test_the_plans_reference_goes_where_the_velocities_lead() -> None:
    plan, _ = plan_velocities(plan_of(5.0), "0.7,0,0@1 0,0,0@4")

    assert isinstance(plan.reference, SteeredReference)
    # 3 s of 0.7 m/s, less the way to get there at 1.3 m/s^2, and the way to stop at 2.2 m/s^2
    assert plan.reference.course(5 * RATE).x == pytest.approx(
        2.1 - 0.245 / 1.3 + 0.245 / 2.2, abs=0.01
    )
    assert plan.reference.course(5 * RATE).forward == 0.0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "has no velocity"),
        ("0.8,0@2", "'0.8,0@2' is no velocity; write X,Y,TURN@S"),
        ("0.8,0,x@2", "is no velocity"),
        ("nan,0,0@2", "is no velocity"),
        ("0.8,0,0,5@2", "is no velocity"),
        ("1e999,0,0@2", "is no velocity"),
        ("0.8,0,0@inf", "is no velocity"),
        ("0.8,0,0@-2", "a velocity at -2 s; times must rise, from 0 s"),
        ("-0.8,0,0@2", "at most -0.6,0,0"),
        ("0.8,0,0@9", "a velocity at 9 s; times must rise, from 0 s to less than 5 s"),
        ("0.8,0,0@2 0,0,0@1", "a velocity at 1 s; times must rise"),
        ("9,0,0@2", "9,0,0 at 2 s is more than it can, which is at most 2.5,0,0"),
    ],
)
def test_what_cannot_be_is_one_clear_line(text: str, says: str) -> None:
    with pytest.raises(ConfigurationError, match=says):
        plan_velocities(plan_of(5.0), text)


def test_what_is_more_than_a_machine_takes_is_taken_within_its_limits_and_said() -> None:
    machine = {"behaviour": "state_machine", "machine": "walk"}
    plan = make_plan("humanoid", 5.0, {}, {"rate": RATE}, machine)

    taken, planned = plan_velocities(plan, "0.5,0,0.2@1 9,-2,9@2")

    assert (planned[-1].forward, planned[-1].left, planned[-1].turn) == (1.2, -0.3, 0.5)
    assert isinstance(taken.reference, SteeredReference)
    assert taken.reference.course(5 * RATE - 1).turn == 0.5
    (line,) = set(taken.warnings) - set(plan.warnings)
    assert line == (
        "--cmd-vel: 9,-2,9 at 2 s is more than the machine walk takes; it is taken as 1.2,-0.3,0.5"
    )


def test_only_a_steered_reference_takes_velocities() -> None:
    plan = make_plan("humanoid", 5.0, {"reference": "hold"}, {}, {})

    with pytest.raises(ConfigurationError, match="goes with --reference steered"):
        plan_velocities(plan, "0.8,0,0@2")


def test_the_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    _, planned = plan_velocities(plan_of(5.0), "0.1,0.2,0.3@2")
    write_planned(tmp_path / "velocities.json", planned)

    assert read_velocities(tmp_path / "velocities.json") == planned


@pytest.mark.slow
def test_a_steered_run_is_replayed_to_the_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, planned = plan_velocities(plan_of(1.2), "0.8,0.1,0.5@0.2 0,0,0@0.8")

    run_plan_here(plan, tmp_path / "run", PlannedInputs(velocities=planned))

    recording = read_recording(tmp_path / "run")
    assert recording.position[-1, 0] - recording.position[0, 0] > 0.2
    assert replay([recording]).identical
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    again = replay_states(tmp_path / "run", progress=lambda _: None, tell=lambda _: None)
    assert again.identical and again.states == 289
