"""The studies `feedforward` and `forward_inverse`: efforts played again, efforts worked out."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from actuated_characters.runs.plan import make_plan
from controller_node.references.signals import SineReference
from lecture import feedforward, forward_inverse
from lecture.framework.result import StudyResult
from msgs_config.character.dynamics import DynamicsModel
from tests.support.in_process import InProcessRunner
from tests.support.physics import character

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

GRAVITY = 9.81
EARLY, LAST = "joint error after 0.2 s (rad)", "in the last 0.5 s (rad)"
AFTERWARDS = "largest afterwards (rad)"


@pytest.fixture(scope="module")
def played(runner: InProcessRunner) -> StudyResult:
    return runner.study("feedforward")


@pytest.fixture(scope="module")
def inverted(tmp_path_factory: pytest.TempPathFactory) -> StudyResult:
    return InProcessRunner(tmp_path_factory.mktemp("studies")).study("forward_inverse")


def rows(result: StudyResult, **wanted: object) -> list[dict[str, Any]]:
    """The rows of a table that have these cells."""
    return [dict(row) for row in result.rows if all(row[k] == v for k, v in wanted.items())]


# The maths


@pytest.mark.parametrize("name", ["lift", "pendulum"])
def test_the_efforts_of_a_motion_are_newtons(name: str) -> None:
    """`m (a + g)` of the mass, `I a + m g l sin` of the rod, at the middle of each tick."""
    # Arrange
    whole, period = character(name), 1e-3
    reference = SineReference(whole, list(whole.layout.dof_names), 0.3, 1.0)
    times = np.arange(0.0, 1.0, period)

    # Act
    model = DynamicsModel(whole)
    efforts = forward_inverse.efforts_along(model, reference, times, period)[:, 0]

    # Assert
    states = [reference.sample(time) for time in times.tolist()]
    angle = np.array([state.configuration.position[0] for state in states])
    middle = [reference.sample(time + 0.5 * period).acceleration[0] for time in times.tolist()]
    if name == "lift":
        expected = np.array(middle) + GRAVITY
    else:  # a rod of 1 kg and 1 m about its end
        expected = np.array(middle) / 3.0 + GRAVITY * 0.5 * np.sin(angle)
    np.testing.assert_allclose(efforts, expected, atol=1e-4)


def test_the_efforts_count_a_jump_of_the_velocity_too() -> None:
    """Over a clip's cycle the momentum is back where it was: the mean force is the weight."""
    plan = make_plan("humanoid", 2.0, {"reference": "clip", "clip": "walk"}, {}, {})
    model, period = DynamicsModel(plan.character), 1.0 / 240.0
    times = np.arange(304) * period  # a cycle, of 1.2667 s

    efforts = forward_inverse.efforts_along(model, plan.reference, times, period)

    assert efforts[:, 2].mean() == pytest.approx(model.weight, rel=0.005)
    assert np.abs(efforts[:, :2].mean(axis=0)).max() < 0.02 * model.weight
    assert np.linalg.norm(efforts[:, :3], axis=1).max() > 2.0 * model.weight  # at a frame


def test_the_order_of_an_error_is_its_power() -> None:
    periods = [0.1, 0.05, 0.01]

    found = forward_inverse.orders(periods, [3.0 * h**2 for h in periods])

    assert found == pytest.approx([2.0, 2.0])


# What feedback is for


@pytest.mark.parametrize("name", ["kuka", "humanoid"])
def test_left_alone_the_torques_give_the_same_states_to_the_bit(
    played: StudyResult, name: str
) -> None:
    opened, pushed = rows(played, character=name, loop="open")

    assert opened["same states"] is True
    assert opened["push (N s)"] == 0.0
    assert pushed["same states"] is False
    assert pushed["push (N s)"] == pytest.approx(0.5)


def test_pushed_the_arm_drifts_away_in_open_loop_and_comes_back_in_closed_loop(
    played: StudyResult,
) -> None:
    alone, closed = rows(played, character="kuka", loop="closed")
    _, opened = rows(played, character="kuka", loop="open")

    assert closed[AFTERWARDS] > 3.0 * alone[AFTERWARDS]
    assert closed[LAST] == pytest.approx(alone[LAST], rel=0.01)
    assert opened[LAST] > 100.0 * closed[LAST]


def test_pushed_the_walk_falls_in_open_loop_alone(played: StudyResult) -> None:
    fell = [row["fell"] for row in rows(played, character="humanoid")]

    assert fell == [False, False, False, True]  # closed, open; pushed: closed, open


def test_the_four_curves_are_one_until_the_push(played: StudyResult) -> None:
    for name in ("kuka", "humanoid"):
        curves = played.curves[f"feedforward_{name}"]
        before = curves["time_s"] <= 1.0
        errors = np.stack([curve for name, curve in curves.items() if name != "time_s"])
        assert (np.ptp(errors[:, before], axis=0) == 0.0).all()
        # A walk without feedback falls, and may whirl until its run ends before the others.
        last = np.flatnonzero(np.isfinite(errors).all(axis=0))[-1]
        assert curves["time_s"][last] > 2.5
        assert np.ptp(errors[:, last]) > 0.1


def test_the_study_draws_errors_and_poses(played: StudyResult, runner: InProcessRunner) -> None:
    assert set(played.figures) == {"feedforward_error", "feedforward_walk"}
    assert len({case.label for case in runner.cases}) == feedforward.RUNS


# When inverse dynamics is the inverse


def test_on_a_fixed_base_the_motion_comes_back_but_for_a_share_of_the_tick(
    inverted: StudyResult,
) -> None:
    arm = rows(inverted, character="kuka")
    errors = [row[EARLY] for row in arm]

    assert [row["rate (Hz)"] for row in arm] == [120, 240, 480, 960, 1920]
    assert errors[-1] < 1e-3
    for slower, faster in pairwise(errors):
        assert slower / faster == pytest.approx(2.0, rel=0.05)


def test_so_does_a_floating_base_with_the_roots_efforts(inverted: StudyResult) -> None:
    walk = rows(inverted, character="humanoid", **{"root efforts": "fed forward"})

    assert [row["fell"] for row in walk] == [None, None, None]  # in the air
    assert [row["order in the tick"] for row in walk[1:]] == pytest.approx([1.0, 1.0], abs=0.1)


def test_without_them_it_falls(inverted: StudyResult) -> None:
    (joints,) = rows(inverted, character="humanoid", **{"root efforts": "left out"})

    assert joints["fell"] is True
    assert joints["ground"] == "yes"


def test_the_force_that_no_joint_gives_is_the_weight_in_the_mean(inverted: StudyResult) -> None:
    curves = inverted.curves["forward_inverse_root"]
    times, force = curves["time_s"], curves["root_force_n"]
    cycle = (times >= 1.2667 / 12.0) & (times < 1.2667 * 13.0 / 12.0)
    weight = character("humanoid").mass * GRAVITY

    assert list(curves) == ["time_s", "root_force_n", "root_torque_nm"]
    assert force[cycle].mean() == pytest.approx(weight, rel=0.05)  # mostly upwards
    assert f"{weight:.0f} N upwards" in inverted.remarks[2]


def test_the_weight_is_drawn_beside_the_force(inverted: StudyResult) -> None:
    force, weight = inverted.figures["forward_inverse_root"].axes[0].lines

    assert np.asarray(weight.get_ydata())[0] == pytest.approx(character("humanoid").mass * GRAVITY)
    assert str(force.get_label()) == "force"


# The runners
