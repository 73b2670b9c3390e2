"""The studies `feedforward` and `forward_inverse`: efforts played again, efforts worked out."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from actuated_characters.runs.plan import make_plan
from actuated_characters.runs.planned_wrenches import PlannedPush
from actuated_characters.studies.catalogue import load_study
from actuated_characters.studies.framework import motion_replay
from actuated_characters.studies.framework.runner import TopicRunner
from actuated_characters.studies.framework.study import RunSpec, StudyResult
from controller_node.effort_series import read_effort_series
from controller_node.references.signals import SineReference
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.messages.clock import TickClock
from tests.support.in_process import InProcessRunner
from tests.support.physics import character

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

GRAVITY = 9.81


@pytest.fixture(scope="module")
def runner(tmp_path_factory: pytest.TempPathFactory) -> InProcessRunner:
    return InProcessRunner(Path(tmp_path_factory.mktemp("studies")))


@pytest.fixture(scope="module")
def feedforward(runner: InProcessRunner) -> StudyResult:
    return load_study("feedforward").run(runner)


@pytest.fixture(scope="module")
def forward_inverse(tmp_path_factory: pytest.TempPathFactory) -> StudyResult:
    runner = InProcessRunner(Path(tmp_path_factory.mktemp("studies")))
    return load_study("forward_inverse").run(runner)


def rows(result: StudyResult, **wanted: object) -> list[dict[str, object]]:
    """The rows of a table that have these cells; a column by the first word of its name."""
    whole = [dict(zip(result.columns, row, strict=True)) for row in result.rows]
    first = {column.split(" ")[0]: column for column in reversed(result.columns)}
    return [row for row in whole if all(row[first[k]] == v for k, v in wanted.items())]


def number(row: dict[str, object], column: str) -> float:
    value = row[column]
    assert isinstance(value, float)
    return value


# The maths


def test_efforts_go_through_a_table_to_the_last_bit(tmp_path: Path) -> None:
    # Arrange
    layout = character("humanoid").layout
    rng = np.random.default_rng(3)
    times, efforts = np.arange(20) / 240.0, rng.normal(size=(20, layout.size)) * 1e3
    file = tmp_path / "efforts.csv"

    # Act
    file.write_text(motion_replay.effort_table(layout, times, efforts), encoding="utf-8")
    series = read_effort_series(layout, str(file))

    # Assert
    again = [series.at(time) for time in times.tolist()]
    assert np.array(again).tobytes() == efforts.tobytes()


@pytest.mark.parametrize("name", ["lift", "pendulum"])
def test_the_efforts_of_a_motion_are_newtons(name: str) -> None:
    """`m (a + g)` of the mass, `I a + m g l sin` of the rod, at the middle of each tick."""
    # Arrange
    whole, period = character(name), 1e-3
    reference = SineReference(whole, list(whole.layout.dof_names), 0.3, 1.0)
    times = np.arange(0.0, 1.0, period)

    # Act
    efforts = motion_replay.efforts_along(DynamicsModel(whole), reference, times, period)[:, 0]

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
    cycle = 304  # ticks, of 1.2667 s

    efforts = motion_replay.efforts_along(model, plan.reference, np.arange(cycle) * period, period)

    assert efforts[:, 2].mean() == pytest.approx(model.weight, rel=0.005)
    assert np.abs(efforts[:, :2].mean(axis=0)).max() < 0.02 * model.weight
    assert np.linalg.norm(efforts[:, :3], axis=1).max() > 2.0 * model.weight  # at a frame


def test_the_order_of_an_error_is_its_power() -> None:
    periods = [0.1, 0.05, 0.01]

    assert motion_replay.orders(periods, [3.0 * h**2 for h in periods]) == pytest.approx([2.0, 2.0])


# What feedback is for


@pytest.mark.parametrize("name", ["kuka", "humanoid"])
def test_left_alone_the_torques_give_the_same_states_to_the_bit(
    feedforward: StudyResult, name: str
) -> None:
    opened, pushed = rows(feedforward, character=name, loop="open")

    assert opened["same states"] is True
    assert opened["push (N s)"] == 0.0
    assert pushed["same states"] is False
    assert pushed["push (N s)"] == pytest.approx(0.5)


def test_pushed_the_arm_drifts_away_in_open_loop_and_comes_back_in_closed_loop(
    feedforward: StudyResult,
) -> None:
    last = "in the last 0.5 s (rad)"
    alone, closed = rows(feedforward, character="kuka", loop="closed")
    _, opened = rows(feedforward, character="kuka", loop="open")

    assert number(closed, "largest afterwards (rad)") > 3.0 * number(
        alone, "largest afterwards (rad)"
    )
    assert number(closed, last) == pytest.approx(number(alone, last), rel=0.01)
    assert number(opened, last) > 100.0 * number(closed, last)


def test_pushed_the_walk_falls_in_open_loop_alone(feedforward: StudyResult) -> None:
    fell = [row["fell"] for row in rows(feedforward, character="humanoid")]

    assert fell == [False, False, False, True]  # closed, open; pushed: closed, open


def test_the_four_curves_are_one_until_the_push(feedforward: StudyResult) -> None:
    for name in ("kuka", "humanoid"):
        columns, values = feedforward.curves[f"feedforward_{name}"]
        before = values[values[:, 0] <= 1.0]
        assert columns[0] == "time_s"
        assert (np.ptp(before[:, 1:], axis=1) == 0.0).all()
        assert np.ptp(values[-1, 1:]) > 0.1


def test_the_study_draws_errors_and_poses(
    feedforward: StudyResult, runner: InProcessRunner
) -> None:
    assert set(feedforward.figures) == {"feedforward_error", "feedforward_walk"}
    assert all(isinstance(figure, Figure) for figure in feedforward.figures.values())
    assert len({case.label for case in runner.cases}) == load_study("feedforward").runs


# When inverse dynamics is the inverse


def test_on_a_fixed_base_the_motion_comes_back_but_for_a_share_of_the_tick(
    forward_inverse: StudyResult,
) -> None:
    arm = rows(forward_inverse, character="kuka")
    errors = [number(row, "joint error after 0.2 s (rad)") for row in arm]

    assert [row["rate (Hz)"] for row in arm] == [120, 240, 480, 960, 1920]
    assert errors[-1] < 1e-3
    for slower, faster in pairwise(errors):
        assert slower / faster == pytest.approx(2.0, rel=0.05)


def test_so_does_a_floating_base_with_the_roots_efforts(forward_inverse: StudyResult) -> None:
    walk = rows(forward_inverse, character="humanoid", root="fed forward")

    assert len(walk) == 3
    for row in walk[1:]:
        assert number(row, "order in the tick") == pytest.approx(1.0, abs=0.1)
    assert [row["fell"] for row in walk] == [False, False, False]


def test_without_them_it_falls(forward_inverse: StudyResult) -> None:
    (joints,) = rows(forward_inverse, character="humanoid", root="left out")

    assert joints["fell"] is True
    assert joints["ground"] == "yes"


def test_the_force_that_no_joint_gives_is_the_weight_in_the_mean(
    forward_inverse: StudyResult,
) -> None:
    columns, values = forward_inverse.curves["forward_inverse_root"]
    cycle = (values[:, 0] >= 1.2667 / 12.0) & (values[:, 0] < 1.2667 * 13.0 / 12.0)
    weight = character("humanoid").mass * GRAVITY

    assert columns == ["time_s", "root_force_n", "root_torque_nm"]
    assert values[cycle, 1].mean() == pytest.approx(weight, rel=0.05)  # mostly upwards
    assert f"{weight:.0f} N upwards" in forward_inverse.notes[2]


def test_the_weight_is_drawn_beside_the_force(forward_inverse: StudyResult) -> None:
    figure = forward_inverse.figures["forward_inverse_root"]
    (force, weight) = figure.axes[0].lines

    assert np.asarray(weight.get_ydata())[0] == pytest.approx(character("humanoid").mass * GRAVITY)
    assert str(force.get_label()) == "force"


# The laboratories


def test_a_run_in_this_process_is_that_of_the_nodes_to_the_bit(domain: int, tmp_path: Path) -> None:
    # Arrange
    del domain
    stamp_ns = TickClock(240).stamp_ns(30)
    case = RunSpec(
        label="pushed",
        character="pendulum",
        duration=0.5,
        reference={"reference": "sine"},
        controller={"law": "pd"},
        pushes=[PlannedPush(stamp_ns, "rod", (2.0, 0.0, 0.0, 0.0, 0.0, 0.0))],
        contacts=True,
    )

    # Act
    over_topics = TopicRunner(tmp_path, keep_runs=False, report=lambda label, share: None)
    by_nodes, here = (
        over_topics.run(case).recording,
        InProcessRunner(tmp_path).run(case).recording,
    )

    # Assert
    assert motion_replay.same_states(by_nodes, here)
    assert by_nodes.effort.tobytes() == here.effort.tobytes()
    assert by_nodes.reference_position[:-1].tobytes() == here.reference_position[:-1].tobytes()
    pushed = [bool(each and each.links) for each in here.applied_wrench]
    assert pushed == [bool(each and each.links) for each in by_nodes.applied_wrench]
    assert sum(pushed) == 24  # 0.1 s
    assert len(here.contacts) == len(by_nodes.contacts) == 120
