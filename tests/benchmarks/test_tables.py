"""Many runs as a table: what is drawn, thrown, weighed, measured, fitted and printed."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.runs.planned.throws import plan_throws
from actuated_characters.runs.planned.wrenches import parse_push
from benchmarks.tables import __main__ as command
from benchmarks.tables.captures import capture_cases
from benchmarks.tables.case import Case, heavier
from benchmarks.tables.machines import (
    FLIGHT,
    WALKS,
    jump_cases,
    jump_nudge,
    longest_span,
    machine_case,
    measure_jump,
    measure_run,
    run_cases,
    run_nudges,
    walk_cases,
)
from benchmarks.tables.many import Options, cell, rows
from benchmarks.tables.planned import PUSH_KINDS, course_cases, push_cases, time_to_stop
from benchmarks.tables.push_map import half_borne
from benchmarks.tables.seen import see
from controller_node.references.steering.reference import SteeredReference
from msgs_config.character.loading import load_character
from msgs_config.messages.clock import TickClock

RATE = 240


def test_a_cell_counts_what_is_yes_and_has_the_median_of_numbers() -> None:
    assert cell([True, False, True]) == "2 of 3"
    assert cell([0.25, 0.75, 0.5, None]) == "0.5 (0.25 to 0.75)"
    assert cell([None, "3.10", "7.00"]) == "3.10 7.00"
    assert cell([None]) == ""


def test_runs_of_one_row_are_one_line() -> None:
    done = [
        (Case("walk", 1.0), {"upright": True, "off, m": 0.1}),
        (Case("run", 1.0), {"upright": False, "off, m": 0.3}),
        (Case("walk", 1.0), {"upright": False, "off, m": 0.2, "fell at, s": "3.2"}),
    ]

    heading, *lines = rows(done)

    assert heading == ("", "upright", "off, m", "fell at, s")
    assert lines[0] == ("walk", "1 of 2", "0.15 (0.1 to 0.2)", "3.2")
    assert lines[1] == ("run", "0 of 1", "0.3", "")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["walk", "sppeds"], "unknown kind 'sppeds'; did you mean 'speeds'?"),
        (["clips", "walk", "--set", "sim_node.rat:=2"], "unknown parameter 'rat'"),
        (["run", "--machine", "rnu"], "unknown machine 'rnu'"),
        (["captures", "none.bvh"], "none.bvh"),
    ],
)
def test_a_mistake_is_one_line_before_anything_runs(
    options: list[str],
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["tables", *options])

    assert command.main() == 1

    error = capsys.readouterr().err
    assert message in error and error.startswith("error: ") and error.count("\n") == 1


@pytest.mark.slow
def test_the_command_prints_a_row_and_writes_each_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = tmp_path / "found.json"
    options = ["walk", "slalom", "--seconds", "2", "--processes", "1", "--out", str(found)]
    monkeypatch.setattr(sys, "argv", ["tables", *options])

    assert command.main() == 0

    assert "1 of 1" in capsys.readouterr().out
    assert '"row": "slalom"' in found.read_text() and '"upright": true' in found.read_text()


# Planned motion


def test_half_are_borne_where_a_logistic_curve_says_so() -> None:
    draw = np.random.default_rng(0)
    sides, sizes = draw.uniform(-math.pi, math.pi, 4000), draw.uniform(30.0, 200.0, 4000)
    true = 90.0 * np.exp(0.2 * np.cos(sides) - 0.1 * np.cos(2.0 * sides))
    borne = draw.uniform(size=4000) < 1.0 / (1.0 + (sizes / true) ** 8)
    around = np.array([0.0, math.pi / 2.0, math.pi])

    found = half_borne(sides, sizes, borne, around)

    expected = 90.0 * np.exp([0.1, 0.1, -0.3])
    np.testing.assert_allclose(found, expected, rtol=0.04)


def test_walks_are_pushed_as_their_kind_says() -> None:
    for kind in ("10 N s every 2 s", "48 or 60 N s", "any"):
        for case in push_cases(kind, Options(runs=6)):
            plan = case.plan()
            pushes = [parse_push(text, plan) for text in case.pushes]
            assert len(pushes) == PUSH_KINDS[kind].pushes
            for push in pushes:
                impulse = PUSH_KINDS[kind].lasts * math.hypot(*push.wrench[:2])
                assert {
                    "10 N s every 2 s": math.isclose(impulse, 10.0),
                    "48 or 60 N s": min(abs(impulse - 48.0), abs(impulse - 60.0)) < 1e-9,
                    "any": 40.0 <= impulse <= 240.0,
                }[kind]


def test_a_ball_arrives_from_its_side_at_its_time() -> None:
    (case,) = push_cases("balls", Options(runs=1))
    plan = case.plan()
    clock = TickClock(plan.simulation.rate_hz)

    throws, _ = plan_throws(plan, case.throws)

    assert len(throws) == 5 == len(case.throws)
    for text, thrown in zip(case.throws, throws, strict=True):
        arrives = float(text.partition("at=")[2].split()[0])
        ball, velocity = thrown.throw, np.array(thrown.throw.velocity[:2])
        flies = arrives - (clock.first_tick_from(thrown.stamp_ns) - 1) / clock.rate_hz
        chest = plan.reference.sample(arrives).configuration.position[:2]
        assert ball.mass == 2.5 and 0.1 < flies < 0.3
        assert math.hypot(*velocity) == pytest.approx(8.0)
        left = chest - np.array(ball.position[:2]) - flies * velocity
        assert 0.0 < float(left @ velocity) / 8.0 < 0.4  # touches, and has not passed
        assert abs(float(left[0] * velocity[1] - left[1] * velocity[0])) / 8.0 < 0.15


def test_a_heavier_character_is_heavier_and_else_the_same(tmp_path: Path) -> None:
    usual = load_character("humanoid")
    other = load_character(heavier("humanoid", 1.1, tmp_path))

    assert other.layout.dof_names == usual.layout.dof_names
    for one, link in zip(other.links, usual.links, strict=True):
        assert one.mass == pytest.approx(1.1 * link.mass)
        inertia = 1.1 * np.array(link.inertia_diagonal)
        np.testing.assert_allclose(one.inertia_diagonal, inertia, rtol=1e-6)


def reference_of(kind: str) -> SteeredReference:
    (case,) = course_cases(kind, Options(runs=1))
    reference = case.plan().reference
    assert isinstance(reference, SteeredReference)
    return reference


def test_the_eight_is_a_circle_to_the_left_and_one_to_the_right_walked_and_run() -> None:
    reference = reference_of("eight")
    courses = [reference.course(tick) for tick in range(0, 60 * RATE, RATE // 10)]

    turned = np.unwrap([each.heading for each in courses])
    ends = [turned[round(10 * time)] for time in (1.0, 16.7, 32.4, 41.4, 50.4)]
    full = 2.0 * math.pi
    assert np.diff(ends) == pytest.approx([full, -full, full, -full], abs=0.7)  # at 1.5 rad/s^2
    assert max(each.forward for each in courses[:300]) == pytest.approx(1.0)
    assert max(each.forward for each in courses) == pytest.approx(2.2)
    assert (courses[0].forward, courses[-1].forward) == (0.0, 0.0)


def test_a_zig_zag_turns_to_the_left_and_right_in_turn_within_the_limits() -> None:
    (case,) = course_cases("zig-zag", Options(runs=1))
    velocities = [
        tuple(map(float, each.split("@")[0].split(","))) for each in case.commands.split()
    ]
    ahead, aside, turns = np.array(velocities).T
    reference = reference_of("zig-zag")
    times = [float(each.split("@")[1]) for each in case.commands.split()]

    assert len(turns) > 20
    assert (turns[1:] * turns[:-1] < 0.0).all()
    assert not aside.any()
    assert (ahead.min() >= 0.4, ahead.max() <= 2.2, np.abs(turns).max() <= 1.0) == (True,) * 3
    assert np.abs(ahead * turns).max() == pytest.approx(1.5, abs=0.01)
    seen = [reference.course(round(time * RATE) - 1).turn for time in times[1:]]
    assert (np.sign(seen) == np.sign(turns[:-1])).all()


def test_the_stop_is_from_the_largest_speed() -> None:
    reference = reference_of("stop")

    assert reference.limits.speed == pytest.approx(2.5)
    assert reference.course(round(5.5 * RATE)).forward == pytest.approx(2.5)
    stands = 5.5 + 2.5 / reference.limits.braking
    assert reference.course(round(stands * RATE) - 2).forward > 0.0
    assert reference.course(round(stands * RATE) + 2).forward == 0.0


def test_a_root_has_stopped_when_it_is_slow_for_good() -> None:
    time = np.arange(4 * RATE) / RATE
    speed = np.clip(2.5 - 1.25 * time, 0.0, None)  # it stands after 2 s
    roots = np.column_stack((np.cumsum(speed) / RATE, np.zeros(len(time))))

    # the mean over the quarter of a second around 1.88 s is that at 1.88 s: 0.15 m/s
    assert time_to_stop(roots, RATE) == pytest.approx(1.88, abs=0.02)
    assert time_to_stop(roots[:RATE], RATE) == math.inf
    assert time_to_stop(np.zeros((RATE, 2)), RATE) == 0.0


@pytest.mark.slow
def test_a_capture_is_tracked_with_assistance_and_planned(tmp_path: Path) -> None:
    assisted, alone = capture_cases("cmu_walk", Options(folder=tmp_path))

    assert assisted.facts["up, unit, rest"] == "y, ?, T"
    assert str(assisted.facts["worst joint, rad"]).startswith("right_ankle 0.0")
    planners = [each.plan().controller["planner"] for each in (assisted, alone)]
    assert planners == ["none", "predictive"]


# Machines


def test_every_walk_can_be_planned_and_lasts_longer_than_its_beginning(tmp_path: Path) -> None:
    for kind in WALKS:
        case, *_ = walk_cases(kind, Options(folder=tmp_path))
        assert case.plan().ticks == round(case.seconds * RATE)
        assert 0.0 < case.since < case.seconds


def test_nudges_of_a_jump_are_small_and_of_their_seeds() -> None:
    pushes = [jump_nudge(seed) for seed in range(1, 41)]

    forces, times = zip(*(text.removeprefix("root:").split("@") for text in pushes), strict=True)
    sizes = [math.hypot(*(float(number) for number in force.split(",")[:2])) for force in forces]
    assert 10.0 <= min(sizes) < 12.0 and 28.0 < max(sizes) <= 30.0
    assert min(float(time) for time in times) < 0.8 and max(float(time) for time in times) > 2.8
    assert jump_nudge(1) == pushes[0] and len(set(pushes)) == 40


def test_the_longest_span_is_found() -> None:
    assert longest_span([True, False, True, True, False]) == (2, 4)
    assert longest_span([False, False]) == (0, 0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["undisturbed", "nudged"])
def test_a_jump_flies_for_a_quarter_of_a_second_and_stands(kind: str) -> None:
    case, *_ = jump_cases(kind, Options(first_seed=2))

    facts = measure_jump(see(case))

    assert facts["succeeded"]
    assert isinstance(facts["flight, s"], float) and FLIGHT < facts["flight, s"] < 0.5


@pytest.mark.slow
def test_what_has_no_flight_is_no_jump() -> None:
    facts = measure_jump(see(machine_case("stands", 4.0, "walk")))

    assert isinstance(facts["flight, s"], float) and facts["flight, s"] < 0.01
    assert not facts["succeeded"]


def test_nudges_of_a_run_are_small_and_one_in_each_four_seconds() -> None:
    pushes = run_nudges(3, 5.0, 20.0)

    times = [float(text.split("@")[1]) for text in pushes]
    assert len(pushes) == 5 and [int((time - 5.0) / 4.0) for time in times] == [0, 1, 2, 3, 4]
    for text in pushes:
        x, y, z = (float(number) for number in text.removeprefix("root:").split("@")[0].split(","))
        assert 10.0 <= math.hypot(x, y) <= 30.0 and z == 0.0


@pytest.mark.nightly
@pytest.mark.slow
def test_a_run_has_flights_at_the_speed_that_it_is_told() -> None:
    (case,) = run_cases("nudged", Options(runs=1, seconds=4.0))

    facts = measure_run(see(case))

    assert facts["succeeded"]
    assert facts["speed, m/s"] == pytest.approx(2.1, abs=0.2)
    (stop,) = run_cases("stops", Options(runs=1))
    assert measure_run(see(stop))["succeeded"]


@pytest.mark.nightly
@pytest.mark.slow
def test_a_walk_is_no_run() -> None:
    (case,) = run_cases("nudged", Options(runs=1, seconds=2.0, machine="walk"))

    assert not measure_run(see(case))["succeeded"]
